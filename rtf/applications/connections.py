"""The connections of an application: made, watched and ended, and the conditions of their ports."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, BottleError, Vocab, to_string
from rtf.middleware.carriers import registry
from rtf.middleware.errors import ConnectError, MiddlewareError
from rtf.middleware.ports import remote
from rtf.middleware.ports.qos import Qos, QosError
from rtf.middleware.ports.rpc import RpcClient
from rtf.middleware.wire.contact import Contact
from rtf.middleware.wire.name_server_lines import command

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.applications.xml.model import Connection, PortDependency
    from rtf.middleware.ports.network import Network

#: Seconds that a port may take to answer a request that it has to answer.
_ANSWER = 5.0
_LARGEST = 255


def read_qos(text: str) -> Qos:
    """Read ``level:high;priority:30;policy:1``, with ``dscp:`` or ``tos:`` instead of a level. Raises QosError."""
    tos: int | None = None
    numbers: dict[str, int] = {}
    for part in filter(None, (one.strip() for one in text.split(";"))):
        key, _, value = (word.strip() for word in part.partition(":"))
        match key.lower():
            case "level":
                tos = Qos.of_level(value).tos
            case "dscp":
                tos = Qos.of_dscp(value).tos
            case "tos" | "priority" | "policy" if value.isascii() and value.isdigit() and int(value[:4]) <= _LARGEST:
                numbers[key.lower()] = int(value)
            case _:
                raise QosError(f"{part!r} is no quality of service; write level:, dscp:, tos:, priority: or policy:")
    return Qos(numbers.get("tos", tos), numbers.get("policy"), numbers.get("priority"))


class Link(StrEnum):
    """The state of a connection."""

    CONNECTED = "connected"
    APART = "apart"
    NO_PORT = "no port"
    UNKNOWN = "unknown"


def states(network: Network, wanted: Sequence[Connection]) -> list[Link]:
    """Return the states of connections. Each port is asked once for all of its connections."""
    try:
        known = {one.name: one for one in network.names.list()}
    except MiddlewareError:
        return [Link.UNKNOWN] * len(wanted)
    asked: dict[tuple[str, str], set[str] | None] = {}

    def peers(port: str, direction: str) -> set[str] | None:
        if (port, direction) not in asked:
            try:
                reply = remote.administer(network, known[port], Bottle([Vocab("list"), Vocab(direction)]))
                asked[port, direction] = {*map(to_string, reply)}
            except MiddlewareError:
                asked[port, direction] = None
        return asked[port, direction]

    found: list[Link] = []
    for one in wanted:
        source, target = str(one.source.port), str(one.target.port)
        if source not in known or target not in known:
            found.append(Link.NO_PORT)
            continue
        # A carrier such as mjpeg is opened by the port that receives, which alone knows the other one by its name.
        pulled = registry.pulls(one.carrier)
        names = peers(target, "in") if pulled else peers(source, "out")
        exists = names is not None and (source if pulled else target) in names
        found.append(Link.UNKNOWN if names is None else Link.CONNECTED if exists else Link.APART)
    return found


def connect(network: Network, connection: Connection) -> None:
    """Make a connection, if it does not exist, and have the name server keep one that persists.

    The name server is asked last: it would make the connection at the same time. Raises MiddlewareError.
    """
    source, target = Contact(connection.source.port), Contact(connection.target.port)
    if states(network, [connection]) != [Link.CONNECTED]:
        remote.connect(network, source, target, connection.carrier)
    qos = read_qos(connection.source.qos), read_qos(connection.target.qos)
    if qos != (Qos(), Qos()):
        remote.set_connection_qos(network, source, target, *qos)
    if connection.persist:
        answer = network.names.command(command("subscribe", source.name, str(target.by(connection.carrier))))
        if not answer or answer[0] != "[ok]":
            raise ConnectError(f"the name server does not keep {connection}: {' '.join(answer)}")


def disconnect(network: Network, connection: Connection) -> bool:
    """End a connection. False if there is none. Raises MiddlewareError."""
    if connection.persist:
        network.names.command(command("unsubscribe", connection.source.port, connection.target.port))
    if states(network, [connection])[0] in (Link.APART, Link.NO_PORT):
        return False
    remote.disconnect(network, Contact(connection.source.port), Contact(connection.target.port))
    return True


def missing(network: Network, dependency: PortDependency) -> str:
    """Return what a port still lacks; empty when the dependency is fulfilled."""
    if not remote.exists(network, Contact(dependency.port)):
        return f"{dependency.port} is not open"
    if not dependency.request:
        return ""
    try:
        with RpcClient("", dependency.port, network=network) as client:
            reply = client.call(Bottle.parse(dependency.request), timeout=_ANSWER)
    except MiddlewareError as error:
        return f"{dependency.port} does not answer {dependency.request}: {error}"
    if dependency.reply and not answers(reply, dependency.reply):
        got = reply.to_text()[:100] if reply is not None else "nothing"
        return f"{dependency.port} answers {dependency.request} with {got}, not {dependency.reply}"
    return ""


def answers(reply: Bottle | None, wanted: str) -> bool:
    """Return whether a reply says what is wanted, whatever its vocabs and strings are."""
    try:
        asked = Bottle.parse(wanted)
    except BottleError:
        return False
    return reply is not None and [*map(to_string, reply)] == [*map(to_string, asked)]
