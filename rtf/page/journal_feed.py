"""The journal as server-sent events: the growing file is cut into messages without parsing its lines.

A message is ``id: N`` with the number of lines so far, and a JSON array of the lines since the last one. All clients at
the same position get the same bytes. An incomplete last line is sent when it is complete. Only a sparse index of the
file is kept in memory, by which clients can reconnect at any position.
"""

from __future__ import annotations

import asyncio
import json
import os
from bisect import bisect_right
from collections import OrderedDict
from contextlib import contextmanager
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

#: The size of a message, and the distance of two entries of the index, in bytes. A longer line is a message of its own.
BATCH = 1 << 16
_BLOCK = 1 << 20
#: The number of messages that are cached for other clients.
_KEPT = 16


class Position(NamedTuple):
    """A position between two lines of the journal."""

    line: int = 0
    offset: int = 0


class Feed:
    """The feed of a journal. Not thread-safe; ``grow`` reads the file, all other methods rely on its last call.

    ``over``: nothing will be appended. ``closing``: streams end when all lines are sent. ``first_follower`` is called
    when the first client connects.
    """

    def __init__(self, path: Path, first_follower: Callable[[], None] = lambda: None) -> None:
        self.first_follower = first_follower
        self._path = path
        self._descriptor = -1
        self._scanned = 0
        self._index = [Position()]
        self._messages: OrderedDict[Position, tuple[bytes, Position]] = OrderedDict()
        self._changed = asyncio.Event()
        self.end = Position()
        self.over = False
        self.closing = False
        self.followers = 0

    def grow(self) -> bool:
        """Index appended lines; return whether there are new ones."""
        before = self.end
        while block := self._read(self._scanned, _BLOCK):
            self._take(block)
        return self.end != before

    def _take(self, block: bytes) -> None:
        """Index the lines that end in a block."""
        start = 0
        while (cut := _end_of_batch(block, start)) > start:
            self.end = Position(self.end.line + block.count(b"\n", start, cut), self._scanned + cut)
            if self.end.offset - self._index[-1].offset >= BATCH:
                self._index.append(self.end)
            start = cut
        self._scanned += len(block)

    def _read(self, offset: int, size: int) -> bytes:
        if self._descriptor < 0:
            try:
                self._descriptor = os.open(self._path, os.O_RDONLY | os.O_CLOEXEC)
            except FileNotFoundError:  # the run has not begun
                return b""
        return os.pread(self._descriptor, size, offset)

    # Reading -----------------------------------------------------------------------------------------------------

    def position(self, line: int) -> Position:
        """Return the position after a number of lines, at most the end of the journal."""
        if line >= self.end.line:
            return self.end
        line = max(0, line)
        entry = bisect_right(self._index, line, key=lambda position: position.line) - 1
        found, following = self._index[entry], [*self._index[entry + 1 : entry + 2], self.end][0]
        lines = self._read(found.offset, following.offset - found.offset)
        cut = 0
        for _ in range(line - found.line):
            cut = lines.index(b"\n", cut) + 1
        return Position(line, found.offset + cut)

    def read(self, position: Position) -> tuple[bytes, Position]:
        """Return the message that begins at a position before the end, and the position after it."""
        known = self._messages.get(position)
        if known is None:
            lines = self._lines_from(position.offset)
            after = Position(position.line + lines.count(b"\n"), position.offset + len(lines))
            known = self._messages[position] = (message(lines, after.line), after)
            if len(self._messages) > _KEPT:
                self._messages.popitem(last=False)
        return known

    def _lines_from(self, offset: int) -> bytes:
        """Return the complete lines of a message, or a single longer line."""
        lines = self._read(offset, min(BATCH, self.end.offset - offset))
        while not (cut := _end_of_batch(lines, 0)):
            block = self._read(offset + len(lines), _BLOCK)
            if not block:
                raise EOFError(f"{self._path} has become shorter")
            lines += block
        return lines[:cut]

    # Following -----------------------------------------------------------------------------------------------------

    def announce(self) -> None:
        """Wake all waiting streams: there are new lines, or the run is over."""
        self._changed.set()
        self._changed = asyncio.Event()

    @contextmanager
    def followed(self) -> Iterator[None]:
        """Count a client that follows the journal within the block."""
        self.followers += 1
        if self.followers == 1:
            self.first_follower()
        try:
            yield
        finally:
            self.followers -= 1

    def close_streams(self) -> None:
        """End all streams as soon as they have sent all lines."""
        self.closing = True
        self.announce()

    async def change(self) -> None:
        """Wait for the next announcement."""
        await self._changed.wait()


def _end_of_batch(block: bytes, start: int) -> int:
    """Return the end of the lines of one index step; 0 if no line ends."""
    return block.rfind(b"\n", start, start + BATCH) + 1 or block.find(b"\n", start + BATCH) + 1


def message(lines: bytes, count: int) -> bytes:
    """Return complete lines of a journal as a message, after which ``count`` lines have been sent."""
    records = lines[:-1]
    if b"\r" in records or records.count(b"}\n{") != records.count(b"\n") or records[:1] + records[-1:] != b"{}":
        records = b"\n".join(_record(line) for line in records.split(b"\n"))  # not written by the runner
    return b"id: %d\ndata: [%s]\n\n" % (count, records.replace(b"\n", b","))


def _record(line: bytes) -> bytes:
    """Return a line, or an empty object for a damaged one, which every reader skips."""
    try:
        record = json.loads(line)
    except (ValueError, RecursionError):
        record = None
    return json.dumps(record).encode() if isinstance(record, dict) else b"{}"
