"""The contract of carriers: one class of tests, with a subclass for each carrier."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, ClassVar

import pytest

from rtf.bottle import Bottle, same
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.port import Port
from rtf.middleware.types.codecs import BOTTLE
from rtf.middleware.wire.outgoing_message import OutgoingMessage
from waiting import eventually

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network
    from rtf.middleware.wire.incoming_message import IncomingMessage

TALK = '1 2.5 hello "two words" (1 2 3) [pos] {10 20 30} -7 "say \\"hi\\"" (1.5 2.5) (a (b c) [ok]) true 3000000000'


class Contract:
    """A connection by the carrier ``name``, from its making to its end."""

    name: ClassVar[str]
    reliable: ClassVar[bool] = True
    replies: ClassVar[bool] = True
    largest: ClassVar[int] = 3_000_000

    def connect(self, writer: Port, reader: Port) -> None:
        """Connect two ports, and wait until the reader is ready: not every handshake has an answer."""
        before = set(reader.inputs)
        writer.add_output(reader.name, self.name)
        fresh = lambda: [one for one in reader.inputs if one not in before and one.peer == writer.name]  # noqa: E731
        eventually(fresh, "the reader has no new input")

    def test_what_is_sent_arrives(self, network: Network):
        """Messages arrive whole, in order, with the sender's name and the envelope."""
        with (
            BufferedPort("/reader", strict=True, network=network) as reader,
            Port("/writer", network=network) as writer,
        ):
            self.connect(writer, reader)
            for number in range(50):
                writer.write(Bottle([number, *Bottle.parse(TALK)]), envelope=f"{number} 1.5")
            for number in range(50):
                received = reader.receive(timeout=5)
                assert same(received.value, Bottle([number, *Bottle.parse(TALK)]))
                assert (received.sender, received.envelope) == ("/writer", f"{number} 1.5")

    def test_both_ends_list_it(self, network: Network):
        """Both ends list the connection with its carrier, and the reader no longer when the writer is closed."""
        with BufferedPort("/reader", network=network) as reader:
            with Port("/writer", network=network) as writer:
                writer.add_output("/reader", self.name)
                eventually(
                    lambda: [(one.peer, one.carrier) for one in reader.inputs] == [("/writer", self.name)], "input"
                )
                assert [(one.peer, one.carrier) for one in writer.outputs] == [("/reader", self.name)]
            eventually(lambda: not reader.inputs, "the reader still lists its input")

    def test_large_messages_arrive(self, network: Network):
        """A message of megabytes is the same at the other end."""
        blob = bytes(range(256)) * (self.largest // 256)
        with BufferedPort("/reader", network=network) as reader, Port("/writer", network=network) as writer:
            self.connect(writer, reader)
            writer.write(Bottle([blob]))
            assert reader.read(timeout=10) == Bottle([blob])

    def test_empty_messages_arrive(self, network: Network):
        """An empty bottle is a message."""
        with BufferedPort("/reader", network=network) as reader, Port("/writer", network=network) as writer:
            self.connect(writer, reader)
            writer.write(Bottle())
            assert reader.read(timeout=5) == Bottle()

    def test_question_is_answered(self, network: Network):
        """A request gets its reply if the carrier has replies, and None otherwise."""

        def answer(delivery: IncomingMessage) -> None:
            delivery.reply(Bottle(["you said", *delivery.read()]))

        with Port("/server", answer, network=network), Port("/client", network=network) as client:
            client.add_output("/server", self.name)
            message = OutgoingMessage("d", Bottle([1, "two"]), BOTTLE, network.dialect)
            reply = client.outputs[0].call(message, BOTTLE)
            assert reply == (Bottle(["you said", 1, "two"]) if self.replies else None)

    def test_many_threads_may_write(self, network: Network):
        """Messages of several threads arrive whole, and in order for each thread."""
        with (
            BufferedPort("/reader", strict=True, network=network) as reader,
            Port("/writer", network=network) as writer,
        ):
            self.connect(writer, reader)

            def write(number: int) -> None:
                for count in range(50):
                    writer.write(Bottle([number, count, "x" * 500]))

            threads = [threading.Thread(target=write, args=(number,)) for number in range(4)]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
            seen: dict[object, list[object]] = {}
            for _ in range(200):
                number, count, _ = reader.read(timeout=5)
                seen.setdefault(number, []).append(count)
            assert seen == {number: [*range(50)] for number in range(4)}

    def test_reader_that_closes_is_noticed(self, network: Network):
        """The writer removes a closed reader at the latest with its next write, if the carrier is reliable."""
        with Port("/writer", network=network) as writer:
            reader = BufferedPort("/reader", network=network)
            writer.add_output("/reader", self.name)
            writer.write(Bottle([1]))
            reader.close()

            def write_again() -> bool:
                writer.write(Bottle([2]))
                return not writer.outputs

            if self.reliable:
                eventually(write_again, "the writer still lists its output")

    def test_connection_can_be_made_again(self, network: Network):
        """A second connection to the same port replaces the first."""
        with (
            BufferedPort("/reader", strict=True, network=network) as reader,
            Port("/writer", network=network) as writer,
        ):
            for number in range(3):
                self.connect(writer, reader)
                writer.write(Bottle([number]))
                assert reader.read(timeout=5) == Bottle([number])
            assert len(writer.outputs) == 1
            eventually(lambda: len(reader.inputs) == 1, "an old input is left")

    def test_port_that_is_not_there_cannot_be_connected(self, network: Network):
        """The error of a connection to a missing port names the port."""
        with Port("/writer", network=network) as writer, pytest.raises(MiddlewareError, match="/nobody"):
            writer.add_output("/nobody", self.name)


class TestTcp(Contract):
    """The carrier tcp: binary, with acknowledgements."""

    name = "tcp"


class TestFastTcp(Contract):
    """The carrier fast_tcp: binary, without acknowledgements."""

    name = "fast_tcp"


class TestText(Contract):
    """The carrier text: lines, without acknowledgements."""

    name = "text"
    replies = False
    largest = 200_000


class TestTextAck(Contract):
    """The carrier text_ack: lines, with acknowledgements."""

    name = "text_ack"
    largest = 200_000


class TestUdp(Contract):
    """The carrier udp: datagrams to one reader."""

    name = "udp"
    reliable = False
    replies = False
    largest = 150_000


class TestMcast(Contract):
    """The carrier mcast: datagrams to a group of readers."""

    name = "mcast"
    reliable = False
    replies = False
    largest = 150_000


class TestLocal(Contract):
    """The carrier local: objects within one process."""

    name = "local"


class TestUnixStream(Contract):
    """The carrier unix_stream: binary, on one machine."""

    name = "unix_stream"


class TestUnixStreamAck(Contract):
    """The carrier unix_stream with acknowledgements."""

    name = "unix_stream+ack"
