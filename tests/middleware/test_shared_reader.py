"""The shared reader: one thread reads all inputs of non-blocking ports, without a visible difference."""

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
    """A non-blocking port that keeps numbers, and the names of the threads that read them."""

    def __init__(self, name: str, network: Network) -> None:
        self.came: list[object] = []
        self.threads: list[str] = []
        super().__init__(name, self._keep, network=network, nonblocking=True)

    def _keep(self, delivery: IncomingMessage) -> None:
        self.came.append(delivery.read().get(0))
        self.threads.append(threading.current_thread().name)


def threads_of_inputs() -> int:
    """Return the number of threads that read one connection each."""
    return sum(thread.name.startswith("rtf-input") for thread in threading.enumerate())


@pytest.fixture
def pair(network: Network) -> Iterator[tuple[PipelinedPort, Keeper]]:
    """A writer and a keeper, whose connection is read by the shared reader."""
    with Keeper("/keeper", network) as keeper, PipelinedPort("/writer", network=network) as writer:
        writer.add_output("/keeper", "tcp")
        writer.write(Bottle([0]))
        writer.settle()
        eventually(lambda: not threads_of_inputs(), "the connection has a thread")
        yield writer, keeper


class TestStreams:
    """Messages by the shared reader."""

    def test_many_streams_are_read_by_one_thread(self, network: Network):
        """All messages of many streams are read by one thread from the second on, in order, and acknowledged."""
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
        """Messages by every other carrier arrive, too."""
        with Keeper("/keeper", network) as keeper, Port("/writer", network=network) as writer:
            writer.add_output("/keeper", carrier)
            for number in range(10):
                writer.write(Bottle([number]))
                eventually(lambda number=number: keeper.came == [*range(number + 1)], "it did not come")  # type: ignore[misc]

    def test_what_is_large_has_a_thread_of_its_own(self, pair: tuple[PipelinedPort, Keeper]):
        """A large message is read by a thread of its own, so that it does not delay other streams."""
        writer, keeper = pair
        writer.write(Bottle([1, "x" * 300_000]))
        writer.write(Bottle([2]))
        writer.settle()
        assert keeper.came == [0, 1, 2]
        assert keeper.threads[1].startswith("rtf-input")

    @pytest.mark.parametrize("specifier", [131, 3], ids=["tcp", "fast_tcp"])
    @pytest.mark.parametrize("gathered", [True, False])
    def test_nothing_more_comes_from_whom_was_hung_up_on(self, network: Network, gathered: bool, specifier: int):
        """After an input is removed, messages that it has sent before are dropped."""

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
        """A request is handled in a thread of its own, so that other streams go on meanwhile."""

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
    """The end of connections by the shared reader."""

    def test_the_writer_leaves(self, pair: tuple[PipelinedPort, Keeper]):
        """The input is removed when its writer closes, without another message."""
        writer, keeper = pair
        writer.close()
        eventually(lambda: not keeper.inputs, "it is still connected")

    def test_the_keeper_hangs_up(self, pair: tuple[PipelinedPort, Keeper]):
        """A writer whose connection was closed removes its output with the next message."""
        writer, keeper = pair
        assert keeper.remove_input("/writer")
        eventually(lambda: not keeper.inputs, "it is still connected")
        writer.write(Bottle([1]))
        writer.settle()
        assert not writer.outputs
        assert keeper.came == [0]

    def test_nonsense_costs_only_its_sender_the_connection(self, network: Network, said: list[str]):
        """An error in a message closes its connection with a report, and no other one."""

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

    def test_a_callback_that_ends_its_thread_ends_only_its_connection(
        self, pair: tuple[PipelinedPort, Keeper], monkeypatch: pytest.MonkeyPatch
    ):
        """SystemExit of a callback reaches threading.excepthook, and closes its connection and no other one."""
        told: list[type[BaseException]] = []
        monkeypatch.setattr(threading, "excepthook", lambda args: told.append(args.exc_type))
        writer, keeper = pair

        class Leaving(Keeper):
            def _keep(self, delivery: IncomingMessage) -> None:
                super()._keep(delivery)
                if self.came[-1] == "leave":
                    raise SystemExit

        with Leaving("/leaving", keeper.network) as leaving, PipelinedPort("/other", network=keeper.network) as other:
            other.add_output("/leaving", "tcp")
            other.write(Bottle([0]))
            other.settle()
            eventually(lambda: not threads_of_inputs(), "the connection has a thread")
            other.write(Bottle(["leave"]))
            eventually(lambda: told == [SystemExit] and not leaving.inputs, "the connection has not ended")
            writer.write(Bottle([1]))
            writer.settle()
        assert keeper.came == [0, 1]

    def test_who_does_not_take_its_acknowledgements_is_cut_off(self, network: Network, said: list[str]):
        """A writer that does not read acknowledgements is disconnected, because it would block the thread."""
        with Keeper("/keeper", network) as keeper, raw(keeper) as caller:
            message = framed(_ONE)
            caller.sendall(message)
            eventually(lambda: keeper.came and not threads_of_inputs(), "it is not gathered")
            with pytest.raises(OSError, match=r"reset|pipe"):
                caller.sendall(1_000_000 * message)
            eventually(lambda: not keeper.inputs, "it is still connected")
            assert any("does not read what is sent to it" in line for line in said)

    def test_a_thread_cannot_be_given_another_priority(self, pair: tuple[PipelinedPort, Keeper]):
        """Setting the priority of a shared thread is refused."""
        _, keeper = pair
        with pytest.raises(QosError, match="one thread reads all streams"):
            keeper.set_qos("/writer", Qos(policy=1, priority=30))


_ONE = encode(Bottle([1]))


def framed(body: bytes, key: str = "D") -> bytes:
    """Return a framed message, or a request."""
    return framing.front(key, "", len(body)) + body


def raw(keeper: Port, specifier: int = 131) -> socket.socket:
    """Connect to a keeper by a carrier, without a port."""
    caller = socket.create_connection((keeper.contact.host, keeper.contact.port))
    name = b"/caller\0"
    caller.sendall(framing.header(specifier) + struct.pack("<i", len(name)) + name)
    assert len(caller.recv(8, socket.MSG_WAITALL)) == 8
    return caller


@given(st.lists(st.binary(max_size=200), min_size=1, max_size=8), st.data())
@settings(deadline=None, max_examples=40)  # threads have to be woken
def test_messages_arrive_however_they_are_cut(words: list[bytes], data: st.DataObject):
    """Messages arrive and are acknowledged, however their bytes are split."""
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
