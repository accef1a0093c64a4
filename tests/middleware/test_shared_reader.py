"""Ports that only keep what comes: one thread reads all their streams, and nobody can tell from outside."""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtf.bottle import Bottle
from rtf.bottle.binary import encode
from rtf.middleware.errors import ProtocolError
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.pipelined_port import PipelinedPort
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.qos import Qos, QosError
from rtf.middleware.wire import framing
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.middleware.wire.incoming_message import IncomingMessage


class Keeper(Port):
    """A port that keeps numbers, and the threads in which they came."""

    def __init__(self, name: str, network: Network) -> None:
        self.came: list[object] = []
        self.threads: list[str] = []
        super().__init__(name, self._keep, network=network, nonblocking=True)

    def _keep(self, delivery: IncomingMessage) -> None:
        self.came.append(delivery.read().get(0))
        self.threads.append(threading.current_thread().name)


def threads_of_inputs() -> int:
    """How many threads wait for one connection each."""
    return sum(thread.name.startswith("rtf-input") for thread in threading.enumerate())


@pytest.fixture
def pair(network: Network) -> Iterator[tuple[PipelinedPort, Keeper]]:
    """A writer that is connected to a keeper by tcp, which is gathered."""
    with Keeper("/keeper", network) as keeper, PipelinedPort("/writer", network=network) as writer:
        writer.add_output("/keeper", "tcp")
        writer.write(Bottle([0]))
        writer.settle()
        eventually(lambda: not threads_of_inputs(), "the connection has a thread")
        yield writer, keeper


class TestStreams:
    """What arrives."""

    def test_many_streams_are_read_by_one_thread(self, network: Network):
        """From the second message on; all of them arrive, in order, and are acknowledged."""
        before = threads_of_inputs()
        keepers = [Keeper(f"/keeper{number}", network) for number in range(12)]
        writers = [PipelinedPort(f"/writer{number}", network=network, together=3) for number in range(12)]
        for keeper, writer in zip(keepers, writers, strict=True):
            writer.add_output(keeper.name, "tcp")
            writer.write(Bottle([0]))
            writer.settle()
        eventually(lambda: threads_of_inputs() == before, "a connection has a thread")
        for number in range(1, 40):
            for writer in writers:
                writer.write(Bottle([number]))
        for writer in writers:
            writer.settle()
        for keeper in keepers:
            assert keeper.came == [*range(40)]
            assert set(keeper.threads[1:]) == {"rtf-shared-reader"}
        for port in (*writers, *keepers):
            port.close()

    @pytest.mark.parametrize("carrier", ["fast_tcp", "text_ack", "udp", "unix_stream+ack", "local"])
    def test_other_carriers_carry_as_ever(self, network: Network, carrier: str):
        """Whether they are gathered or not."""
        with Keeper("/keeper", network) as keeper, Port("/writer", network=network) as writer:
            writer.add_output("/keeper", carrier)
            for number in range(10):
                writer.write(Bottle([number]))
                eventually(lambda number=number: keeper.came == [*range(number + 1)], "it did not come")  # type: ignore[misc]

    def test_what_is_large_has_a_thread_of_its_own(self, pair: tuple[PipelinedPort, Keeper]):
        """It would hold the others up; it arrives all the same, and so does what follows."""
        writer, keeper = pair
        writer.write(Bottle([1, "x" * 300_000]))
        writer.write(Bottle([2]))
        writer.settle()
        assert keeper.came == [0, 1, 2]
        assert keeper.threads[1].startswith("rtf-input")

    @pytest.mark.parametrize("specifier", [131, 3], ids=["tcp", "fast_tcp"])
    @pytest.mark.parametrize("gathered", [True, False])
    def test_nothing_more_comes_from_whom_was_hung_up_on(self, network: Network, gathered: bool, specifier: int):
        """What it has sent already is older than what comes from the same port by a new connection."""

        class Impatient(Keeper):
            def _keep(self, delivery: IncomingMessage) -> None:
                super()._keep(delivery)
                if self.came[-1] == 3:
                    assert self.remove_input(delivery.sender)

        with Impatient("/keeper", network) as keeper:
            keeper.nonblocking = gathered
            with raw(keeper, specifier) as caller:
                caller.sendall(framed(encode(Bottle([0]))))
                eventually(lambda: keeper.came and gathered is (threads_of_inputs() == 0), "it is not as wanted")
                caller.sendall(b"".join(framed(encode(Bottle([number]))) for number in range(1, 8)))
                caller.settimeout(5.0)
                with contextlib.suppress(ConnectionError):
                    while caller.recv(4096):
                        pass
            eventually(lambda: not threads_of_inputs(), "the connection has not ended")
            assert keeper.came == [0, 1, 2, 3]

    def test_a_question_has_a_thread_of_its_own(self, network: Network):
        """Who answers may take its time: here until another stream has brought something."""

        class Answering(Keeper):
            def _keep(self, delivery: IncomingMessage) -> None:
                super()._keep(delivery)
                if delivery.wants_reply:
                    other.write(Bottle([7]))
                    other.settle()
                    delivery.reply(Bottle(["done"]))

        with Answering("/keeper", network) as keeper, PipelinedPort("/other", network=network) as other:
            other.add_output("/keeper", "tcp")
            other.write(Bottle([0]))
            other.settle()
            with raw(keeper) as caller:
                caller.sendall(framed(_ONE))
                eventually(lambda: len(keeper.came) == 2 and not threads_of_inputs(), "it is not gathered")
                caller.sendall(framed(_ONE, "d"))
                answer = encode(Bottle(["done"])) + framing.ACK
                assert caller.recv(len(framing.ACK) + len(answer), socket.MSG_WAITALL) == framing.ACK + answer
            assert keeper.came == [0, 1, 1, 7]


class TestEnds:
    """How a connection ends."""

    def test_the_writer_leaves(self, pair: tuple[PipelinedPort, Keeper]):
        """The keeper knows of it, without another message."""
        writer, keeper = pair
        writer.close()
        eventually(lambda: not keeper.inputs, "it is still connected")

    def test_the_keeper_hangs_up(self, pair: tuple[PipelinedPort, Keeper]):
        """The writer notices with its next message."""
        writer, keeper = pair
        assert keeper.remove_input("/writer")
        eventually(lambda: not keeper.inputs, "it is still connected")
        writer.write(Bottle([1]))
        writer.settle()
        assert not writer.outputs
        assert keeper.came == [0]

    def test_what_makes_no_sense_costs_its_sender_the_connection_and_nobody_else(
        self, network: Network, said: list[str]
    ):
        """It is reported, and the other streams go on."""

        class Fussy(Keeper):
            def _keep(self, delivery: IncomingMessage) -> None:
                super()._keep(delivery)
                if self.came[-1] == "bad":
                    raise ProtocolError("that is bad")

        with (
            Fussy("/keeper", network) as keeper,
            PipelinedPort("/good", network=network) as good,
            PipelinedPort("/bad", network=network) as bad,
        ):
            for writer in (good, bad):
                writer.add_output("/keeper", "tcp")
                writer.write(Bottle([0]))
                writer.settle()
            eventually(lambda: not threads_of_inputs(), "a connection has a thread")
            bad.write(Bottle(["bad"]))
            bad.settle()
            good.write(Bottle([1]))
            good.settle()
            eventually(lambda: [one.sender for one in keeper.inputs] == ["/good"], "the wrong one was cut off")
            assert keeper.came == [0, 0, "bad", 1]
            assert any("/bad was cut off: that is bad" in line for line in said)

    def test_who_does_not_take_its_acknowledgements_is_cut_off(self, network: Network, said: list[str]):
        """It would hold up everybody else."""
        with Keeper("/keeper", network) as keeper, raw(keeper) as caller:
            message = framed(_ONE)
            caller.sendall(message)
            eventually(lambda: keeper.came and not threads_of_inputs(), "it is not gathered")
            with pytest.raises(OSError, match=r"reset|pipe"):
                caller.sendall(1_000_000 * message)
            eventually(lambda: not keeper.inputs, "it is still connected")
            assert any("does not read what is sent to it" in line for line in said)

    def test_a_thread_cannot_be_given_another_priority(self, pair: tuple[PipelinedPort, Keeper]):
        """It is not its own; the requester gets an error."""
        _, keeper = pair
        with pytest.raises(QosError, match="one thread reads all streams"):
            keeper.set_qos("/writer", Qos(policy=1, priority=30))


_ONE = encode(Bottle([1]))


def framed(body: bytes, key: str = "D") -> bytes:
    """A message of data, or one that asks."""
    return framing.front(key, "", len(body)) + body


def raw(keeper: Port, specifier: int = 131) -> socket.socket:
    """A connection by tcp, or by what the number says, that was made by hand."""
    caller = socket.create_connection((keeper.contact.host, keeper.contact.port))
    name = b"/caller\0"
    caller.sendall(framing.header(specifier) + struct.pack("<i", len(name)) + name)
    assert len(caller.recv(8, socket.MSG_WAITALL)) == 8
    return caller


@given(st.lists(st.binary(max_size=200), min_size=1, max_size=8), st.data())
@settings(deadline=None, max_examples=40)  # threads have to be woken
def test_messages_arrive_however_they_are_cut(words: list[bytes], data: st.DataObject):
    """Each piece is on its way alone; all are acknowledged."""
    whole = b"".join(framed(encode(Bottle([word]))) for word in words)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(whole)), max_size=6)))
    pieces = [whole[begin:end] for begin, end in zip([0, *cuts], [*cuts, len(whole)], strict=True)]
    with Keeper("/keeper", Network(LocalNames(), report=lambda _: None)) as keeper, raw(keeper) as caller:
        caller.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for piece in pieces:
            caller.sendall(piece)
        acknowledged = caller.recv(len(framing.ACK) * len(words), socket.MSG_WAITALL)
        assert acknowledged == framing.ACK * len(words)
        assert [bytes(word) for word in keeper.came] == words  # type: ignore[arg-type]
