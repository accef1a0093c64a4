"""A network of two hosts with a cable: network namespaces of the kernel, a switch, and a program on each host.

The tests need root and iproute2, and are skipped without them.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from typing import TYPE_CHECKING, Any

import pytest

from rtf import clock

if TYPE_CHECKING:
    from collections.abc import Iterator

_NEAR, _FAR = "192.0.2.1", "192.0.2.2"
_SERVER = f"""
import sys
from rtf.middleware.naming.server import NameServer
with NameServer("{_NEAR}", 10000):
    print("ready", flush=True)
    sys.stdin.read()
"""
#: A program that executes commands, one per line, and answers in JSON.
_PROGRAM = f"""
import json, sys, threading
from rtf import clock
from rtf.bottle import Bottle
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.wire.contact import Contact
from rtf.middleware.naming.client import RemoteNames
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcClient, RpcServer

names = RemoteNames(Contact("/root", "{_NEAR}", 10000, "tcp"), patience=3.0)
network = Network(names, patience=1.0)
ports, got = {{}}, {{}}

def reader(name):
    got[name] = []
    def take(received):
        number, data = received.value
        got[name].append(number if data == bytes([number % 256]) * len(data) else "damaged")
    ports[name] = BufferedPort(name, strict=True, callback=take, network=network)
    return str(ports[name].contact)

def writer(name, kind=Port):
    ports[name] = kind(name, network=network)

def server(name):
    ports[name] = RpcServer(name, lambda question: question, network=network)

def client(name):
    ports[name] = RpcClient(name, network=network)

def add(name, target, carrier="tcp"):
    return str(ports[name].add_output(target, carrier))

def write(name, first, count, size, pause=0.0):
    done = 0
    for number in range(first, first + count):
        done += ports[name].write(Bottle([number, bytes([number % 256]) * size]))
        clock.sleep(pause)
    return done

def in_background(name, *arguments):
    threading.Thread(target=write, args=(name, *arguments), daemon=True).start()

def call(name, question, timeout):
    return ports[name].call(Bottle([question]), timeout=timeout).to_text()

def took(work, *arguments):
    began = clock.monotonic()
    try:
        answer = work(*arguments)
    except Exception as error:
        answer = type(error).__name__
    return answer, clock.monotonic() - began

def close(name):
    ports.pop(name).close()

for line in sys.stdin:
    try:
        answer = eval(line)
    except Exception as error:
        answer = f"{{type(error).__name__}}: {{error}}"
    print(json.dumps(answer), flush=True)
for port in ports.values():
    port.close()
names.close()
"""


def ip(*words: str) -> None:
    """Run the command ``ip``."""
    subprocess.run(["ip", *words], check=True, capture_output=True, text=True, timeout=20)


class Program:
    """A program on one of the hosts."""

    def __init__(self, space: str, text: str) -> None:
        self._process = subprocess.Popen(
            ["ip", "netns", "exec", space, sys.executable, "-c", text],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def line(self) -> str:
        """Return the next line of its output."""
        assert self._process.stdout is not None
        return self._process.stdout.readline()

    def __call__(self, work: str) -> Any:
        """Evaluate an expression in the program, and return its value."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{work}\n")
        self._process.stdin.flush()
        return json.loads(self.line())

    def end(self) -> None:
        """Let the program end by itself."""
        try:
            self._process.communicate(timeout=10)
        finally:
            self._process.kill()
            self._process.communicate()
        assert self._process.returncode == 0


class Hosts:
    """Two hosts at a switch, with the name server on the near one."""

    def __init__(self) -> None:
        self._spaces = {which: f"rtf{os.getpid()}{which}" for which in ("near", "far", "switch")}
        self._programs: list[Program] = []

    def build(self) -> None:
        """Create hosts, switch and cables; raises CalledProcessError without permission."""
        for space in self._spaces.values():
            ip("netns", "add", space)
        switch = self._spaces["switch"]
        ip("-n", switch, "link", "add", "bridge", "type", "bridge")
        ip("-n", switch, "link", "set", "bridge", "up")
        for which, address in (("near", _NEAR), ("far", _FAR)):
            space = self._spaces[which]
            ip("-n", space, "link", "add", "cable", "type", "veth", "peer", "name", which, "netns", switch)
            ip("-n", switch, "link", "set", which, "master", "bridge", "up")
            ip("-n", space, "address", "add", f"{address}/24", "dev", "cable")
            ip("-n", space, "link", "set", "lo", "up")
            ip("-n", space, "link", "set", "cable", "up")
            ip("-n", space, "route", "add", "224.0.0.0/4", "dev", "cable")

    def start(self) -> None:
        """Start the name server, and a program on each host."""
        self.server = self._run("near", _SERVER)
        assert self.server.line() == "ready\n"
        self.near, self.far = (self._run(which, _PROGRAM) for which in ("near", "far"))

    def _run(self, which: str, text: str) -> Program:
        program = Program(self._spaces[which], text)
        self._programs.append(program)
        return program

    def cut(self) -> None:
        """Disconnect the far host's cable from the switch."""
        ip("-n", self._spaces["switch"], "link", "set", "far", "down")

    def plug_in(self) -> None:
        """Connect the cable again."""
        ip("-n", self._spaces["switch"], "link", "set", "far", "up")

    def narrow(self) -> None:
        """Limit the cable's rate and queue, so that packets beyond are lost."""
        shape = ["tbf", "rate", "50mbit", "burst", "4000", "limit", "30000"]
        words = ["tc", "-n", self._spaces["switch"], "qdisc", "replace", "dev", "far", "root", *shape]
        done = subprocess.run(words, capture_output=True, text=True, timeout=20, check=False)
        if done.returncode:
            pytest.skip(f"traffic cannot be shaped here: {done.stderr.strip()}")

    def widen(self) -> None:
        """Remove the limit."""
        words = ["tc", "-n", self._spaces["switch"], "qdisc", "del", "dev", "far", "root"]
        subprocess.run(words, capture_output=True, timeout=20, check=False)

    def close(self) -> None:
        """End the programs, and remove hosts and switch."""
        for program in reversed(self._programs):
            program.end()
        for space in self._spaces.values():
            subprocess.run(["ip", "netns", "del", space], capture_output=True, timeout=20, check=False)


@pytest.fixture(scope="module")
def network_of_two() -> Iterator[Hosts]:
    """The hosts of all tests in this file."""
    if os.geteuid() != 0 or shutil.which("ip") is None:
        pytest.skip("hosts of one's own take root and iproute2")
    made = Hosts()
    try:
        try:
            made.build()
        except subprocess.CalledProcessError as error:
            pytest.skip(f"networks of one's own are not permitted here: {error.stderr.strip()}")
        made.start()
        yield made
    finally:
        made.close()


@pytest.fixture
def hosts(network_of_two: Hosts) -> Iterator[Hosts]:
    """The hosts; afterwards the cable is restored, and all ports are closed."""
    yield network_of_two
    network_of_two.widen()
    network_of_two.plug_in()
    for program in (network_of_two.near, network_of_two.far):
        assert program("[close(name) for name in [*ports]]") is not None


def eventually(program: Program, condition: str, limit: float = 10.0) -> None:
    """Wait until an expression is true on a host."""
    deadline = clock.Deadline.after(limit)
    while not program(condition):
        assert not deadline.expired, f"{condition} does not hold: {program('{name: len(got[name]) for name in got}')}"
        clock.sleep(0.01)


@pytest.mark.parametrize("carrier", ["tcp", "fast_tcp", "text_ack", "udp", "mcast"])
def test_messages_from_host_to_host(hosts: Hosts, carrier: str):
    """Ports have the address of their host, and messages arrive in both directions."""
    for here, there, address in ((hosts.near, hosts.far, _FAR), (hosts.far, hosts.near, _NEAR)):
        assert there("reader('/reader')").startswith(f"tcp://{address}:")
        here("writer('/writer')")
        assert here(f"add('/writer', '/reader', '{carrier}')").startswith(f"{carrier}://{address}:")
        eventually(there, "ports['/reader'].inputs != ()")
        size = 100 if carrier == "text_ack" else 3000
        assert here(f"write('/writer', 0, 50, {size}, {0.002 if carrier in ('udp', 'mcast') else 0})") == 50
        eventually(there, "len(got['/reader']) == 50")
        assert there("got['/reader']") == [*range(50)]
        here("close('/writer')")
        eventually(there, "ports['/reader'].inputs == ()")
        there("close('/reader')")


def test_services_from_host_to_host(hosts: Hosts):
    """A request to the other host is answered."""
    hosts.far("server('/server')")
    hosts.near("client('/client')")
    hosts.near("add('/client', '/server')")
    assert hosts.near("call('/client', 'hello', 5)") == "hello"


def test_bad_cable(hosts: Hosts):
    """On an overloaded cable tcp delivers everything in order, and udp loses messages without damage or disorder."""
    hosts.narrow()
    hosts.far("reader('/reader')")
    hosts.near("writer('/writer')")
    hosts.near("add('/writer', '/reader', 'fast_tcp')")
    hosts.near("write('/writer', 0, 100, 20000)")
    eventually(hosts.far, "len(got['/reader']) == 100")
    assert hosts.far("got['/reader']") == [*range(100)]
    hosts.near("add('/writer', '/reader', 'udp')")
    hosts.near("write('/writer', 100, 200, 12000, 0.003)")
    hosts.near("write('/writer', 300, 100, 150000)")
    hosts.near("write('/writer', 400, 1, 10, 0.2)")
    hosts.widen()
    hosts.near("write('/writer', 500, 10, 10, 0.01)")
    eventually(hosts.far, "509 in got['/reader']")
    arrived = hosts.far("got['/reader']")[100:]
    assert "damaged" not in arrived
    assert arrived == sorted(set(arrived))
    assert len(arrived) < 300, "nothing was lost"


def test_cut_cable(hosts: Hosts):
    """With a cut cable calls end after their timeouts, other connections go on, and a restored cable is used again."""
    near, far = hosts.near, hosts.far
    near("reader('/near')")
    far("reader('/far')")
    far("server('/server')")
    near("writer('/stream', BufferedPort)")
    near("writer('/stuck')")
    near("client('/client')")
    for source, target in (("/stream", "/near"), ("/stream", "/far"), ("/stuck", "/far"), ("/client", "/server")):
        near(f"add('{source}', '{target}')")
    near("in_background('/stream', 0, 300, 1000, 0.01)")
    eventually(far, "len(got['/far']) > 20")

    hosts.cut()
    before = len(near("got['/near']"))
    near("in_background('/stuck', 1000, 1, 1000)")
    answer, seconds = near("took(call, '/client', 'hello', 0.3)")
    assert answer == "WaitTimeoutError"
    assert 0.2 < seconds < 5.0
    answer, seconds = near("took(add, '/client', '/server')")
    assert answer == "ConnectError"
    assert seconds < 5.0
    eventually(near, f"len(got['/near']) > {before} + 20")
    assert 1000 not in far("got['/far']")

    hosts.plug_in()
    eventually(far, "1000 in got['/far']")
    near("add('/client', '/server')")
    assert near("call('/client', 'again', 5)") == "again"
    count = len(far("got['/far']"))
    near("write('/stream', 400, 20, 1000, 0.01)")
    eventually(far, f"len(got['/far']) > {count} + 5")
    assert "damaged" not in far("got['/far']")


def test_closing_across_a_cut_cable(hosts: Hosts):
    """A reader closes soon although its writer cannot be asked to disconnect."""
    hosts.near("reader('/reader')")
    hosts.far("writer('/writer')")
    hosts.far("add('/writer', '/reader')")
    eventually(hosts.near, "ports['/reader'].inputs != ()")
    hosts.cut()
    _, seconds = hosts.near("took(close, '/reader')")
    assert seconds < 5.0
    hosts.plug_in()
    assert hosts.far("write('/writer', 0, 1, 10)") == 0
    assert hosts.far("len(ports['/writer'].outputs)") == 0
