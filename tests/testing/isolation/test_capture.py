"""Captured output: it is passed on in lines and limited, and each omitted byte is counted."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.testing.isolation import capture
from rtf.testing.isolation.capture import HEAD_LIMIT, TAIL_LIMIT, Capture, Tail, boundary


class Sink:
    """Keeps the pieces that a capture passes on."""

    def __init__(self, **options: float) -> None:
        self.pieces: list[tuple[str, str, int]] = []
        self.capture = Capture(lambda *piece: self.pieces.append(piece), **options)

    def text(self, stream: str = "stdout"):
        """Return all text of a stream."""
        return "".join(text for name, text, _ in self.pieces if name == stream)

    @property
    def omitted(self):
        """The omitted bytes of all streams."""
        return sum(omitted for _, _, omitted in self.pieces)


class TestCapture:
    """A capture, which keeps beginning and end."""

    def test_whole_lines_go_out_at_once(self):
        """A line is passed on when it is complete, the rest at the end."""
        sink = Sink()
        sink.capture.feed("stdout", b"one\ntw")
        assert sink.pieces == [("stdout", "one\n", 0)]
        sink.capture.feed("stdout", b"o\nthree")
        sink.capture.close()
        assert [text for _, text, _ in sink.pieces] == ["one\n", "two\n", "three"]

    def test_streams_do_not_mix(self):
        """A line of one stream is not split by output of the other."""
        sink = Sink()
        sink.capture.feed("stdout", b"on")
        sink.capture.feed("stderr", b"bad\n")
        sink.capture.feed("stdout", b"e\n")
        assert sink.pieces == [("stderr", "bad\n", 0), ("stdout", "one\n", 0)]

    def test_middle_of_a_flood_is_counted(self):
        """Of a million lines the first and last are kept, and the bytes between are counted."""
        sink = Sink()
        line = b"%07d\n"
        total = 0
        for start in range(0, 1_000_000, 1000):
            data = b"".join(line % number for number in range(start, start + 1000))
            total += len(data)
            sink.capture.feed("stdout", data)
        sink.capture.close()
        text = sink.text()
        assert text.startswith("0000000\n0000001\n")
        assert text.endswith("0999999\n")
        assert len(text) <= HEAD_LIMIT + TAIL_LIMIT
        assert len(text) + sink.omitted == total

    def test_text_after_a_gap_begins_with_a_line(self):
        """Text after omitted bytes begins with a whole line."""
        sink = Sink()
        sink.capture.feed("stdout", b"x" * (HEAD_LIMIT - 1) + b"\n")
        for number in range(100_000):
            sink.capture.feed("stdout", b"line %d\n" % number)
        sink.capture.close()
        assert sink.pieces[-1][1].startswith("line ")

    def test_room_comes_back_with_time(self, monkeypatch: pytest.MonkeyPatch):
        """With a refill, output after a pause is passed on again."""
        now = 0.0
        monkeypatch.setattr(capture.clock, "monotonic", lambda: now)
        sink = Sink(refill=1024.0)
        sink.capture.feed("stdout", b"x\n" * HEAD_LIMIT)
        now = 100.0
        sink.capture.feed("stdout", b"y\n")
        assert sink.text().endswith("y\n")
        sink.capture.feed("stdout", b"z\n")
        assert sink.text().endswith("y\nz\n")
        sink.capture.close()
        assert len(sink.text()) + sink.omitted == 2 * HEAD_LIMIT + 4

    def test_long_line_goes_out_in_pieces_between_characters(self):
        """A long line is passed on in pieces, without splitting a character."""
        sink = Sink()
        data = "aäöü€😀".encode() * 12_000
        for start in range(0, len(data), 7):
            sink.capture.feed("stdout", data[start : start + 7])
        sink.capture.close()
        assert len(sink.pieces) > 1
        assert sink.text() == data.decode()

    @given(st.lists(st.binary(max_size=200_000), max_size=8))
    def test_no_byte_is_lost_uncounted(self, chunks: list[bytes]):
        """Passed on and omitted bytes add up to the input."""
        handed = 0

        def take(_stream: str, text: str, omitted: int) -> None:
            nonlocal handed
            handed += omitted + len(text)

        bounded = Capture(take)
        chunks = [bytes(byte & 0x7F for byte in chunk) for chunk in chunks]
        for chunk in chunks:
            bounded.feed("stdout", chunk)
        bounded.close()
        assert handed == sum(map(len, chunks))


class TestTail:
    """The last lines of the output."""

    def test_keeps_the_last_lines(self):
        """The tail has the last lines, an unfinished one included."""
        tail = Tail(lines=2)
        tail.feed("stdout", b"1\n2\n3\n")
        tail.feed("stderr", b"unfin")
        tail.feed("stderr", b"ished")
        assert tail.text() == "2\n3\nunfinished"

    def test_line_in_pieces_is_one(self):
        """A line that arrives in pieces is one line."""
        tail = Tail()
        for byte in b"hello\r\nworld\n":
            tail.feed("stdout", bytes([byte]))
        assert tail.text() == "hello\nworld"

    def test_memory_is_bounded(self):
        """Of a long line only the beginning is kept."""
        tail = Tail(width=100)
        for _ in range(100):
            tail.feed("stdout", b"x" * 10_000)
        assert tail.text() == "x" * 100


@given(st.text(), st.integers(min_value=0))
def test_boundary_never_cuts_a_character(text: str, at: int):
    """Both sides of the cut can be decoded, and it is at most three bytes early."""
    data = text.encode()
    at = min(at, len(data))
    cut = boundary(data, at)
    assert at - 3 <= cut <= at
    assert data[:cut].decode() + data[cut:].decode() == text
