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
from pathlib import Path
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
from rtf.testing.reporting import Reporter

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from rtf.testing.results import RunResult, TestResult

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

    Through a link the file is written that the link leads to. Without a path, or with ``-``, the report goes to
    standard output. Standard streams, pipes and devices are written to directly, and once.
    """

    def __init__(self, path: Path | None) -> None:
        self.path = None if path is None or str(path) == "-" else path
        self._descriptor = _STDOUT if self.path is None else _descriptor_of(self.path)
        if self.path is not None and self._descriptor is None:
            self.path = Path(os.path.realpath(self.path))

    @property
    def replaceable(self) -> bool:
        """Whether it can be written more than once: it is a file, or not there yet."""
        if self.path is None or self._descriptor is not None:
            return False
        return self.path.is_file() or not self.path.exists()

    @property
    def folder(self) -> Path | None:
        """The folder of the file, where there is one and temporary files can be put."""
        return self.path.parent if self.path is not None and self.replaceable else None

    def check(self) -> None:
        """Raise OSError when the report could never be written. Makes the folder."""
        if self.path is None or self._descriptor is not None:
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
            with self.open() as stream:
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

    def open(self) -> BinaryIO:
        """A stream to the place itself, for what is written while the run goes on."""
        if self.path is None or self._descriptor is not None:
            sys.stdout.flush()
            return os.fdopen(os.dup(_STDOUT if self._descriptor is None else self._descriptor), "wb")
        return self.path.open("wb")

    @staticmethod
    def _beside(path: Path) -> Path:
        return path.with_name(f".{path.name}.{os.getpid()}.part")


_STDOUT = 1
_STREAMS = {"/dev/stdout": 1, "/dev/stderr": 2}


def _descriptor_of(path: Path) -> int | None:
    """The open file of this process that a path such as ``/dev/stdout`` or ``/dev/fd/5`` stands for."""
    name = os.path.normpath(path)
    if name in _STREAMS:
        return _STREAMS[name]
    found = re.fullmatch(r"/(?:dev|proc/self)/fd/(\d+)", name)
    return int(found[1]) if found else None


class Spool:
    """Pieces of bytes by name, in a temporary file that vanishes with the process; the latest of a name counts."""

    def __init__(self, folder: Path | None) -> None:
        self._file = tempfile.TemporaryFile(dir=folder, buffering=0)  # noqa: SIM115 - closed by close()
        self._places: dict[str, tuple[int, int]] = {}
        self._room: dict[str, int] = {}  # of pieces that are put more often
        self._end = 0

    def put(self, name: str, data: bytes, *, again: bool = False) -> None:
        """Keep a piece. One that will be put ``again`` gets room to grow, so that the file does not grow each time."""
        start = self._end
        room = self._room.get(name, 0)
        if again and len(data) <= room:
            start = self._places[name][0]
        elif again:
            self._room[name] = room = 2 * len(data)
            self._end += room
        else:
            self._room.pop(name, None)
            self._end += len(data)
        view, place = memoryview(data), start
        while view:
            written = os.pwrite(self._file.fileno(), view, place)
            view, place = view[written:], place + written
        self._places[name] = (start, len(data))

    def __contains__(self, name: str) -> bool:
        return name in self._places

    def get(self, name: str) -> bytes:
        """The piece of this name; KeyError where there is none."""
        start, length = self._places[name]
        return os.pread(self._file.fileno(), length, start)

    def copy(self, names: Iterable[str], stream: BinaryIO, *, skip: int = 0) -> None:
        """Write pieces one after the other, the first without its first ``skip`` bytes.

        Pieces that were put one after the other are read at one go.
        """
        begin = end = 0
        for name in names:
            start, length = self._places[name]
            if start != end or not end:
                self._copy(begin, end, stream)
                begin, skip = start + skip, 0
            end = start + length
        self._copy(begin, end, stream)

    def _copy(self, begin: int, end: int, stream: BinaryIO) -> None:
        while begin < end:
            data = os.pread(self._file.fileno(), min(end - begin, _CHUNK), begin)
            stream.write(data)
            begin += len(data)

    def close(self) -> None:
        """Give the space back."""
        self._file.close()


_CHUNK = 1 << 20


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


class FileReporter(Reporter):
    """Base of reporters that write a document with an entry for each test.

    The document is complete at any time: ``update`` writes it anew while the run goes on, with an entry for each test
    that is planned. What is known of a test that has ended is kept in a spool, as it will stand in the document.
    """

    _spool: Spool | None = None

    def open(self) -> None:
        self.target = Target(self.options.target)
        self.target.check()
        self._spool = Spool(self.target.folder)
        self._tests = TestEvents()

    def handle(self, event: Event, results: RunResult) -> None:
        if type(event) in OF_A_TEST and event.test:  # type: ignore[attr-defined]
            attempts = self._tests.take(event)
            result = results.tests.get(event.test)  # type: ignore[attr-defined]
            if attempts is not None and result is not None and self._spool is not None:
                self._spool.put(result.id, self.entry(result, attempts, results))

    def update(self, results: RunResult) -> None:
        if self._spool is not None and self.target.replaceable:
            self._write(self._spool, results, last=False)

    def close(self, results: RunResult) -> None:
        spool, self._spool = self._spool, None
        if spool is None:
            return
        try:
            self._write(spool, results, last=True)
        finally:
            spool.close()

    def _write(self, spool: Spool, results: RunResult, *, last: bool) -> None:
        for test, attempts in self._tests.unfinished().items():
            result = results.tests.get(test)
            if result is not None:
                spool.put(test, self.entry(result, attempts, results), again=True)
        for test, result in results.tests.items():
            if test not in spool:
                spool.put(test, self.entry(result, [], results))
        with self.target.writing(last=last) as stream:
            self.document(stream, spool, results)

    def entry(self, result: TestResult, attempts: list[AttemptEvents], results: RunResult) -> bytes:
        """Make the entry of a test from its attempts; of one that has not begun there are none."""
        raise NotImplementedError

    def document(self, stream: BinaryIO, spool: Spool, results: RunResult) -> None:
        """Write the document. The spool has the entries of all tests."""
        raise NotImplementedError


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
