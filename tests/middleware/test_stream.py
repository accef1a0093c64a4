"""Streams reuse their buffers, but not one of which a message is kept."""

from __future__ import annotations

import socket
import threading
from typing import TYPE_CHECKING

import pytest

from rtf.bottle import Bottle
from rtf.middleware.carriers.stream import Stream, StreamClosedError
from rtf.middleware.ports.port import Port
from rtf.middleware.types import IMAGE, Image
from rtf.middleware.wire.inbox import CHUNK
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rtf.middleware.ports.network import Network
    from rtf.middleware.wire.incoming_message import IncomingMessage

LARGE = 3 * CHUNK
#: Bytes in front of large blocks, which then lie at all distances from the beginning of a page.
FRONTS = range(0, 4096, 31)
np = pytest.importorskip("numpy")


@pytest.fixture
def ends() -> Iterator[tuple[Stream, Callable[[bytes], None]]]:
    """A stream, and a function that sends bytes to it."""
    near, far = socket.socketpair()
    senders: list[threading.Thread] = []

    def send(data: bytes) -> None:
        senders.append(threading.Thread(target=far.sendall, args=(data,)))
        senders[-1].start()

    stream = Stream(near)
    yield stream, send
    for sender in senders:
        sender.join()
    stream.close()
    far.close()


class ClosedMeanwhile(socket.socket):
    """A socket that another thread closes just before its options are set."""

    def setsockopt(self, *option: object) -> None:  # type: ignore[override]
        """Close it, and set the option then."""
        self.close()
        super().setsockopt(*option)  # type: ignore[call-overload]


def test_the_timeout_of_a_stream_that_is_closed_meanwhile():
    """Setting it is no error: the next read or write says that the stream is closed."""
    near, far = socket.socketpair()
    with far:
        stream = Stream(ClosedMeanwhile(fileno=near.detach()))
        stream.limit_waiting(1.0)
        with pytest.raises(StreamClosedError):
            stream.send(b"hello")


class TestKeeping:
    """Messages that are kept do not change."""

    def test_a_large_piece_that_is_kept(self, ends: tuple[Stream, Callable[[bytes], None]]):
        """A kept message, or a part of it, is not overwritten by the next one."""
        stream, send = ends
        send(b"".join(bytes([number]) * LARGE for number in range(4)))
        kept = stream.run(stream.take(LARGE))
        part = stream.run(stream.take(LARGE))[LARGE - 5 :]
        numbers = np.frombuffer(stream.run(stream.take(LARGE)), np.uint8)
        stream.run(stream.take(LARGE))
        assert kept == bytes(LARGE)
        assert part == b"\1" * 5
        assert (numbers == 2).all()

    def test_a_large_piece_without_a_reference(self, ends: tuple[Stream, Callable[[bytes], None]]):
        """The memory of a message that is not kept is used for the next one."""
        stream, send = ends
        send(bytes(3 * LARGE))
        first = stream.run(stream.take(LARGE)).obj
        place = id(first)
        del first
        assert id(stream.run(stream.take(LARGE)).obj) == place
        assert id(stream.run(stream.take(LARGE)).obj) == place

    def test_small_pieces_behind_a_large_one_that_is_kept(self, ends: tuple[Stream, Callable[[bytes], None]]):
        """Small messages after a large one that is kept are received into other memory."""
        stream, send = ends
        send(b"a" * LARGE)
        kept = stream.run(stream.take(LARGE))
        send(b"b" * LARGE)
        for _ in range(LARGE // 1000):
            assert stream.run(stream.take(1000)) == b"b" * 1000
        assert kept == b"a" * LARGE

    def test_a_huge_piece_is_not_kept(self, ends: tuple[Stream, Callable[[bytes], None]]):
        """The memory of a huge message is freed with the next one."""
        stream, send = ends
        huge = 64 << 20
        send(bytes(huge))
        assert len(stream.run(stream.take(huge))) == huge
        send(b"b")
        assert stream.run(stream.take(1)) == b"b"
        assert len(stream.memory) < 1 << 20

    def test_the_end_within_a_large_piece(self, ends: tuple[Stream, Callable[[bytes], None]]):
        """The end of the stream within a large message raises StreamClosedError."""
        stream, send = ends
        send(bytes(1000))
        stream.run(stream.take(1000 - 10))
        stream.wake()
        with pytest.raises(StreamClosedError):
            stream.run(stream.take(2 * LARGE))

    def test_large_blocks_wherever_they_lie(self):
        """Large blocks arrive unchanged, wherever they lie in memory."""
        near, far = socket.socketpair()
        stream, reader = Stream(near), Stream(far)
        one, two = (bytes([number]) * LARGE for number in range(2))
        one_at, two_at = (np.frombuffer(block, np.uint8).ctypes.data for block in (one, two))
        between = b"y" * ((two_at - one_at - LARGE) % 4096)  # so that both lie alike
        sender = threading.Thread(target=lambda: [stream.send(b"x" * front, one, between, two) for front in FRONTS])
        sender.start()
        arrived = [bytes(reader.run(reader.take(front + 2 * LARGE + len(between)))) for front in FRONTS]
        sender.join()
        stream.close()
        reader.close()
        rest = one + between + two
        assert all(heard == b"x" * front + rest for heard, front in zip(arrived, FRONTS, strict=True))

    @pytest.mark.parametrize("carrier", ["tcp", "fast_tcp", "unix_stream", "unix_stream+ack"])
    def test_images_that_a_reader_keeps(self, network: Network, carrier: str):
        """Images that a reader keeps do not change with later messages."""
        kept: list[Image] = []

        def keep(delivery: IncomingMessage) -> None:
            if len(kept) % 3 == 2:  # between them something that is not kept
                delivery.read()
            kept.append(delivery.read(IMAGE))

        with Port("/reader", keep, network=network) as reader, Port("/writer", network=network) as writer:
            writer.add_output(reader.contact, carrier)
            for number in range(8):
                writer.write(Image(np.full((240, 320 + number, 3), number, np.uint8)))
            eventually(lambda: len(kept) == 8, "images are missing")
        assert [(image.pixels == number).all() for number, image in enumerate(kept)] == [True] * 8

    @pytest.mark.parametrize("carrier", ["tcp", "unix_stream"])
    def test_bottles_of_all_sizes(self, network: Network, carrier: str):
        """Small and large ones in any order arrive as they were sent."""
        sizes = [10, LARGE, 5000, CHUNK - 50, CHUNK + 50, 3, 2 * LARGE, LARGE, 8192, 4096, 4095, 0]
        sent = [Bottle([bytes([number]) * size]) for number, size in enumerate(sizes)]
        heard: list[Bottle] = []
        with (
            Port("/reader", lambda delivery: heard.append(delivery.read()), network=network) as reader,
            Port("/writer", network=network) as writer,
        ):
            writer.add_output(reader.contact, carrier)
            for bottle in sent:
                writer.write(bottle)
            eventually(lambda: len(heard) == len(sent), "bottles are missing")
        assert heard == sent
