"""What a process writes, bounded: its beginning and its end are kept, the middle is counted.

Used in the thread that reads the process, one object a process.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from rtf import clock

if TYPE_CHECKING:
    from collections.abc import Callable


#: Bytes of each stream that are handed on as they come, and bytes that are held back once these are used up.
HEAD_LIMIT = 256 * 1024
TAIL_LIMIT = 64 * 1024
_LINE_LIMIT = 64 * 1024


class _Stream:
    """One stream: text goes out as it comes while there is room; otherwise the last of it is held back."""

    def __init__(self, now: float) -> None:
        self.partial = b""
        self.room = float(HEAD_LIMIT)
        self.filled = now
        self.held: deque[bytes] = deque()
        self.held_size = 0
        self.omitted = 0

    def refill(self, rate: float) -> None:
        """Let the room grow again with time."""
        now = clock.monotonic()
        self.room = min(HEAD_LIMIT, self.room + rate * (now - self.filled))
        self.filled = now

    def hold(self, data: bytes) -> None:
        """Keep the last ``TAIL_LIMIT`` bytes of what is not handed on, and count the others."""
        if not data:
            return
        self.held.append(data)
        self.held_size += len(data)
        while self.held_size - len(self.held[0]) >= TAIL_LIMIT:
            dropped = len(self.held.popleft())
            self.held_size -= dropped
            self.omitted += dropped
        surplus = self.held_size - TAIL_LIMIT
        if surplus > TAIL_LIMIT:  # one big piece; small surpluses are cut when the text is handed on
            self.held[0] = self.held[0][surplus:]
            self.held_size -= surplus
            self.omitted += surplus

    def release(self) -> tuple[bytes, int]:
        """Give what was held, from the beginning of a line where there is one, and the number of bytes left out."""
        data = b"".join(self.held)
        omitted = self.omitted
        start = max(0, len(data) - TAIL_LIMIT)
        if omitted or start:
            line = data.find(b"\n", start) + 1
            start = line if 0 < line < len(data) else boundary(data, start)
        self.held.clear()
        self.held_size = self.omitted = 0
        return data[start:], omitted + start


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
        """Take what was read from a stream. Whole lines are handed on at once, or a very long one in pieces."""
        stream = self._streams.get(name)
        if stream is None:
            stream = self._streams[name] = _Stream(clock.monotonic())
        if self._refill:
            stream.refill(self._refill)
        if stream.held or stream.room < 1:
            stream.hold(data)
            if stream.room > TAIL_LIMIT:
                self._release(name, stream)
            return
        data = stream.partial + data
        cut = data.rfind(b"\n") + 1
        if len(data) - cut > _LINE_LIMIT:
            cut = boundary(data, len(data))
        room = int(stream.room)
        whole = data[:cut]
        if cut > room:
            cut = boundary(data, room)
            whole, rest = data[:cut], data[cut:]
            stream.partial = b""
            stream.room = 0
            stream.hold(rest)
        else:
            stream.partial = data[cut:]
            stream.room -= cut
        if whole:
            self._hand_on(name, whole, 0)

    def close(self) -> None:
        """Hand on what was held back."""
        for name, stream in self._streams.items():
            if stream.partial:
                self._hand_on(name, stream.partial, 0)
            if stream.held:
                self._release(name, stream)
        self._streams.clear()

    def _release(self, name: str, stream: _Stream) -> None:
        data, omitted = stream.release()
        stream.room -= len(data)
        self._hand_on(name, data, omitted)

    def _hand_on(self, name: str, data: bytes, omitted: int) -> None:
        self._emit(name, data.decode("utf-8", "backslashreplace"), omitted)


class Tail:
    """The last lines that a process wrote, of all its streams together, for the report of its end."""

    def __init__(self, *, lines: int = 40, width: int = 2000) -> None:
        self._lines: deque[bytes] = deque(maxlen=lines)
        self._width = width
        self._begun: dict[str, bytes] = {}

    def feed(self, stream: str, data: bytes) -> None:
        """Take what was read from a stream; of a line longer than ``width`` bytes the beginning is kept."""
        *whole, rest = data.split(b"\n")
        for line in whole:
            self._lines.append((self._begun.pop(stream, b"") + line)[: self._width])
        if rest:
            self._begun[stream] = (self._begun.get(stream, b"") + rest[: self._width])[: self._width]

    def text(self) -> str:
        """The lines, with those that have not been ended yet last."""
        lines = [*self._lines, *self._begun.values()]
        return "\n".join(line.decode("utf-8", "backslashreplace").rstrip("\r") for line in lines)


def boundary(data: bytes, at: int) -> int:
    """The nearest place at or before ``at`` where text may be cut without cutting a UTF-8 character."""
    start = at
    while start > 0 and at - start < 3 and start < len(data) and data[start] & 0xC0 == 0x80:  # noqa: PLR2004 - RFC 3629
        start -= 1
    if start == len(data) and start:
        return _complete(data)
    return start


def _complete(data: bytes) -> int:
    """How much of ``data`` is there without a character that has only begun at its end."""
    for back in range(1, min(4, len(data)) + 1):
        byte = data[-back]
        if byte & 0xC0 != 0x80:  # noqa: PLR2004 - anything but a continuation byte
            wanted = 1 if byte < 0xC0 else 2 if byte < 0xE0 else 3 if byte < 0xF0 else 4  # noqa: PLR2004 - RFC 3629
            return len(data) if back >= wanted else len(data) - back
    return len(data)
