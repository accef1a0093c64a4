"""The bounded output of a process: its beginning and its end are kept, the middle is counted.

Used in the thread that reads the process, one object a process.
"""

from __future__ import annotations

import codecs
from collections import deque
from typing import TYPE_CHECKING

from rtf import clock

if TYPE_CHECKING:
    from collections.abc import Callable

#: Bytes of each stream that are handed on as they come, and bytes that are held back once these are used up.
HEAD_LIMIT = 256 * 1024
TAIL_LIMIT = 64 * 1024
_LINE_LIMIT = 64 * 1024
_CHARACTER = 4  # bytes of the longest one in UTF-8


class _Stream:
    """One stream: the bytes that have not been handed on yet, and the room for those that are handed on at once.

    Once there is no room for a line the stream is ``flooded``: only the last of it is kept, for its end.
    """

    def __init__(self) -> None:
        self.pending = bytearray()
        self.room = float(HEAD_LIMIT)
        self.filled = clock.monotonic()
        self.flooded = False
        self.omitted = 0

    def refill(self, rate: float) -> None:
        """Let the room grow again with time."""
        now = clock.monotonic()
        self.room = min(HEAD_LIMIT, self.room + rate * (now - self.filled))
        self.filled = now

    def take_lines(self) -> bytes:
        """Take the bytes to hand on at once: whole lines, or a piece of a very long one, as far as there is room."""
        cut = self.pending.rfind(b"\n") + 1
        if len(self.pending) - cut > _LINE_LIMIT:
            cut = boundary(self.pending, len(self.pending))
        if cut > self.room:
            cut = boundary(self.pending, max(0, int(self.room)))
            self.flooded = True
        return self._take(cut)

    def trim(self) -> None:
        """Drop, and count, the bytes that can be neither beginning nor end."""
        surplus = len(self.pending) - TAIL_LIMIT
        if surplus > TAIL_LIMIT:  # small ones are cut when the end is handed on
            del self.pending[:surplus]
            self.omitted += surplus

    def take_rest(self) -> tuple[bytes, int]:
        """Return all that is left, from the beginning of a line after a gap, and the number of bytes left out."""
        start = max(0, len(self.pending) - TAIL_LIMIT) if self.flooded else 0
        if self.omitted or start:
            line = self.pending.find(b"\n", start) + 1
            start = line if 0 < line < len(self.pending) else boundary(self.pending, start)
        omitted = self.omitted + start
        del self.pending[:start]
        self.flooded, self.omitted = False, 0
        return self._take(len(self.pending)), omitted

    def _take(self, size: int) -> bytes:
        data = bytes(self.pending[:size])
        del self.pending[:size]
        self.room -= size
        return data


class Capture:
    """Takes bytes of named streams and hands on text: ``emit(stream, text, omitted bytes before it)``.

    ``refill`` is the rate in bytes per second at which room comes back, for a process that lives for hours; without it
    only the beginning and the end of a stream are kept, whatever lies between.
    """

    def __init__(self, emit: Callable[[str, str, int], None], *, refill: float = 0.0) -> None:
        self._emit = emit
        self._refill = refill
        self._streams: dict[str, _Stream] = {}

    def feed(self, name: str, data: bytes) -> None:
        """Take bytes that were read from a stream. Whole lines are handed on at once, or a very long one in pieces."""
        stream = self._streams.get(name)
        if stream is None:
            stream = self._streams[name] = _Stream()
        if self._refill:
            stream.refill(self._refill)
        stream.pending += data
        if not stream.flooded:
            self._hand_on(name, stream.take_lines(), 0)
        elif stream.room > TAIL_LIMIT:
            self._hand_on(name, *stream.take_rest())
        if stream.flooded:
            stream.trim()

    def close(self) -> None:
        """Hand on the bytes that were held back."""
        for name, stream in self._streams.items():
            self._hand_on(name, *stream.take_rest())
        self._streams.clear()

    def _hand_on(self, name: str, data: bytes, omitted: int) -> None:
        if data or omitted:
            self._emit(name, data.decode("utf-8", "backslashreplace"), omitted)


class Tail:
    """The last lines that a process wrote to any of its streams, for the report of its end."""

    def __init__(self, *, lines: int = 40, width: int = 2000) -> None:
        self._lines: deque[tuple[str, bytes]] = deque(maxlen=lines)
        self._width = width
        self._begun: dict[str, bytes] = {}

    def feed(self, stream: str, data: bytes) -> None:
        """Take bytes that were read from a stream; of a line longer than ``width`` bytes the beginning is kept."""
        *whole, rest = data.split(b"\n")
        for line in whole:
            self._lines.append((stream, (self._begun.pop(stream, b"") + line)[: self._width]))
        if rest:
            self._begun[stream] = (self._begun.get(stream, b"") + rest[: self._width])[: self._width]

    def lines(self, only: str = "") -> list[str]:
        """Return the lines, with the unfinished ones last; those of one stream with its name."""
        lines = [*self._lines, *self._begun.items()]
        return [line.decode("utf-8", "backslashreplace").rstrip("\r") for name, line in lines if only in ("", name)]

    def text(self) -> str:
        """Return the lines of all streams in one text."""
        return "\n".join(self.lines())


def boundary(data: bytes | bytearray, at: int) -> int:
    """Return the nearest place at or before ``at`` where text may be cut without cutting a UTF-8 character."""
    decoder = codecs.getincrementaldecoder("utf-8")("backslashreplace")
    decoder.decode(bytes(data[max(0, at - _CHARACTER) : at]))
    begun, _ = decoder.getstate()
    return at - len(begun)
