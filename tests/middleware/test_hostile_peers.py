"""Peers that break the protocol: each loses its own connection, and others are served."""

from __future__ import annotations

import os
import random
import resource
import socket
import struct
import threading
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rtf.bottle import Bottle
from rtf.errors import RtfError
from rtf.middleware.carriers import unix_stream
from rtf.middleware.carriers.stream import Stream
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports import port as ports
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcClient, RpcServer
from rtf.middleware.wire import framing
from waiting import eventually

from .test_recordings import recorded

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture
def server(network: Network) -> Iterator[RpcServer]:
    """A server for these peers."""
    with RpcServer("/server", lambda question: Bottle([*question, "ok"]), network=network) as made:
        yield made


def attack(server: Port, data: bytes, *, patience: float = 5.0) -> bytes:
    """Send bytes, end the sending side, and return all bytes that come back."""
    with socket.create_connection((server.contact.host, server.contact.port), timeout=patience) as connection:
        answer = b""
        try:
            connection.sendall(data)
            connection.shutdown(socket.SHUT_WR)
            while part := connection.recv(1 << 16):
                answer += part
        except OSError:
            pass  # it was cut off in the middle, which is its right
        return answer


def well(server: Port, network: Network) -> None:
    """Check that the server answers another client."""
    with RpcClient("/client", server.contact, network=network) as client:
        assert client.call(Bottle(["are you there?"]), timeout=5) == Bottle(["are you there?", "ok"])


HELLO = framing.header(131) + framing.sender("/evil")


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"GARBAGE!",
        b"\0" * 1000,
        b"YA\xff\xff\xff\x7fRP",
        framing.header(131) + struct.pack("<i", 2**31 - 1) + b"/x\0",
        framing.header(131) + struct.pack("<i", -5) + b"/x\0" * 400,
        HELLO + b"nonsense" * 100,
        HELLO + framing.index(2**31 - 1),
        HELLO + framing.index(-1),
        HELLO + framing.yarp_number(10) + b"\xff\xff" + b"\xff" * 8 + b"\x7f" * 2040,
        HELLO + framing.index(8, 2**30) + framing.command("d"),
        HELLO + framing.index(8, 12) + framing.command("d") + struct.pack("<iii", 256 + 1, 2**31 - 1, 0),
        HELLO + framing.index(8, 12) + framing.command("d") + struct.pack("<iii", 256 + 4, 1, 2**31 - 1),
        HELLO + framing.index(8, 800) + framing.command("d") + struct.pack("<ii", 256, 1) * 100,
        HELLO + framing.index(12) + struct.pack("<i", 2**30) + b"~\0\0\1xxxx",
        HELLO + framing.index(8) + framing.command("a"),
        b"CONNACK " + b"x" * 3_000_000,
        b"CONNACK evil\r\n" + b"d\r\n" + b"(" * 3_000_000,
        b"CONNACK evil\r\na\r\n" + b"(" * 100_000 + b")" * 100_000 + b"\r\n",
        b"CONNACK evil\r\nd\r\n\xff\xfe\x00\r\nq\r\n",
        pytest.param(b"UNIX_STR" + framing.sender("/evil"), id="nobody comes to the meeting"),
        b"LOCALITY" + framing.sender("/evil"),
        framing.header(0) + framing.sender("/evil"),
        framing.header(1) + framing.sender("/evil") + b"\x7f\0\0\1\0\0",
        framing.header(14) + framing.sender("/evil"),
        b"NAME_SERVER unregister /server\r\n",
    ],
)
def test_one_that_breaks_the_rules_is_cut_off(
    server: RpcServer, network: Network, data: bytes, monkeypatch: pytest.MonkeyPatch
):
    """After any invalid bytes the server answers another client."""
    monkeypatch.setattr(unix_stream, "_MEETING", 0.1)
    attack(server, data)
    well(server, network)


def test_what_a_peer_only_announces_is_not_allocated(server: RpcServer, network: Network):
    """The size of a message is not allocated before its bytes arrive."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    waiting = [socket.create_connection((server.contact.host, server.contact.port), timeout=5) for _ in range(20)]
    for connection in waiting:
        connection.sendall(HELLO + framing.index(8, framing.MAX_MESSAGE - 8) + framing.command("d") + b"x" * 1000)
    well(server, network)
    for connection in waiting:
        connection.close()
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 300 << 10, "KiB were allocated for nothing"


def test_a_flood_of_callers_is_bounded(server: RpcServer, network: Network, monkeypatch: pytest.MonkeyPatch):
    """At most MAX_INPUTS callers are kept; when they are gone others are served."""
    monkeypatch.setattr(ports, "MAX_INPUTS", 50)
    callers = [socket.create_connection((server.contact.host, server.contact.port), timeout=5) for _ in range(200)]
    eventually(lambda: sum(_hung_up(caller) for caller in callers) >= 150, "more callers are kept than are allowed")
    for caller in callers:
        caller.close()
    eventually(lambda: threading.active_count() < 20, "threads are left")
    well(server, network)


def _hung_up(caller: socket.socket) -> bool:
    caller.setblocking(False)
    try:
        return caller.recv(1) == b""
    except BlockingIOError:
        return False
    except OSError:
        return True


def test_one_that_stalls_delays_no_other(server: RpcServer, network: Network):
    """Callers that send no handshake, or read no replies, do not delay others."""
    stalled = [socket.create_connection((server.contact.host, server.contact.port), timeout=5) for _ in range(10)]
    for connection in stalled[:3]:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        connection.sendall(HELLO)
        question = framing.index(8, 8) + framing.command("d") + struct.pack("<ii", 256, 0)
        connection.settimeout(0.2)
        try:
            while True:
                connection.sendall(question * 1000)
        except TimeoutError:
            pass
    well(server, network)
    for connection in stalled:
        connection.close()


CONVERSATIONS = [
    b"".join(data for way, data in recorded("3.12.3", name) if way == ">") for name in ("tcp", "text_ack", "admin")
]


@given(data=st.data())
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_damaged_conversations(server: RpcServer, network: Network, data: st.DataObject):
    """Recorded conversations with flipped, missing, doubled and cut bytes are survived."""
    talk = bytearray(data.draw(st.sampled_from(CONVERSATIONS)))
    for _ in range(data.draw(st.integers(1, 6))):
        place = data.draw(st.integers(0, len(talk) - 1))
        kind = data.draw(st.sampled_from(["flip", "set", "cut", "double", "drop"]))
        if kind == "flip":
            talk[place] ^= 1 << data.draw(st.integers(0, 7))
        elif kind == "set":
            talk[place] = data.draw(st.integers(0, 255))
        elif kind == "cut":
            del talk[max(1, place) :]
        elif kind == "double":
            talk[place:place] = talk[max(0, place - 16) : place]
        else:
            del talk[place : place + data.draw(st.integers(1, 16))]
        if not talk:
            return
    attack(server, bytes(talk))


@given(st.binary(max_size=400))
@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_random_bytes_after_the_handshake(server: RpcServer, network: Network, data: bytes):
    """Random bytes after the handshake are survived."""
    attack(server, HELLO + data)


def test_the_server_survived(server: RpcServer, network: Network):
    """After a hundred connections with random bytes the server answers."""
    luck = random.Random(5)
    for _ in range(100):
        attack(server, HELLO + luck.randbytes(luck.randrange(200)))
    well(server, network)


@given(st.binary(max_size=200))
@settings(max_examples=300, deadline=None)
def test_a_client_survives_any_answer(data: bytes):
    """Any bytes instead of a reply are a reply, or raise RtfError."""
    ours, theirs = socket.socketpair()
    with theirs:
        from rtf.bottle import Dialect
        from rtf.middleware.carriers.stream_carrier import TCP
        from rtf.middleware.types.codecs import BOTTLE

        link = TCP.output(Stream(ours))
        link._sender.due = 1
        theirs.sendall(data)
        theirs.shutdown(socket.SHUT_WR)
        try:
            link.receive_reply(BOTTLE, Dialect.YARP3)
            link.finish()
        except RtfError:
            pass
        finally:
            link.close(politely=False)


def test_many_ports_and_connections():
    """500 ports with 1000 connections need less than 300 MB, and no processor time while idle."""
    script = """
import os, resource, threading, time
from rtf.bottle import Bottle
from rtf.middleware.carriers import unix_stream
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
resource.setrlimit(resource.RLIMIT_NOFILE, (resource.getrlimit(resource.RLIMIT_NOFILE)[1],) * 2)
network = Network(LocalNames())
readers = [BufferedPort(f"/r/{n}", network=network) for n in range(250)]
writers = [Port(f"/w/{n}", network=network) for n in range(250)]
for n, writer in enumerate(writers):
    for k in range(4):
        writer.add_output(readers[(n + 37 * k) % 250].name, ("tcp", "fast_tcp")[k % 2])
for n, writer in enumerate(writers):
    assert writer.write(Bottle([n])) == 4
used = time.process_time()
time.sleep(1.0)
idle = time.process_time() - used
for reader in readers:
    assert reader.read(timeout=5)
peak = next(int(line.split()[1]) for line in open('/proc/self/status') if line.startswith('VmHWM')) // 1024
for port in (*writers, *readers):
    port.close()
print(peak, idle, threading.active_count())
os._exit(0)
"""
    import subprocess
    import sys

    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 0, done.stderr
    peak, idle, threads = done.stdout.split()
    assert int(peak) < 300
    assert float(idle) < 0.05
    assert int(threads) <= 2


@pytest.mark.parametrize("seed", range(12))
def test_any_order_of_calls(seed: int):
    """Concurrent writes, reads, interrupts and closes end, and no strict message is lost or doubled."""
    schedule = Schedule(seed)
    try:
        schedule.run()
    finally:
        schedule.close()
    got, sent = schedule.got, schedule.sent
    assert len(got) == len(set(got)), "a message was doubled"
    assert set(sent) <= set(got), "a message was lost"
    for number in range(3):
        counts = [count for who, count in got if who == number]
        assert counts == sorted(counts), "messages overtook each other"


class Schedule:
    """Three writers, a strict reader and a thread that interrupts writers, in a random order."""

    def __init__(self, seed: int) -> None:
        self.luck = random.Random(seed)
        network = Network(LocalNames())
        self.reader = BufferedPort("/reader", strict=True, network=network)
        self.writers = [Port(f"/writer/{number}", network=network) for number in range(3)]
        for writer in self.writers:
            writer.add_output("/reader", self.luck.choice(["tcp", "local", "text_ack", "unix_stream+ack"]))
        self.got: list[tuple[object, ...]] = []
        self.sent: list[tuple[object, ...]] = []
        self.lock = threading.Lock()
        self.written = threading.Event()

    def run(self) -> None:
        """Run all threads to their end."""
        jobs = [(self.write, number) for number in range(3)] + [(self.read,), (self.disturb,)]
        self.luck.shuffle(jobs)
        threads = [threading.Thread(target=job, args=arguments, daemon=True) for job, *arguments in jobs]
        reading = threads[jobs.index((self.read,))]
        for thread in threads:
            thread.start()
        for thread in threads:
            if thread is not reading:
                thread.join(20)
                assert not thread.is_alive(), "a deadlock"
        self.written.set()
        reading.join(20)
        assert not reading.is_alive(), "a deadlock"

    def write(self, number: int) -> None:
        """Write forty messages, as long as the port is open."""
        for count in range(40):
            try:
                if self.writers[number].write(Bottle([number, count])):
                    with self.lock:
                        self.sent.append((number, count))
            except RtfError:
                return

    def read(self) -> None:
        """Read until nothing is written any more, and nothing is left."""
        while True:
            over = self.written.is_set()
            try:
                self.got.append(tuple(self.reader.read(timeout=0.05)))
            except RtfError:
                if over:
                    return

    def disturb(self) -> None:
        """Interrupt and resume writers, and perhaps close one."""
        for _ in range(3):
            os.sched_yield()
            self.luck.choice(self.writers).interrupt()
            self.luck.choice(self.writers).resume()
        if self.luck.random() < 0.5:
            self.luck.choice(self.writers).close()

    def close(self) -> None:
        """Close the ports."""
        for port in (*self.writers, self.reader):
            port.close()


@pytest.mark.parametrize("header", [b"UNIX_STR", b"UNIX_ACK", framing.header(0), framing.header(131)])
def test_callers_that_are_gone_after_the_handshake(network: Network, header: bytes):
    """A caller that resets the connection at any point of the handshake ends its own connection only."""
    with Port("/reader", lambda message: message.read(), network=network) as port:
        for _ in range(50):
            with socket.create_connection((port.contact.host, port.contact.port)) as peer:
                peer.sendall(header + framing.sender("/gone"))
                peer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        with Port("/writer", network=network) as writer:
            writer.add_output("/reader")
            assert writer.write(Bottle([1.5])) == 1
