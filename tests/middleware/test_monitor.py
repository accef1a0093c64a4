"""Monitoring a network from outside, with real ports and the kernel's counters."""

from __future__ import annotations

import socket
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest

from rtf import clock
from rtf.bottle import MAX_DEPTH, Bottle, Vocab
from rtf.middleware.errors import MiddlewareError, ProtocolError
from rtf.middleware.ports import remote
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcClient, RpcServer
from rtf.middleware.tools import tcp_counters
from rtf.middleware.tools.monitor import Link, Tap, Traffic, survey
from rtf.middleware.wire.contact import Contact
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.middleware.ports.network import Network


def _ignore(delivery: object) -> None:
    """Ignore a message."""


@contextmanager
def writing(port: Port) -> Iterator[None]:
    """Let a port write periodically in a thread, within the block."""
    over = threading.Event()

    def write() -> None:
        while not over.wait(0.002):
            port.write(Bottle([1, 2, 3]))

    thread = threading.Thread(target=write)
    thread.start()
    yield
    over.set()
    thread.join()


def some_arrive(arrived: list[object]) -> None:
    """Wait for 0.3 s, and until some messages have come in this time."""
    before = len(arrived)
    clock.sleep(0.3)
    eventually(lambda: len(arrived) > before + 20, "nothing comes")


#: Bytes of such a message: index with two blocks, command, and a bottle of three integers.
_MESSAGE = 8 + 10 + 3 * 4 + 8 + 20


class TestSurvey:
    """The survey of all ports at one moment."""

    def test_ports_and_connections(self, network: Network):
        """The survey has each port's latency and connections, without those of the survey itself."""
        with Port("/a", network=network) as a, Port("/b", _ignore, network=network):
            a.add_output("/b", "fast_tcp")
            found = {port.name: port for port in survey(network)}
        assert found["/a"].outputs == (Link("/a", "/b", "fast_tcp"),)
        assert found["/b"].inputs == ("/a",)
        assert found["/a"].inputs == found["/b"].outputs == ()
        assert all(port.alive and 0 < port.latency < 10 for port in found.values())

    def test_only_a_part(self, network: Network):
        """A prefix selects whole parts of names."""
        with Port("/a/x", network=network), Port("/ab", network=network):
            assert [port.name for port in survey(network, "/a")] == ["/a/x"]

    def test_ports_that_do_not_answer(self, network: Network):
        """Ports that are gone or silent are dead within the patience; entries that are no ports are unknown."""
        with socket.create_server(("127.0.0.1", 0)) as mute:
            network.names.register("/mute", carrier="tcp", host="127.0.0.1", port=mute.getsockname()[1])
            network.names.register("/gone", carrier="tcp", host="127.0.0.1", port=1)
            network.names.register("/group", carrier="mcast", host="224.1.1.3", port=5000)
            before = clock.monotonic()
            found = {port.name: port.alive for port in survey(network, patience=0.2)}
            assert clock.monotonic() - before < 5
        assert found == {"/mute": False, "/gone": False, "/group": None}

    def test_a_port_that_answers_nonsense(self, network: Network):
        """An answer that is no bottle is a ProtocolError of the request, and in the survey its port is silent."""
        with Port("/good", network=network), socket.create_server(("127.0.0.1", 0)) as listening:
            contact = Contact("/rogue", "127.0.0.1", listening.getsockname()[1], "tcp")
            network.names.register(contact.name, carrier="tcp", host=contact.host, port=contact.port)
            thread = threading.Thread(target=_answer_nonsense, args=(listening, 2))
            thread.start()
            with pytest.raises(ProtocolError, match=r"a port answered \[ver\] with '\(\(\("):
                remote.administer(network, contact, Bottle([Vocab("ver")]))
            assert {port.name: port.alive for port in survey(network)} == {"/good": True, "/rogue": False}
            thread.join(10)


def _answer_nonsense(listening: socket.socket, callers: int) -> None:
    """Answer the first admin request of each caller with more brackets than a bottle may have."""
    listening.settimeout(10)
    for _ in range(callers):
        connection, _ = listening.accept()
        with connection, connection.makefile("rwb", buffering=0) as lines:
            lines.readline()
            lines.write(b"Welcome admin\r\n")
            lines.readline()
            lines.readline()
            lines.write(b"(" * (MAX_DEPTH + 1) + b"\r\n<ACK>\r\n")


class TestTraffic:
    """Rates from the counters of the kernel."""

    def flow(self, network: Network, name: str, seconds: float = 0.3):
        """Return the flow to a port during some time."""
        traffic = Traffic()
        traffic.flows([])
        clock.sleep(seconds)
        return traffic.flows(survey(network)).get(name)

    def test_messages_over_tcp(self, network: Network):
        """Messages are counted by their acknowledgements, and bytes as they arrive.

        The kernel's counters are read between two moments at the beginning, and between two at the end.
        """
        arrived: list[object] = []
        traffic = Traffic()
        moments = []
        with Port("/a", network=network) as a, Port("/b", arrived.append, network=network):
            a.add_output("/b")
            with writing(a):
                for ports in ([], survey(network)):
                    some_arrive(arrived)
                    moments.append((len(arrived), clock.monotonic()))
                    found = traffic.flows(ports).get("/b")
                    moments.append((len(arrived), clock.monotonic()))
        counts, times = zip(*moments, strict=True)
        fewest, most = counts[2] - counts[1], counts[3] - counts[0]
        shortest, longest = times[2] - times[1], times[3] - times[0]
        assert 0.9 * fewest / longest < found.rate < 1.1 * most / shortest
        assert found.bandwidth / found.rate == pytest.approx(_MESSAGE, abs=2)

    def test_bytes_over_fast_tcp(self, network: Network):
        """Without acknowledgements the rate of messages is unknown, and the bandwidth is known."""
        arrived: list[object] = []
        traffic = Traffic()
        with Port("/a", network=network) as a, Port("/b", arrived.append, network=network):
            a.add_output("/b", "fast_tcp")
            with writing(a):
                traffic.flows([])
                some_arrive(arrived)
                found = traffic.flows(survey(network)).get("/b")
        assert found.rate is None
        assert found.bandwidth > 100

    def test_answers_are_not_taken_for_acknowledgements(self, network: Network):
        """The rate of requests is unknown, because replies are longer than acknowledgements."""
        with RpcServer("/b", lambda question: question, network=network), RpcClient("/a", "/b", network=network) as a:
            traffic = Traffic()
            traffic.flows([])
            for number in range(10):
                a.call(Bottle([number]))
            found = traffic.flows(survey(network))["/b"]
        assert found.rate is None
        assert found.bandwidth > 0

    def test_silence(self, network: Network):
        """An idle connection has the rate 0, and a port without inputs has no flow."""
        with Port("/a", network=network) as a, Port("/b", _ignore, network=network):
            a.add_output("/b")
            found = self.flow(network, "/b", 0.05)
            assert self.flow(network, "/a", 0.0) is None
        assert (found.rate, found.bandwidth) == (0.0, 0.0)


class TestTap:
    """A reader that counts messages."""

    def test_counts_messages_and_bytes(self, network: Network):
        """The tap counts messages and bytes, and is disconnected afterwards."""
        with Port("/a", network=network) as a:
            with Tap(network, Contact("/a"), "tcp") as tap:
                for _ in range(10):
                    a.write(Bottle([1, 2, 3]))
                found = tap.flow()
                assert found.bandwidth == pytest.approx(20 * found.rate)
                assert tap.flow().rate == 0
                assert [output.peer for output in a.outputs] == [tap.name]
            assert a.outputs == ()

    def test_a_port_that_is_missing(self, network: Network):
        """The tap of a missing port is an error, and leaves no port open."""
        with pytest.raises(MiddlewareError, match="/none"):
            Tap(network, Contact("/none"))
        assert network.names.list() == []


def test_the_kernel_counts_both_ends():
    """Both ends of a connection have counters of bytes and segments."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        with socket.create_connection(listening.getsockname()) as near, listening.accept()[0] as far:
            ends = tcp_counters.Endpoints(near.getsockname(), far.getsockname())
            before = tcp_counters.connections()[ends]
            near.sendall(bytes(1000))
            assert far.recv(1000, socket.MSG_WAITALL) == bytes(1000)
            far.sendall(b"yes")
            assert near.recv(3) == b"yes"
            counted = tcp_counters.connections()
        assert counted[ends].since(before) == tcp_counters.TcpCounters(received=3, sent=1000, segments_sent=1)
        assert counted[tcp_counters.Endpoints(ends.far, ends.near)].received == 1000
        assert ends not in tcp_counters.connections()
