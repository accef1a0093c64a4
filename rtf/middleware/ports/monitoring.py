"""Port monitors at the connections of a port: what passes, and what it becomes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Property, as_string, to_string
from rtf.middleware.errors import ConnectError, ProtocolError
from rtf.middleware.types.codecs import codec_of
from rtf.middleware.wire import modifiers
from rtf.middleware.wire.incoming_message import IncomingMessage, LocalMessage
from rtf.middleware.wire.outgoing_message import OutgoingMessage

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from rtf.middleware.monitors.attached import Attached
    from rtf.middleware.monitors.script import ScriptName
    from rtf.middleware.types.codecs import Codec

NAME = "portmonitor"


def of_connection(found: Mapping[str, Bottle], side: str) -> ScriptName | None:
    """Return the script that the modifiers of a connection name for ``recv`` or ``send``. Raises ConnectError."""
    if as_string(found.get(side, Bottle()).get(0)) != NAME:
        return None
    from rtf.middleware.monitors.script import ScriptName

    return ScriptName.of(found)


def of_request(words: Bottle) -> ScriptName:
    """Return the script of the admin command ``[atch]``, such as ``"(type lua) (file limit)"``. Raises ConnectError."""
    from rtf.middleware.monitors.script import ScriptName

    text = " ".join(as_string(word) if isinstance(word, str) else to_string(word) for word in words)
    return ScriptName.of_property(Property.from_bottle(Bottle.parse(text)))


def attach(
    name: ScriptName, report: Callable[[str], None], *, source: str, destination: str, carrier: str, sends: bool
) -> Attached:
    """Load a script and begin. Raises ConnectError if it cannot be loaded."""
    from rtf.middleware.monitors.attached import Attached

    info = {
        "source": source,
        "destination": destination,
        "carrier": carrier,
        "sender_side": int(sends),
        "receiver_side": int(not sends),
    }
    attached = Attached(name, info, report)
    if not attached.works:
        raise ConnectError(f"the port monitor {name.file} did not begin")
    return attached


def at_input(
    text: str, report: Callable[[str], None], *, source: str, destination: str, carrier: str
) -> Attached | None:
    """Return the monitor that the modifiers ``text`` of an incoming connection ask for. Raises ProtocolError."""
    try:
        name = of_connection(modifiers.read(text), "recv")
        if name is None:
            return None
        return attach(name, report, source=source, destination=destination, carrier=carrier, sends=False)
    except ConnectError as error:
        raise ProtocolError(str(error)) from None


def incoming(
    message: IncomingMessage, monitors: Iterable[Attached], others: Callable[[], Iterable[Attached]]
) -> IncomingMessage | None:
    """Return what a received message has become; None if it is dropped."""
    for one in monitors:
        if not one.passes(message, others):
            return None
        changed = one.updated(message)
        if changed is not None:
            message = message.replaced(changed)
    return message


def reply(message: IncomingMessage, name: str, monitors: Iterable[Attached]) -> None:
    """Change the reply to a message that the port has answered."""
    for one in monitors:
        answered = message.as_reply(name)
        changed = one.updated_reply(answered)
        if changed is not None:
            message.reply(changed)


def outgoing(
    message: OutgoingMessage, sender: str, monitors: Iterable[Attached], others: Callable[[], Iterable[Attached]]
) -> OutgoingMessage | None:
    """Return what a message to be sent has become; None if it is not sent."""
    for one in monitors:
        seen = LocalMessage(sender, message)
        if not one.passes(seen, others):
            return None
        changed = one.updated(seen)
        if changed is not None:
            message = OutgoingMessage(message.key, changed, codec_of(changed), message.dialect, message.envelope)
    return message


def received_reply(
    value: object, codec: Codec[object], message: OutgoingMessage, peer: str, monitors: Iterable[Attached]
) -> object:
    """Return what the reply to a sent message has become, as the type of ``codec``."""
    for one in monitors:
        changed = one.updated_reply(LocalMessage(peer, OutgoingMessage("d", value, codec, message.dialect)))
        if changed is not None:
            written = b"".join(codec_of(changed).encode(changed, message.dialect))
            value = codec.decode(written, message.dialect)
    return value
