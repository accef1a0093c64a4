"""The connections of an application: made, watched and ended, and the conditions of their ports."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import Bottle, BottleError, to_string
from rtf.middleware.errors import ConnectError, MiddlewareError
from rtf.middleware.ports import remote
from rtf.middleware.ports.qos import Qos, QosError
from rtf.middleware.ports.rpc import RpcClient
from rtf.middleware.wire.contact import Contact
from rtf.middleware.wire.name_server_lines import command

if TYPE_CHECKING:
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


def are_there(network: Network, connection: Connection) -> bool:
    """Return whether both ports of a connection are registered. Raises MiddlewareError."""
    return all(network.names.query(end.port) is not None for end in (connection.source, connection.target))


def is_connected(network: Network, connection: Connection) -> bool:
    """Return whether a connection exists. Raises MiddlewareError if its ports cannot be asked."""
    source = network.names.query(connection.source.port)
    return source is not None and remote.connection(network, source, Contact(connection.target.port)) is not None


def connect(network: Network, connection: Connection) -> None:
    """Make a connection, if it does not exist, and have the name server keep one that persists.

    Raises MiddlewareError.
    """
    source, target = Contact(connection.source.port), Contact(connection.target.port)
    if connection.persist:
        answer = network.names.command(command("subscribe", source.name, str(target.by(connection.carrier))))
        if not answer or answer[0] != "[ok]":
            raise ConnectError(f"the name server does not keep {connection}: {' '.join(answer)}")
    if not is_connected(network, connection):
        remote.connect(network, source, target, connection.carrier)
    qos = read_qos(connection.source.qos), read_qos(connection.target.qos)
    if qos != (Qos(), Qos()):
        remote.set_connection_qos(network, source, target, *qos)


def disconnect(network: Network, connection: Connection) -> bool:
    """End a connection. False if there is none. Raises MiddlewareError."""
    if connection.persist:
        network.names.command(command("unsubscribe", connection.source.port, connection.target.port))
    if not is_connected(network, connection):
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
