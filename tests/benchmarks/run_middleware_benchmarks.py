"""Run the benchmarks of the middleware: ``python tests/benchmarks/run_middleware_benchmarks.py``.

Two processes on one machine. Everything is timed in turn, a little of each, so that a machine that gets slower for a
while does so for all of them; a raw TCP echo between the same two processes is one of the rows, and the limit.
"""

from __future__ import annotations

import argparse
import os
import socket
import statistics
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import middleware_peer as peer
import numpy as np

from rtf import clock
from rtf.bottle import Bottle
from rtf.middleware.ports import remote
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.qos import Qos, QosError, set_thread_priority
from rtf.middleware.ports.rpc import RpcClient
from rtf.middleware.types import Image

if TYPE_CHECKING:
    from collections.abc import Callable

LARGE = 921_600


class Row(NamedTuple):
    """One thing that is timed. ``goal``: microseconds, or how many times the echo; ``turn``: calls before the next."""

    name: str
    call: Callable[[], object]
    turn: int
    goal: float = 0.0
    times_echo: bool = False
    settle: Callable[[], object] | None = None


def measure(rows: list[Row], turns: int) -> list[list[float]]:
    """Microseconds of each call, for each row in ascending order; the first turn is for nothing."""
    times: list[list[float]] = [[] for _ in rows]
    for turn in range(turns + 1):
        for row, taken in zip(rows, times, strict=True):
            call = row.call
            now = clock.monotonic
            for _ in range(row.turn):
                began = now()
                call()
                taken.append((now() - began) * 1e6)
            if row.settle is not None:
                row.settle()
            if turn == 0:
                taken.clear()
    for taken in times:
        taken.sort()
    return times


def table(rows: list[Row], times: list[list[float]]) -> str:
    """The results, a line a row; the first row is the echo."""
    echo, echo_late = statistics.median(times[0]), late(times[0])
    lines = [f"  {'':44}{'p50':>9}{'p99':>11}   p50 and p99 by the echo's"]
    for row, taken in zip(rows, times, strict=True):
        median, slow = statistics.median(taken), late(taken)
        goal = f"   ({row.goal:g}{' x' if row.times_echo else ' us'})" if row.goal else ""
        lines.append(
            f"  {row.name:44}{median:8.1f} us{slow:8.1f} us   {median / echo:5.2f} {slow / echo_late:5.2f}{goal}"
        )
    return "\n".join(lines)


def late(taken: list[float]) -> float:
    """What one call in a hundred exceeds."""
    return taken[int(len(taken) * 0.99)]


def caller(number: int) -> Callable[[], object]:
    """One round trip of 64 bytes to the echo."""
    connection = socket.create_connection(("127.0.0.1", number))
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    data = bytes(64)

    def call() -> None:
        connection.sendall(data)
        connection.recv(1 << 16)

    return call


def speed(turns: int) -> None:
    """What messages take, by kind and carrier."""
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="rtf-benchmark-"))
        os.environ["YARP_RUNTIME_DIR"] = folder
        places = stack.enter_context(peer.running())
        net = peer.network()
        question, small = Bottle.parse("[get] [axes]"), Bottle([bytes(48)])
        blob, image = Bottle([bytes(LARGE)]), Image(np.zeros((480, 640, 3), np.uint8))
        rpc = stack.enter_context(RpcClient("/here/rpc", peer.at(places, "rpc", "tcp"), network=net))

        def writer(name: str, carrier: str) -> Port:
            port = stack.enter_context(Port(f"/here/{name}/{carrier}", network=net))
            port.add_output(peer.at(places, name, carrier))
            return port

        here = stack.enter_context(Port("/here/taking", lambda delivery: delivery.read() and None, network=net))
        near = stack.enter_context(Port("/here/giving", network=net))
        near.add_output(here.contact, "local")
        tcp, fast, unix = (writer("bottle", carrier) for carrier in ("tcp", "fast_tcp", "unix_stream"))
        tcp_image, fast_image, unix_image = (writer("image", carrier) for carrier in ("tcp", "fast_tcp", "unix_stream"))
        rows = [
            Row("raw echo of 64 bytes", caller(places["echo"]), 200),
            Row("RPC of a small bottle", lambda: rpc.call(question), 200, 1.45, times_echo=True),
            Row("write of 64 bytes, tcp", lambda: tcp.write(small), 200, 1.45, times_echo=True),
            Row("write of 64 bytes, fast_tcp", lambda: fast.write(small), 200, 15, settle=lambda: tcp.write(small)),
            Row("blob of 921600 bytes, tcp", lambda: tcp.write(blob), 20, 350),
            Row("blob of 921600 bytes, fast_tcp", lambda: fast.write(blob), 20, 280),
            Row("blob of 921600 bytes, unix_stream", lambda: unix.write(blob), 20, 250),
            Row("blob of 921600 bytes, local", lambda: near.write(blob), 20, 20),
            Row("image of 921600 bytes, tcp", lambda: tcp_image.write(image), 20, 350),
            Row("image of 921600 bytes, fast_tcp", lambda: fast_image.write(image), 20, 280),
            Row("image of 921600 bytes, unix_stream", lambda: unix_image.write(image), 20, 250),
        ]
        print(table(rows, measure(rows, turns)), flush=True)


def readers(turns: int) -> None:
    """What a write takes to more and more readers, and whether all of them hear everything."""
    with ExitStack() as stack:
        places = stack.enter_context(peer.running())
        net = peer.network()
        counts = stack.enter_context(RpcClient("/here/counts", peer.at(places, "counts", "tcp"), network=net))
        small = Bottle([bytes(48)])
        expected = [0] * peer.READERS
        rows = [Row("raw echo of 64 bytes", caller(places["echo"]), 50)]
        for carrier in ("tcp", "fast_tcp"):
            for many in (1, 2, 5, 10, 20):
                port = stack.enter_context(Port(f"/here/{carrier}/{many}", network=net))
                for number in range(many):
                    port.add_output(peer.at(places, f"count{number}", carrier))
                    expected[number] += 50 * (turns + 1)
                rows.append(Row(f"write of 64 bytes to {many}, {carrier}", partial(port.write, small), 50))
        print(table(rows, measure(rows, turns)))
        deadline = clock.Deadline.after(10)
        while (heard := list(counts.call("how many") or ())) != expected and not deadline.expired:
            clock.sleep(0.01)
        missing = [sent - came for sent, came in zip(expected, heard, strict=True)]
        print(f"  messages that a reader did not hear: {max(missing)}", flush=True)


def crowd(ports: int, connections: int) -> None:
    """What many ports and connections take of memory, and of the processor while nothing happens."""
    with peer.running("crowd", str(ports), str(connections)) as facts:
        print(
            f"  {ports} ports and {connections} connections: {facts['kilobytes'] / 1000:.0f} MB (300), "
            f"{facts['threads']} threads, made and used in {facts['milliseconds']} ms, {facts['heard']} messages heard"
            f"\n  idle: {facts['idle']} us of the processor a second",
            flush=True,
        )


def priority(turns: int) -> None:
    """What it brings to give a connection's threads real-time priority, while others keep all processors busy."""
    urgent = Qos(tos=Qos.of_level("CRIT").tos, policy=os.SCHED_FIFO, priority=30)
    with ExitStack() as stack:
        places = stack.enter_context(peer.running())
        rpc = stack.enter_context(RpcClient("/here/rpc", peer.at(places, "rpc", "tcp"), network=peer.network()))
        rows = [Row("RPC of a small bottle", partial(rpc.call, Bottle.parse("[get] [axes]")), 50)]
        say(rows, turns, "nobody else works")
        for _ in range(2 * (os.cpu_count() or 1)):
            stack.callback(subprocess.Popen([sys.executable, "-c", _BUSY], stdin=subprocess.PIPE).communicate)
        say(rows, turns, f"{2 * (os.cpu_count() or 1)} processes are busy")
        sched, packets = f"((policy {urgent.policy}) (priority {urgent.priority}))", f"((tos {urgent.tos}))"
        settings = Bottle.parse(f"[prop] set /here/rpc (sched {sched}) (qos {packets})")
        before = os.sched_getscheduler(0), os.sched_getparam(0).sched_priority
        try:
            set_thread_priority(0, urgent.policy, urgent.priority)
        except QosError as error:
            print(f"  {error}")
            return
        try:
            answer = remote.administer(peer.network(), peer.at(places, "rpc", "tcp"), settings)
            rpc.outputs[0].apply(Qos(tos=urgent.tos))
            print(f"  the other end says to {settings}: {answer}")
            say(rows, turns, "the same, both ends with priority")
        finally:
            set_thread_priority(0, *before)


#: Works until its standard input ends.
_BUSY = """
import threading, sys, os
threading.Thread(target=lambda: (sys.stdin.read(), os._exit(0)), daemon=True).start()
while True:
    pass
"""


def say(rows: list[Row], turns: int, when: str) -> None:
    """Measure one row, and print it."""
    (taken,) = measure(rows, turns)
    print(
        f"  {rows[0].name}, {when:34}p50 {statistics.median(taken):7.1f} us   p99 {late(taken):8.1f} us   "
        f"most {taken[-1]:8.1f} us",
        flush=True,
    )


def main() -> None:
    """Print what was asked for."""
    parser = argparse.ArgumentParser(description="Benchmarks of the middleware; all of them take about a minute.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="speed, readers, crowd, priority (default: all)")
    parser.add_argument("--turns", type=int, default=50, help="how often each thing has its turn")
    parser.add_argument("--ports", type=int, default=500, help="ports of the crowd")
    parser.add_argument("--connections", type=int, default=1000, help="connections of the crowd")
    options = parser.parse_args()
    known: dict[str, Callable[[], None]] = {
        "speed": partial(speed, options.turns),
        "readers": partial(readers, options.turns),
        "crowd": partial(crowd, options.ports, options.connections),
        "priority": partial(priority, options.turns),
    }
    for name in options.names or known:
        print(f"{name}, load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors", flush=True)
        known[name]()


if __name__ == "__main__":
    main()
