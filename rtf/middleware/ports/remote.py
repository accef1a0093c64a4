"""Admin requests to other ports: whether they exist, their connections, and changes of these.

These are the dialogues of YARP's own tools, over ``text_ack``.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

from rtf.bottle import Bottle, BottleError, Property, Vocab, as_int, as_string
from rtf.middleware.carriers import registry
from rtf.middleware.errors import ConnectError, MiddlewareError, NameNotFoundError, ProtocolError
from rtf.middleware.ports.qos import Qos
from rtf.middleware.wire.lines import TEXT_ACK, LineSender

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.middleware.ports.network import Network
    from rtf.middleware.wire.contact import Contact

#: Sends a command line, and a data line if there is one, and returns the lines of the reply.
Ask: TypeAlias = Callable[..., list[str]]
_ADMIN = "admin"


@contextlib.contextmanager
def talk(network: Network, target: Contact, label: str = _ADMIN, patience: float | None = None) -> Iterator[Ask]:
    """Open a text connection to a port, under a label that is not a port name. Raises ConnectError.

    The block is given a function for requests, which raises MiddlewareError if there is no reply.
    """
    found = network.resolve(target)
    if found is None:
        raise NameNotFoundError(f"no port {target.name} is registered")
    with contextlib.closing(network.reach(found, patience)) as stream:
        sender = LineSender(stream, acknowledged=True)
        stream.run(sender.greet(TEXT_ACK.header, label))
        yield lambda *lines: stream.run(sender.ask(*lines))


def administer(network: Network, target: Contact, request: Bottle, patience: float | None = None) -> Bottle:
    """Send an admin request to a port and return the reply. Raises ConnectError and WaitTimeoutError.

    ``patience`` is how many seconds a wait for the port may take; None: the network's.
    """
    with talk(network, target, patience=patience) as ask:
        return admin_request(ask, request.to_text())


def admin_request(ask: Ask, request: str) -> Bottle:
    """Send an admin request over a text connection. Raises ProtocolError for a reply that is no bottle."""
    reply = " ".join(ask("a", request))
    try:
        return Bottle.parse(reply)
    except BottleError as error:
        raise ProtocolError(f"a port answered {request} with {reply[:60]!r}: {error}") from None


def describe(network: Network, target: Contact, label: str = "<ping>") -> list[str]:
    """Return the port's description of itself and its connections, by lines."""
    with talk(network, target, label) as ask:
        return ask("*")


def exists(network: Network, target: Contact) -> bool:
    """Return whether a port is registered and answers."""
    try:
        return len(administer(network, target, Bottle([Vocab("ver")]))) > 0
    except MiddlewareError:
        return False


def connection(network: Network, source: Contact, target: Contact) -> Bottle | None:
    """Return the properties of the connection from ``source`` to ``target``, asked of the source; None without one."""
    found = administer(network, source, Bottle([Vocab("list"), Vocab("out"), target.name]))
    return found if found.check("carrier") else None


def connect(network: Network, source: Contact, target: Contact, carrier: str = "") -> str:
    """Connect ``source`` to ``target``. Return the reply of the port that opens the connection. Raises ConnectError.

    That is the source, or the target if the carrier is one by which a reader asks for messages, such as ``mjpeg``.

    The carrier is the one written in the target, else in the source, else ``carrier``, else tcp.
    """
    chosen = target.carrier or source.carrier or carrier or "tcp"
    asked, other = (target, source) if registry.pulls(chosen) else (source, target)
    return _judged(administer(network, asked, Bottle([Vocab("add"), str(other.by(chosen))])))


def disconnect(network: Network, source: Contact, target: Contact) -> str:
    """Disconnect ``source`` from ``target``. Return the reply of the source. Raises ConnectError.

    A connection that the target has opened, as by ``mjpeg``, is unknown to the source by its name; the target ends it.
    """
    reply = administer(network, source, Bottle([Vocab("del"), target.name]))
    if as_int(reply.get(0)) != 0:
        own = administer(network, target, Bottle([Vocab("list"), Vocab("in"), source.name]))
        if registry.pulls(as_string(own.find("carrier"))):
            reply = administer(network, target, Bottle([Vocab("del"), source.name]))
    return _judged(reply)


def connection_qos(network: Network, source: Contact, target: Contact) -> tuple[Qos, Qos]:
    """Return the quality of service of both ends of a connection: source, target. Raises ConnectError."""
    return _read_qos(network, source, target), _read_qos(network, target, source)


def set_connection_qos(
    network: Network, source: Contact, target: Contact, wanted: Qos, of_target: Qos | None = None
) -> None:
    """Set the quality of service at both ends; ``of_target`` is that of the target if it differs.

    An end with nothing to set is not asked. Raises ConnectError for an end that refuses; an end that was set before
    keeps the new setting.
    """
    for asked, other, one in ((source, target, wanted), (target, source, wanted if of_target is None else of_target)):
        if one == Qos():
            continue
        reply = administer(network, asked, Bottle([Vocab("prop"), Vocab("set"), other.name, *one.to_settings()]))
        if as_string(reply.get(0)) != "ok" and reply.get(0) != Vocab("ok"):
            raise ConnectError(
                f"{asked.name} did not set {one} for its connection with {other.name}: "
                f"{as_string(reply.get(1)) or 'it may lack the privilege, or the connection has no thread of its own'}"
            )


def _read_qos(network: Network, asked: Contact, other: Contact) -> Qos:
    reply = administer(network, asked, Bottle([Vocab("prop"), Vocab("get"), other.name]))
    if not reply.check("qos"):
        raise ConnectError(f"{asked.name}: {as_string(reply.get(1)) or 'it gave no reason'}")
    return Qos.from_property(Property.from_bottle(reply))


def _judged(reply: Bottle) -> str:
    text = as_string(reply.get(1)).strip()
    if as_int(reply.get(0)) != 0 or len(reply) == 0:
        raise ConnectError(text or "the port did not report a result")
    return text
