"""What a node of programs costs: ``python tests/benchmarks/run_applications_benchmarks.py``.

Printed are the time of a start with its request and reply, and what 500 of them in a row leave in the node and in the
machine; the processor time of a node that watches 100 programs; and that of one whose program floods its output.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import psutil

from rtf import clock
from rtf.applications.run.client import RunClient
from rtf.applications.run.protocol import Start
from rtf.middleware.naming.configuration import find_network

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rtf.middleware.ports.network import Network

#: The most of a core that watching may cost, and the memory in MiB that 500 starts may leave.
CORE, MEMORY = 0.02, 8.0
_SETTLED = 20.0
_FLOOD = r"while true; do head -c 10000000 /dev/zero | tr '\0' '\n'; sleep 0.1; done"


@dataclass
class Node:
    """A node in a process of its own, with a name server beside it."""

    process: psutil.Process
    network: Network
    client: RunClient

    def cpu(self) -> float:
        """Processor time of the node, s."""
        times = self.process.cpu_times()
        return times.user + times.system

    def leavings(self) -> dict[str, int]:
        """What a start could leave."""
        return {
            "threads": self.process.num_threads(),
            "descriptors": self.process.num_fds(),
            "processes": len(self.process.children(recursive=True)),
            "names": len(self.network.names.list()),
        }

    def memory(self) -> float:
        """Memory of the node, MiB."""
        return self.process.memory_info().rss / (1 << 20)


@contextmanager
def node() -> Iterator[Node]:
    """Start a name server and a node, and end both."""
    with TemporaryDirectory() as folder:
        environment = {**os.environ, "YARP_CONFIG_HOME": folder, "XDG_STATE_HOME": folder}
        words = [sys.executable, "-m", "rtf"]
        names = _started([*words, "nameserver", "--socket", "0", "--write", "--no-discovery"], environment)
        keeper = _started([*words, "run", "--server", "/node"], environment)
        try:
            network = find_network(environment)
            (server,) = psutil.Process(keeper.pid).children()
            yield Node(server, network, RunClient("/node", network=network))
        finally:
            for process in (keeper, names):
                process.send_signal(signal.SIGTERM)
                process.communicate()


def _started(words: list[str], environment: dict[str, str]) -> subprocess.Popen[str]:
    """A process that has said that it is available; what it says later is not kept."""
    log = Path(environment["YARP_CONFIG_HOME"], f"{words[3]}.log")
    with log.open("w") as stream:
        process = subprocess.Popen(words, env=environment, stdout=stream, text=True)
    _until(lambda: "is available" in log.read_text(), f"{words[3]} did not start", 30.0)
    return process


def _until(condition: Callable[[], object], complaint: str, limit: float) -> None:
    deadline = clock.Deadline.after(limit)
    while not condition():
        if deadline.expired:
            sys.exit(complaint)
        clock.sleep(0.01)


def _end_all(one: Node) -> None:
    one.client.terminate_all()
    _until(lambda: not one.client.running(), "a program still runs", _SETTLED)


def starts(one: Node, count: int) -> tuple[float, float, dict[str, int]]:
    """Start programs one after the other. Seconds a start, MiB that the node gained, and what was left."""
    for number in range(10):  # what is loaded at the first start is no cost of the others
        one.client.start(Start(f"first{number}", "true"))
    _end_all(one)
    before, memory = one.leavings(), one.memory()
    began = clock.monotonic()
    for number in range(count):
        assert one.client.start(Start(f"t{number}", "true")).pid > 0
    each = (clock.monotonic() - began) / count
    _end_all(one)
    deadline = clock.Deadline.after(_SETTLED)
    # Less than before is nothing left: what the first programs had may end late.
    while any(after > before[key] for key, after in one.leavings().items()) and not deadline.expired:
        clock.sleep(0.01)
    after = one.leavings()
    return each, one.memory() - memory, {key: max(after[key] - before[key], 0) for key in before}


def watching(one: Node, programs: int, seconds: float) -> float:
    """The part of a core that a node takes that watches programs of which each prints a line a second."""
    for number in range(programs):
        one.client.start(Start(f"t{number}", 'sh -c "while sleep 1; do echo alive; done"'))
    clock.sleep(min(seconds, 1.0))
    began, spent = clock.monotonic(), one.cpu()
    clock.sleep(seconds)
    core = (one.cpu() - spent) / (clock.monotonic() - began)
    _end_all(one)
    return core


def flood(one: Node, seconds: float) -> tuple[float, float, float]:
    """A program that prints 100 MB a second. Core of the node, MiB gained, and seconds of the slowest answer."""
    before = one.memory()
    one.client.start(Start("flood", f'sh -c "{_FLOOD}"'))
    began, spent, slowest = clock.monotonic(), one.cpu(), 0.0
    while clock.monotonic() - began < seconds:
        asked = clock.monotonic()
        assert one.client.is_running("flood")
        slowest = max(slowest, clock.monotonic() - asked)
        clock.sleep(0.1)
    core, gained = (one.cpu() - spent) / (clock.monotonic() - began), one.memory() - before
    _end_all(one)
    return core, gained, slowest


def main() -> None:
    """Print the outcomes; exit with 1 if one is above its bound."""
    parser = argparse.ArgumentParser(description="What a node of programs costs.")
    parser.add_argument("--starts", type=int, default=500)
    parser.add_argument("--programs", type=int, default=100)
    parser.add_argument("--seconds", type=float, default=10.0)
    options = parser.parse_args()
    with node() as one:
        each, gained, left = starts(one, options.starts)
        core = watching(one, options.programs, options.seconds)
        busy, memory, slowest = flood(one, options.seconds)
    print(f"{options.starts} starts: {each * 1e3:.1f} ms each, {gained:.1f} MiB gained (bound {MEMORY:g}), left {left}")
    print(f"{options.programs} programs watched: {core:.2%} of a core (bound {CORE:.0%})")
    print(f"a flood of 100 MB/s: {busy:.0%} of a core, {memory:.1f} MiB gained, slowest answer {slowest * 1e3:.0f} ms")
    sys.exit(core > CORE or gained > MEMORY or any(left.values()))


if __name__ == "__main__":
    main()
