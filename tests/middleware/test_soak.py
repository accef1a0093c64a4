"""Streams between processes for a while: rates are kept, and nothing grows.

Three seconds show a leak in each message or connection; ``RTF_SOAK=3600`` makes it an hour.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from typing import TYPE_CHECKING, Any, NamedTuple

import pytest

from rtf.middleware.naming.server import NameServer
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.middleware.wire.contact import Contact

SECONDS = float(os.environ.get("RTF_SOAK", "3"))
#: The memory in bytes that a process may have gained between its first half second and its end.
_GROWTH = 3 << 20
_RATE_TOLERANCE = 0.05
#: Seconds for which a busy machine may keep the first or the last message.
_BUSY = 2.0
_COMMON = """
import json, os, sys, threading
from pathlib import Path
from rtf import clock
from rtf.bottle import Bottle
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.wire.contact import Contact
from rtf.middleware.naming.client import RemoteNames
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port

said = []
names = RemoteNames(Contact("/root", "127.0.0.1", int(sys.argv[1]), "tcp"))
network = Network(names, report=said.append)

def held():
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    memory = pages * os.sysconf("SC_PAGESIZE")
    return {"memory": memory, "threads": threading.active_count(), "files": len([*Path("/proc/self/fd").iterdir()])}
"""
_READER = (
    _COMMON
    + """
class Seen:
    def __init__(self):
        self.count = self.bytes = self.damaged = 0
        self.last, self.first_at, self.last_at = -1, 0.0, 0.0

    def __call__(self, received):
        number, data = received.value
        self.last_at = clock.monotonic()
        self.first_at = self.first_at or self.last_at
        self.count += 1
        self.bytes += len(data)
        self.damaged += number <= self.last or data != bytes([number % 256]) * len(data)
        self.last = number

streams = {name: Seen() for name in sys.argv[2:]}
ports = [BufferedPort(name, strict=True, callback=seen, network=network) for name, seen in streams.items()]
for line in sys.stdin:
    answer = {name: vars(seen) for name, seen in streams.items()} if line == "streams\\n" else held()
    print(json.dumps(answer), flush=True)
for port in ports:
    port.close()
names.close()
print(json.dumps(said), flush=True)
"""
)
_WRITER = (
    _COMMON
    + """
target, carrier, rate, size, seconds = sys.argv[2], sys.argv[3], *map(float, sys.argv[4:])
with Port("/writer" + target, network=network) as port:
    port.add_output(target, carrier)
    print("ready", flush=True)
    sys.stdin.readline()
    began, early, late = clock.monotonic(), None, 0.0
    for number in range(round(rate * seconds)):
        due = began + number / rate
        clock.sleep(due - clock.monotonic())
        port.write(Bottle([number, bytes([number % 256]) * int(size)]))
        if early is None and clock.monotonic() - began > 0.5:
            early = held()
    done, after = clock.monotonic() - began, held()
names.close()
print(json.dumps({"early": early, "after": after, "seconds": done, "said": said}), flush=True)
"""
)


class Flow(NamedTuple):
    """A stream: its carrier, messages a second and bytes of each."""

    carrier: str
    rate: float
    size: int

    @property
    def target(self) -> str:
        """The name of the receiving port."""
        return f"/reader/{self.carrier}/{self.size}"


FLOWS = [
    Flow("tcp", 100, 200),
    Flow("tcp", 20, 200_000),
    Flow("fast_tcp", 200, 2_000),
    Flow("fast_tcp", 30, 300_000),
    Flow("udp", 100, 1_000),
    Flow("udp", 20, 30_000),
]


@pytest.fixture
def server() -> Iterator[NameServer]:
    """The name server, in this process."""
    with NameServer() as running:
        yield running


def _start(text: str, server: Contact, *words: object) -> subprocess.Popen[str]:
    arguments = [sys.executable, "-c", text, str(server.port), *map(str, words)]
    return subprocess.Popen(arguments, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def _ask(process: subprocess.Popen[str], question: str) -> Any:
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(f"{question}\n")
    process.stdin.flush()
    return json.loads(process.stdout.readline())


def _flow(streams: dict[str, dict[str, int]]) -> bool:
    return all(streams[flow.target]["count"] >= flow.rate / 2 for flow in FLOWS)


def _has_not_grown(before: dict[str, int], after: dict[str, int], who: str) -> None:
    assert after["threads"] <= before["threads"], who
    assert after["files"] <= before["files"], who
    assert after["memory"] - before["memory"] < _GROWTH, who


def _all_there(streams: dict[str, Any]) -> bool:
    """Whether all messages have come that cannot be lost on the way; writers have ended before their last is read."""
    return all(streams[one.target]["count"] == round(one.rate * SECONDS) for one in FLOWS if one.carrier != "udp")


@pytest.mark.timeout(SECONDS + 60)
def test_rates_are_kept_and_nothing_grows(server: NameServer):
    """Streams of several processes to one keep their rates, without more memory, threads or descriptors."""
    reader = _start(_READER, server.contact, *(flow.target for flow in FLOWS))
    processes = [reader]
    try:
        _ask(reader, "held")  # its ports are open
        writers = [_start(_WRITER, server.contact, flow.target, *flow, SECONDS) for flow in FLOWS]
        processes += writers
        for writer in writers:
            assert writer.stdout is not None
            assert writer.stdout.readline() == "ready\n"
        for writer in writers:
            assert writer.stdin is not None
            writer.stdin.write("go\n")
            writer.stdin.flush()
        eventually(lambda: _flow(_ask(reader, "streams")), "not all streams flow")
        early = _ask(reader, "held")
        reports = [json.loads(writer.communicate(timeout=SECONDS + 40)[0]) for writer in writers]
        eventually(
            lambda: _ask(reader, "held")["threads"] < early["threads"], "inputs of writers that are gone are left"
        )
        eventually(lambda: _all_there(_ask(reader, "streams")), "messages are missing")
        streams, after = _ask(reader, "streams"), _ask(reader, "held")
        problems = json.loads(reader.communicate(timeout=20)[0])
    finally:
        for process in processes:
            process.kill()
            process.communicate()
    assert [process.returncode for process in processes] == [0] * len(processes)
    assert problems == []
    _has_not_grown(early, after, "the reader")
    for flow, report in zip(FLOWS, reports, strict=True):
        seen = streams[flow.target]
        sent = round(flow.rate * SECONDS)
        assert seen["damaged"] == 0, flow
        assert seen["count"] == sent if flow.carrier != "udp" else 0.9 * sent <= seen["count"] <= sent, flow
        assert seen["bytes"] == seen["count"] * flow.size, flow
        took, due = seen["last_at"] - seen["first_at"], seen["last"] / flow.rate
        assert abs(took - due) <= _RATE_TOLERANCE * due + _BUSY, flow
        assert report["said"] == []
        _has_not_grown(report["early"], report["after"], flow.target)
    assert [contact.name for contact in server.names.list() if contact.name.startswith(("/reader", "/writer"))] == []
