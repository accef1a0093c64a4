"""What reporters that write a file need: a target that is whole or not there, a spool, and the events of each test.

A report must neither keep a long run in memory nor be lost with it. So what is known of a test leaves the memory when
the test has ended, for a temporary file without a name, and the report is put together from there.
"""

from __future__ import annotations

import json
import os
import re
import sys
import tempfile
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, BinaryIO

from rtf.testing.events import (
    Answered,
    Asked,
    Attached,
    Event,
    Measured,
    Message,
    OutputCaptured,
    ParametersResolved,
    PhaseStarted,
    SeriesRecorded,
    StackDumped,
    SubResultEnded,
    TestEnded,
    TestStarted,
    to_record,
)
from rtf.testing.report.text import joined

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

#: The events that tell of one attempt at a test, each with the id of the test.
OF_A_TEST = (
    TestStarted,
    PhaseStarted,
    ParametersResolved,
    Message,
    Measured,
    SeriesRecorded,
    SubResultEnded,
    Attached,
    Asked,
    Answered,
    OutputCaptured,
    StackDumped,
    TestEnded,
)


class Target:
    """Where a report goes. A file is written beside its place and moved there, so that nobody ever reads half of it.

    Without a path the report goes to standard output. A pipe or device is written to directly.
    """

    def __init__(self, path: Path | None) -> None:
        self.path = path

    @property
    def replaceable(self) -> bool:
        """Whether it can be written more than once: it is a file, or not there yet."""
        return self.path is not None and (self.path.is_file() or not self.path.exists())

    @property
    def folder(self) -> Path | None:
        """The folder of the file, where there is one and temporary files can be put."""
        return self.path.parent if self.path is not None and self.replaceable else None

    def check(self) -> None:
        """Raise OSError when the report could never be written. Makes the folder."""
        if self.path is None:
            return
        if self.path.is_dir():
            raise IsADirectoryError(f"cannot write a report to {self.path}: it is a folder")
        if self.replaceable:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            beside = self._beside(self.path)
            beside.touch()
            beside.unlink()
        elif not os.access(self.path, os.W_OK):
            raise PermissionError(f"cannot write a report to {self.path}")

    @contextmanager
    def writing(self, *, last: bool = True) -> Iterator[BinaryIO]:
        """A stream whose content is in place when the block is left in order; ``last`` puts it on the disk, too."""
        if self.path is None:
            yield sys.stdout.buffer
            sys.stdout.buffer.flush()
            return
        if not self.replaceable:
            with self.path.open("wb") as stream:
                yield stream
            return
        beside = self._beside(self.path)
        try:
            with beside.open("wb") as stream:
                yield stream
                if last:
                    stream.flush()
                    os.fsync(stream.fileno())
            beside.replace(self.path)
        except BaseException:
            with suppress(OSError):
                beside.unlink()
            raise

    @staticmethod
    def _beside(path: Path) -> Path:
        return path.with_name(f".{path.name}.{os.getpid()}.part")


class Spool:
    """Pieces of bytes by name, in a temporary file that vanishes with the process; the latest of a name counts."""

    def __init__(self, folder: Path | None) -> None:
        self._file = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115 - closed by close()
        self._places: dict[str, tuple[int, int]] = {}
        self._end = 0

    @property
    def size(self) -> int:
        """The bytes put in so far."""
        return self._end

    def put(self, name: str, data: bytes) -> None:
        """Keep a piece."""
        self._file.seek(self._end)
        self._file.write(data)
        self._places[name] = (self._end, len(data))
        self._end += len(data)

    def __contains__(self, name: str) -> bool:
        return name in self._places

    def get(self, name: str) -> bytes:
        """The piece of this name; KeyError where there is none."""
        start, length = self._places[name]
        self._file.seek(start)
        return self._file.read(length)

    def close(self) -> None:
        """Give the space back."""
        self._file.close()


@dataclass(slots=True)
class AttemptEvents:
    """The events of one attempt in order, its start and its end apart. One that never ended has no end."""

    started: TestStarted | None = None
    ended: TestEnded | None = None
    events: list[Event] = field(default_factory=list)


class TestEvents:
    """Collects the events of each test until its final end. Several tests may be running."""

    __test__ = False

    def __init__(self) -> None:
        self._open: dict[str, list[AttemptEvents]] = {}

    def take(self, event: Event) -> list[AttemptEvents] | None:
        """Take one of the events :data:`OF_A_TEST`; with the final end come all attempts, which are then forgotten."""
        test: str = event.test  # type: ignore[attr-defined]
        attempts = self._open.get(test)
        if attempts is None:
            attempts = self._open[test] = [AttemptEvents()]
        current = attempts[-1]
        if isinstance(event, TestStarted):
            if current.started is not None:  # the runner died and the run was resumed
                attempts.append(AttemptEvents(started=event))
            else:
                current.started = event
        elif isinstance(event, TestEnded):
            current.ended = event
            if event.final:
                return self._open.pop(test)
            attempts.append(AttemptEvents())
        else:
            current.events.append(event)
        return None

    def unfinished(self) -> dict[str, list[AttemptEvents]]:
        """The attempts of the tests that were begun and have not come to their final end."""
        begun = {test: [a for a in attempts if a.started or a.ended] for test, attempts in self._open.items()}
        return {test: attempts for test, attempts in begun.items() if attempts}


def members(event: Event, *without: str) -> dict[str, Any]:
    """The members of an event as a JSON-able object: its time, and what differs from the defaults."""
    return {name: value for name, value in to_record(event).items() if name not in ("event", "seq", *without)}


_encode = json.JSONEncoder(ensure_ascii=False, separators=(",", ":"), check_circular=False, allow_nan=False).encode
_SURROGATE = re.compile("[\ud800-\udbff][\udc00-\udfff]|[\ud800-\udfff]")


def to_json(record: object) -> bytes:
    """Write strict JSON in UTF-8: numbers that JSON lacks as words, as in the journal, lone surrogates written out."""
    try:
        text = _encode(record)
    except ValueError:
        text = _encode(_finite(record))
    try:
        return text.encode()
    except UnicodeEncodeError:
        return _SURROGATE.sub(_repaired, text).encode()


def _repaired(match: re.Match[str]) -> str:
    found = match.group()
    return joined(found) if len(found) > 1 else f"\\\\u{ord(found):04x}"


def _finite(value: object) -> object:
    if isinstance(value, float):
        if value != value:  # noqa: PLR0124 - the shortest way to say: not a number
            return "NaN"
        return value if abs(value) != float("inf") else "Infinity" if value > 0 else "-Infinity"
    if isinstance(value, dict):
        return {name: _finite(member) for name, member in value.items()}
    return [_finite(item) for item in value] if isinstance(value, list | tuple) else value
