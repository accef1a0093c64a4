"""What a recording consists of, whatever its format: samples, streams, and the two interfaces of formats."""

from __future__ import annotations

from abc import ABC, abstractmethod
from math import isfinite
from typing import TYPE_CHECKING, ClassVar, NamedTuple, Self, TypeAlias

from rtf.middleware.types.codecs import BOTTLE, RAW
from rtf.middleware.types.image import IMAGE, Image, is_image
from rtf.middleware.types.stamp import Stamp

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator
    from types import TracebackType

    from rtf.bottle import Bottle
    from rtf.middleware.wire.incoming_message import IncomingMessage

Contents: TypeAlias = "Bottle | Image"


class Sample(NamedTuple):
    """A recorded message.

    ``source`` is the port that sent it, ``time`` when it arrived, in seconds by the clock of the recorder, and
    ``stamp`` what its sender wrote on it; a count of -1 means nothing. Where a recording has the sender's times only,
    ``time`` is the sender's.
    """

    source: str
    time: float
    stamp: Stamp
    value: Contents


class Stream(NamedTuple):
    """What one port sent: its name, the folder or file that it is in, and whether it sent images."""

    source: str
    place: str
    images: bool


class Store(ABC):
    """A recording that is being written, by one thread. All methods raise RecordingError if that is not possible."""

    #: Seconds between two calls of ``flush``.
    period: ClassVar[float]

    @abstractmethod
    def add(self, sample: Sample) -> None:
        """Write a message."""

    @abstractmethod
    def note(self, time: float, source: str, *, connected: bool) -> None:
        """Write that a source was connected, or is no longer."""

    @abstractmethod
    def flush(self) -> None:
        """Give what was written to the system, so that it survives the end of this process."""

    @abstractmethod
    def close(self) -> None:
        """Finish the recording. A second call has no effect."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class Recording(ABC):
    """A recording that is read. ``notes`` says what was left out, such as a line that is cut off at the end."""

    notes: list[str]

    @property
    @abstractmethod
    def streams(self) -> tuple[Stream, ...]:
        """The streams, sorted by name."""

    def leave_out(self, what: str) -> None:
        """Note once that something was left out."""
        if what not in self.notes:
            self.notes.append(what)

    @abstractmethod
    def samples(self, sources: Collection[str]) -> Iterator[Sample]:
        """Yield the messages of some sources in the order of their times. Raises RecordingError."""


def sample_of(message: IncomingMessage, time: float) -> Sample:
    """Return a received message as a sample. Raises an RtfError if it is neither an image nor a bottle."""
    stamp = Stamp.parse(message.envelope)
    if stamp is None or not isfinite(stamp.time):
        stamp = Stamp()
    data = message.read(RAW)
    value = IMAGE.adopt(data, message.dialect) if is_image(data) else message.read(BOTTLE)
    return Sample(message.sender, time, stamp, value)
