"""What is asked of ports elsewhere: whether they are there, what they are connected to, and to change that.

These are the dialogues of YARP's own tools, over ``text_ack``.
"""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Property, Vocab, as_int, as_string
from rtf.middleware.carriers.text import TextAck, TextOutput
from rtf.middleware.errors import ConnectError, MiddlewareError, NameNotFoundError
from rtf.middleware.qos import Qos

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.middleware.names import Contact
    from rtf.middleware.network import Network

_ADMIN = "admin"


@contextlib.contextmanager
def talk(network: Network, target: Contact, label: str = _ADMIN, patience: float | None = None) -> Iterator[TextOutput]:
    """A text connection to a port, under a label that is no port's name. Raises ConnectError."""
    found = network.resolve(target)
    if found is None:
        raise NameNotFoundError(f"no port {target.name} is registered")
    with contextlib.closing(network.reach(found, patience)) as stream:
        yield TextAck().call(stream, label)


def administer(network: Network, target: Contact, request: Bottle, patience: float | None = None) -> Bottle:
    """Put a question of administration to a port. Raises ConnectError and WaitTimeoutError.

    ``patience`` is how many seconds may pass without a word from it; None: the network's.
    """
    with talk(network, target, patience=patience) as link:
        link.send_lines("a", request.to_text())
        return Bottle.parse(" ".join(link.receive_lines()))


def describe(network: Network, target: Contact, label: str = "<ping>") -> list[str]:
    """What a port says of itself, a line each."""
    with talk(network, target, label) as link:
        link.send_lines("*")
        return link.receive_lines()


def exists(network: Network, target: Contact) -> bool:
    """Whether a port is registered and answers."""
    try:
        return len(administer(network, target, Bottle([Vocab("ver")]))) > 0
    except MiddlewareError:
        return False


def connection(network: Network, source: Contact, target: Contact) -> Bottle | None:
    """How an output of ``source`` to ``target`` is made, as the source tells it; None where there is none."""
    found = administer(network, source, Bottle([Vocab("list"), Vocab("out"), target.name]))
    return found if found.check("carrier") else None


def connect(network: Network, source: Contact, target: Contact, carrier: str = "") -> str:
    """Have ``source`` send to ``target``; returns what it says of it. Raises ConnectError.

    The carrier is that of the target as it is written, else of the source, else ``carrier``, else tcp.
    """
    chosen = target.carrier or source.carrier or carrier or "tcp"
    wanted = f"{chosen}:/{target if target.valid else target.name}"
    reply = administer(network, source, Bottle([Vocab("add"), wanted]))
    return _judged(reply)


def disconnect(network: Network, source: Contact, target: Contact) -> str:
    """Have ``source`` send to ``target`` no more; likewise."""
    return _judged(administer(network, source, Bottle([Vocab("del"), target.name])))


def connection_qos(network: Network, source: Contact, target: Contact) -> tuple[Qos, Qos]:
    """What both ends of a connection run with: the source's, and the target's. Raises ConnectError."""
    return _read_qos(network, source, target), _read_qos(network, target, source)


def set_connection_qos(
    network: Network, source: Contact, target: Contact, wanted: Qos, of_target: Qos | None = None
) -> None:
    """Set it at both ends; ``of_target`` is what the target shall have if that is something else.

    An end of which nothing is wanted is not asked. Raises ConnectError for an end that refuses: the one that was asked
    before it keeps what it has.
    """
    for asked, other, one in ((source, target, wanted), (target, source, wanted if of_target is None else of_target)):
        if one == Qos():
            continue
        reply = administer(network, asked, Bottle([Vocab("prop"), Vocab("set"), other.name, *one.to_settings()]))
        if as_string(reply.get(0)) != "ok" and reply.get(0) != Vocab("ok"):
            raise ConnectError(
                f"{asked.name} did not set {one} for its connection with {other.name}: "
                f"{as_string(reply.get(1)) or 'it may lack the right, or the connection a thread of its own'}"
            )


def _read_qos(network: Network, asked: Contact, other: Contact) -> Qos:
    reply = administer(network, asked, Bottle([Vocab("prop"), Vocab("get"), other.name]))
    if not reply.check("qos"):
        raise ConnectError(f"{asked.name}: {as_string(reply.get(1)) or 'it did not say'}")
    return Qos.from_property(Property.from_bottle(reply))


def _judged(reply: Bottle) -> str:
    text = as_string(reply.get(1)).strip()
    if as_int(reply.get(0)) != 0 or len(reply) == 0:
        raise ConnectError(text or "the port did not say what came of it")
    return text
