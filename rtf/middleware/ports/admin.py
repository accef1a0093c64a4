"""The admin protocol: bottles by which tools connect, disconnect and query any port."""

from __future__ import annotations

import os
import platform
import sys
import threading
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Property, Vocab, as_string
from rtf.middleware.errors import ConnectError
from rtf.middleware.ports import describe, dialect_probe, monitoring, qos

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.bottle import Value

_OK, _FAIL = Vocab("ok"), Vocab("fail")
_CHANGING = frozenset({"add", "del", "set", "atch", "dtch"})
_COMMANDS = (
    ("[help]", "this list"),
    ("[ver]", "the version of this protocol"),
    ("[add] $port [$carrier]", "send output to a port"),
    ("[del] $port", "end the connection to or from a port"),
    ("[list] [in|out] [$port]", "the connections, or how one of them is made"),
    ("[set] [in|out] $port ($key $value)...", "change a connection's carrier"),
    ("[get] [in|out] $port", "how a connection's carrier is set"),
    ("[atch] [in|out] $properties", "have a script look at all messages: (type lua) (file name)"),
    ("[dtch] [in|out]", "end that"),
    (
        "[prop] [get] [$key]",
        "properties of the port; with its own name: process and threads; with another: the connection",
    ),
    ("[prop] [set] $key $value", "set a property; with a port's name: priority and quality of service"),
)

#: The reply to a caller that may not change connections.
NOT_ALLOWED = Bottle([_FAIL, describe.NOT_ALLOWED])


def changes(request: Bottle) -> bool:
    """Return whether a request changes connections, their settings or priorities."""
    command = _word(request.get(0))
    if command == "prop":
        return _word(request.get(1)) == "set" and as_string(request.get(2)).startswith("/")
    return command in _CHANGING


def answer(port: describe.AdministeredPort, request: Bottle) -> Bottle:
    """Execute an admin request and return the reply. Runs in the thread of the input."""
    handler = _HANDLERS.get(_word(request.get(0)))
    if handler is None:
        return Bottle([_FAIL, "send [help] for list of valid commands"])
    return handler(port, request)


def _word(value: Value | None) -> str:
    """Return the command word: a vocab, or the first four characters of a string."""
    return value.text if isinstance(value, Vocab) else as_string(value)[:4]


def _help(_port: describe.AdministeredPort, _request: Bottle) -> Bottle:
    return Bottle([Vocab("many"), *(f"{command}  {text}" for command, text in _COMMANDS)])


def _version(_port: describe.AdministeredPort, _request: Bottle) -> Bottle:
    return Bottle([Vocab("ver"), 1, 2, 3])


def _add(port: describe.AdministeredPort, request: Bottle) -> Bottle:
    text = describe.add(port, as_string(request.get(1)), as_string(request.get(2)))
    return Bottle([0 if text.startswith("A") else -1, f"{text}\r\n"])


def _del(port: describe.AdministeredPort, request: Bottle) -> Bottle:
    name = as_string(request.get(1))
    removed = describe.remove_output(port, name)
    if removed.startswith("R"):
        return Bottle([0, f"{removed}\r\n"])
    other = describe.remove_input(port, name)
    if other.startswith("R"):
        return Bottle([0, f"Removed connection from {name} to {port.name}\r\n"])
    return Bottle([-1, f"{removed}\r\n{other}\r\n"])


def _list(port: describe.AdministeredPort, request: Bottle) -> Bottle:
    inward = _word(request.get(1)) == "in"
    connections: Sequence[qos.Connection] = port.inputs if inward else port.outputs
    name = as_string(request.get(2))
    if not name:
        return Bottle([connection.peer for connection in connections])
    for connection in connections:
        if connection.peer == name:
            ends = (connection.peer, port.name) if inward else (port.name, connection.peer)
            about = [["from", ends[0]], ["to", ends[1]], ["carrier", connection.carrier]]
            return Bottle([*about, ["connectionless", 1]] if connection.connectionless else about)
    return Bottle()


def _modify(port: describe.AdministeredPort, request: Bottle) -> Bottle:
    """Answer ``get`` and ``set``. Only inputs with a priority have settings; others accept any and report none."""
    inward = _word(request.get(1)) == "in"
    name = as_string(request.get(2))
    if not name:
        return Bottle([-1, "target port is not specified.\r\n"])
    if name == port.name:
        return _modify_port(port, request, "in" if inward else "out")
    known: Sequence[qos.Connection] = port.inputs if inward else port.outputs
    way = "from" if inward else "to"
    found = next((connection for connection in known if connection.peer == name), None)
    if found is None:
        # YARP writes "incoming" for both directions, and programs may look for that text.
        return Bottle([-1, f"Could not find an incoming connection {way} {name}\r\n"])
    if _word(request.get(0)) == "get":
        if found.monitor is not None:
            return Bottle([found.monitor.get()])
        return Bottle([Property() if found.priority is None else found.priority.describe()])
    if found.priority is not None:
        found.priority.change(request)
    if found.monitor is not None:
        found.monitor.set(request[3:])
    return Bottle([0, f"Configured connection {way} {name}\r\n"])


def _modify_port(port: describe.AdministeredPort, request: Bottle, way: str) -> Bottle:
    monitor = port.port_monitor(way)
    if monitor is None:
        return Bottle([_FAIL, f"No port modifier is attached to the {way}put"])
    if _word(request.get(0)) == "get":
        return Bottle([monitor.get()])
    monitor.set(request[3:])
    return Bottle([0, f"Configured port {port.name}\r\n"])


def _attach(port: describe.AdministeredPort, request: Bottle) -> Bottle:
    way = _word(request.get(1))
    if way not in ("in", "out"):
        return Bottle([_FAIL, "attach command must be followed by [out] or [in]"])
    try:
        port.attach_monitor(way, monitoring.of_request(request[2:]))
    except ConnectError as error:
        return Bottle([_FAIL, str(error)])
    return Bottle([_OK])


def _detach(port: describe.AdministeredPort, request: Bottle) -> Bottle:
    way = _word(request.get(1))
    if way not in ("in", "out"):
        return Bottle([_FAIL, "detach command must be followed by [out] or [in]"])
    return Bottle([_OK if port.attach_monitor(way, None) else _FAIL])


def _property(port: describe.AdministeredPort, request: Bottle) -> Bottle:
    action = _word(request.get(1))
    key = as_string(request.get(2))
    if action == "get":
        return _get_property(port, key)
    if action == "set":
        return _set_property(port, key, request)
    return Bottle([_FAIL, "property action not known"])


def _get_property(port: describe.AdministeredPort, key: str) -> Bottle:
    if key == port.name:
        return _about(port)
    if key.startswith("/"):
        connections = _connections(port, key)
        if not connections:
            return Bottle([_FAIL, f"cannot find any connection to/from {key}"])
        return Bottle([group for connection in connections for group in connection.describe()])
    if not key:
        return Bottle([group for group in port.properties.to_bottle() if isinstance(group, Bottle)])
    group = port.properties.find_group(key)
    return Bottle() if group is None else group.tail()


def _set_property(port: describe.AdministeredPort, key: str, request: Bottle) -> Bottle:
    """Store the property; if the key is the name of a port, also apply the request to its connections."""
    value = request.get(3)
    if key == dialect_probe.KEY:
        return Bottle([_OK, dialect_probe.BOTH])  # readers of this library understand either
    port.properties.put(key, *([] if value is None else [value]))
    if not key.startswith("/"):
        return Bottle([_OK])
    settings = Property.from_bottle(Bottle([item for item in request if isinstance(item, Bottle)]))
    if key in (port.name, "/"):
        return Bottle([_OK if qos.set_process(settings, port.network.report) else _FAIL])
    if not settings.check("sched") and not settings.check("qos"):
        return Bottle([_OK])
    connections = _connections(port, key)
    done = [connection.configure(settings, port.network.report) for connection in connections]
    return Bottle([_OK if done and all(done) else _FAIL])


def _connections(port: describe.AdministeredPort, name: str) -> list[qos.Connection]:
    """Return the connections with a port, in both directions: two ports may send to each other."""
    everything: list[qos.Connection] = [*port.outputs, *port.inputs]
    return [connection for connection in everything if connection.peer == name]


def _about(port: describe.AdministeredPort) -> Bottle:
    thread = qos.thread_facts(threading.get_native_id())
    process = {
        "arguments": " ".join(sys.argv[1:]),
        "name": sys.argv[0] if sys.argv else "",
        "pid": os.getpid(),
        **{key: value for key, value in qos.thread_facts(os.getpid()).items() if key != "tid"},
    }
    flags = {
        "is_input": int(port.allows_inputs),
        "is_output": int(port.allows_outputs),
        "is_rpc": int(port.rpc),
        "type": port.promise,
    }
    return Bottle(
        [
            ["sched", Property(thread)],
            ["process", Property(process)],
            ["platform", Property({"hostname": port.contact.host, "os": platform.system()})],
            ["port", Property(flags)],
        ]
    )


_HANDLERS: dict[str, Callable[[describe.AdministeredPort, Bottle], Bottle]] = {
    "help": _help,
    "ver": _version,
    "add": _add,
    "del": _del,
    "list": _list,
    "set": _modify,
    "get": _modify,
    "atch": _attach,
    "dtch": _detach,
    "prop": _property,
}
