"""A protocol run on bytes that arrive in pieces, without sockets and threads."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, TypeVar

from rtf.middleware.wire.inbox import Inbox

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from rtf.middleware.wire.inbox import Steps
    from rtf.middleware.wire.protocol import Messages

    #: Where bytes are cut: at these places, or into pieces of one size.
    Cuts = frozenset[int] | int

T = TypeVar("T")


class End:
    """One end of a connection. ``pieces`` arrive in turn, each when the protocol waits; ``sent`` is what it sends."""

    def __init__(self, pieces: Sequence[bytes]) -> None:
        self.inbox = Inbox()
        self.sent = b""
        self._pieces = deque(pieces)

    @property
    def done(self) -> bool:
        """Whether everything has arrived and been read."""
        return not self.inbox.unread and not self._pieces

    def run(self, steps: Steps[T]) -> T:
        """Carry out a part of a protocol, and return its result."""
        try:
            while True:
                step = next(steps)
                if isinstance(step, int):
                    self._wait(step)
                else:
                    self.sent += step
        except StopIteration as end:
            return end.value

    def repeat(self, attempt: Callable[[], int]) -> None:
        """Call a function until it returns 0; else it returns what it waits for."""
        while size := attempt():
            self._wait(size)

    def receive(self, messages: Messages) -> Iterator[tuple[str, str, bytes]]:
        """Give each message, and a copy of its data."""
        for step in messages:
            if isinstance(step, int):
                self._wait(step)
            else:
                key, text, data = step
                yield key, text, bytes(data)

    def _wait(self, size: int) -> None:
        assert size > self.inbox.unread, "it waits for bytes that have arrived"
        assert self._pieces, f"it waits for {size} bytes, but all have arrived"
        piece = self._pieces.popleft()
        room = self.inbox.room(size)
        if len(piece) <= len(room):  # as a socket does it
            room[: len(piece)] = piece
            self.inbox.end += len(piece)
        else:
            self.inbox.feed(piece)


def cut(data: bytes, places: Cuts) -> list[bytes]:
    """Cut bytes at these places, or into pieces of one size."""
    inner = range(places, len(data), places) if isinstance(places, int) else sorted(places)
    ends = [*(place for place in inner if 0 < place < len(data)), len(data)]
    return [data[start:end] for start, end in zip([0, *ends], ends, strict=False)]
