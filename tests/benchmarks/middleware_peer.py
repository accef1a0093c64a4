"""The other end of the benchmarks of the middleware: a process of its own with a raw echo and the ports that are tried.

It says where they are in one line of JSON, and ends when its standard input does. Nothing here is measured but what it
takes to be heard by it. ``echo`` is the limit: a loop of two system calls, as little as Python can do over TCP.
"""

from __future__ import annotations

import json
import os
import resource
import socket
import subprocess
import sys
import threading
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rtf import clock
from rtf.bottle import Bottle
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcServer
from rtf.middleware.types import IMAGE
from rtf.middleware.wire.contact import Contact

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.middleware.wire.incoming_message import IncomingMessage

_ROOM = 1 << 16
#: Seconds in which nothing happens, and nothing should be used.
_IDLE = 2.0
READERS = 20


def network() -> Network:
    """A network of this process; ports of the other one are known by their addresses."""
    return Network(LocalNames())


class Echo:
    """Sends back what comes. One caller."""

    def __init__(self) -> None:
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.number: int = self._listening.getsockname()[1]
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self) -> None:
        connection, _ = self._listening.accept()
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        while data := connection.recv(_ROOM):
            connection.sendall(data)


class Counting(Port):
    """Reads every bottle, and counts them, or only those that are like ``expected``.

    A program that is not ours may hold the address of a port that is gone, where a port of ours is now.
    """

    def __init__(self, name: str, network: Network, expected: Bottle | None = None) -> None:
        self.count = 0
        self._expected = expected
        super().__init__(name, self._take, network=network)

    def _take(self, delivery: IncomingMessage) -> None:
        if delivery.read() == self._expected or self._expected is None:
            self.count += 1


def serve() -> None:
    """Open everything, and wait for the end."""
    net = network()
    counting = [Counting(f"/peer/count{number}", net) for number in range(READERS)]
    ports = {
        "rpc": RpcServer("/peer/rpc", lambda question: question, network=net),
        "bottle": Port("/peer/bottle", lambda delivery: delivery.read() and None, network=net),
        "image": Port("/peer/image", lambda delivery: delivery.read(IMAGE) and None, network=net),
        "counts": RpcServer("/peer/counts", lambda _: Bottle([port.count for port in counting]), network=net),
        **{f"count{number}": port for number, port in enumerate(counting)},
    }
    places = {name: port.contact.port for name, port in ports.items()}
    print(json.dumps({"echo": Echo().number, **places}), flush=True)
    sys.stdin.read()
    for port in ports.values():
        port.close()


@contextmanager
def running(*arguments: str) -> Iterator[dict[str, int]]:
    """Run this beside us, with our modules; gives what it said in its first line."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    command = [sys.executable, __file__, *arguments]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            yield {**json.loads(process.stdout.readline()), "process": process.pid}
        finally:
            process.stdin.close()


def at(places: dict[str, int], name: str, carrier: str) -> Contact:
    """One of the ports of the peer."""
    return Contact(f"/peer/{name}", "127.0.0.1", places[name], carrier)


def crowd(ports: int, connections: int) -> None:
    """Open many ports, connect them, use each connection once, then do nothing; says what that took."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, min(hard, 4 * (ports + connections))), hard))
    net = network()
    began = clock.monotonic()
    message = Bottle([os.getpid(), 2, 3])
    crowd = [Counting(f"/crowd/{number}", net, message) for number in range(ports)]
    for number in range(connections):
        step = 1 + number // ports
        crowd[number % ports].add_output(crowd[(number + step) % ports].contact, "tcp")
    for port in crowd:
        port.write(message)
    took = clock.monotonic() - began
    used = cpu()
    clock.sleep(_IDLE)
    facts = {
        "heard": sum(port.count for port in crowd),
        "milliseconds": int(took * 1e3),
        "kilobytes": int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * resource.getpagesize()
        >> 10,
        "threads": threading.active_count(),
        "idle": int((cpu() - used) / _IDLE * 1e6),
    }
    print(json.dumps(facts), flush=True)
    sys.stdin.read()
    os._exit(0)  # closing them politely, one by one, is nothing that is measured here


def cpu() -> float:
    """Seconds of the processor that this process had."""
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


if __name__ == "__main__":
    if sys.argv[1:2] == ["crowd"]:
        crowd(*map(int, sys.argv[2:]))
    else:
        serve()
