"""Parts of reporters that write a file: a target that is complete or absent, and the entry of each test.

A report must neither keep a long run in memory nor be lost with it. So the entry of a test that has ended leaves the
memory for a temporary file without a name, from which the report is written at each update; to make it anew from the
journal would take twenty times as long (``docs/decisions/0032-reports-are-put-together-from-entries.md``).
"""

from __future__ import annotations

import json
import math
import os
import re
import sys
import tempfile
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from rtf.testing.events import (
    KINDS,
    Event,
    FixtureIncident,
    Message,
    Progressed,
    SeriesSampled,
    TestEnded,
    TestPlanned,
    TestRenamed,
    TestStarted,
    to_record,
)
from rtf.testing.report.text import without_surrogates
from rtf.testing.reporting import Reporter
from rtf.testing.verdict import Severity

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from rtf.testing.results import RunResult, TestResult

#: The events of one attempt at a test.
_OF_AN_ATTEMPT = {cls for cls in KINDS.values() if "test" in cls.__struct_fields__}
_OF_AN_ATTEMPT -= {TestPlanned, TestRenamed, FixtureIncident, Progressed, SeriesSampled}

_STDOUT = 1
_STREAMS = {"/dev/stdout": 1, "/dev/stderr": 2}


class Target:
    """The place of a report. A file is written beside its place and moved there, so that no reader sees a partial file.

    Through a link the file is written that the link leads to. Without a path, or with ``-``, the report goes to
    standard output. Standard streams, pipes and devices are written to directly, and once.
    """

    def __init__(self, path: Path | None) -> None:
        named = None if path is None or str(path) == "-" else path
        self._descriptor = _STDOUT if named is None else _descriptor_of(named)
        self.path = Path(os.path.realpath(named)) if named is not None and self._descriptor is None else None

    @property
    def replaceable(self) -> bool:
        """Whether the target can be written more than once: it is a file, or does not exist yet."""
        return self.path is not None and (self.path.is_file() or not self.path.exists())

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
        """Open a stream whose content is in place when the block ends in order; ``last`` puts it on the disk, too."""
        if self.path is None or not self.replaceable:
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
        if self.path is not None:
            return self.path.open("wb")
        sys.stdout.flush()
        return os.fdopen(os.dup(self._descriptor or _STDOUT), "wb")

    @staticmethod
    def _beside(path: Path) -> Path:
        return path.with_name(f".{path.name}.{os.getpid()}.part")


def _descriptor_of(path: Path) -> int | None:
    """Return the open file of this process that a path such as ``/dev/stdout`` or ``/dev/fd/5`` stands for."""
    name = os.path.normpath(path)
    found = re.fullmatch(r"/(?:dev|proc/self)/fd/(\d+)", name)
    return int(found[1]) if found else _STREAMS.get(name)


@dataclass(slots=True)
class AttemptEvents:
    """The events of one attempt in order, its start and its end apart. One that never ended has no end."""

    started: TestStarted | None = None
    ended: TestEnded | None = None
    events: list[Event] = field(default_factory=list)

    @property
    def problems(self) -> list[Message]:
        """Return the failures and errors of the attempt."""
        said = [event for event in self.events if isinstance(event, Message)]
        return [message for message in said if message.severity in (Severity.FAILURE, Severity.ERROR)]


class TestEvents:
    """Collects the events of each test until its final end. Several tests may be running."""

    __test__ = False

    def __init__(self) -> None:
        self._open: dict[str, list[AttemptEvents]] = {}

    def take(self, event: Event) -> list[AttemptEvents] | None:
        """Take any event; a test's final end returns all its attempts, which are then forgotten."""
        test: str = getattr(event, "test", "") if type(event) in _OF_AN_ATTEMPT else ""
        if not test:
            return None
        attempts = self._open.setdefault(test, [])
        if not attempts or attempts[-1].ended is not None or (isinstance(event, TestStarted) and attempts[-1].started):
            attempts.append(AttemptEvents())
        if isinstance(event, TestStarted):
            attempts[-1].started = event
        elif isinstance(event, TestEnded):
            attempts[-1].ended = event
            return self._open.pop(test) if event.final else None
        else:
            attempts[-1].events.append(event)
        return None

    def unfinished(self) -> dict[str, list[AttemptEvents]]:
        """Return the attempts of the tests that were begun and have not come to their final end."""
        begun = {test: [a for a in attempts if a.started or a.ended] for test, attempts in self._open.items()}
        return {test: attempts for test, attempts in begun.items() if attempts}


class FileReporter(Reporter):
    """Base of reporters that write a document with an entry for each test.

    The document is complete at any time: ``update`` writes it anew while the run goes on, with an entry for each test
    that is planned.
    """

    def open(self) -> None:
        self.target = Target(self.options.target)
        self.target.check()
        folder = self.target.path.parent if self.target.path is not None and self.target.replaceable else None
        self._spool: BinaryIO = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115 - closed by close()
        self._places: dict[str, tuple[int, int]] = {}
        self._end = 0
        self._tests = TestEvents()
        self._unfinished: dict[str, bytes] = {}

    def handle(self, event: Event, results: RunResult) -> None:
        if isinstance(event, TestPlanned):
            attempts: list[AttemptEvents] | None = None if event.test in self._places else []
        else:
            attempts = self._tests.take(event)
        if attempts is not None:
            result = results.tests.get(event.test)  # type: ignore[attr-defined]
            if result is not None:
                self.keep(result.id, self.entry(result, attempts, results))

    def update(self, results: RunResult) -> None:
        if self.target.replaceable:
            self._write(results, last=False)

    def close(self, results: RunResult) -> None:
        with self._spool:
            self._write(results, last=True)

    def _write(self, results: RunResult, *, last: bool) -> None:
        begun = {test: attempts for test, attempts in self._tests.unfinished().items() if test in results.tests}
        self._unfinished = {test: self.entry(results.tests[test], begun[test], results) for test in begun}
        with self.target.writing(last=last) as stream:
            self.document(stream, results)

    def keep(self, name: str, data: bytes) -> None:
        """Store some bytes under a name, in place of the earlier ones."""
        self._places[name] = self._end, len(data)
        self._end += self._spool.write(data)

    def kept(self, name: str) -> bytes:
        """Return the bytes that were stored under this name; empty if there are none."""
        start, length = self._places.get(name, (0, 0))
        self._spool.flush()
        return os.pread(self._spool.fileno(), length, start)

    def entries(self, tests: Iterable[str]) -> Iterator[bytes]:
        """Yield the entries of these tests, one after the other."""
        for test in tests:
            yield self._unfinished[test] if test in self._unfinished else self.kept(test)

    def entry(self, result: TestResult, attempts: list[AttemptEvents], results: RunResult) -> bytes:
        """Return the entry of a test, made from its attempts; a test that has not begun has none."""
        raise NotImplementedError

    def document(self, stream: BinaryIO, results: RunResult) -> None:
        """Write the document, with the ``entries`` of all tests."""
        raise NotImplementedError


def members(event: Event, *without: str) -> dict[str, Any]:
    """Return the members of an event as a JSON-able object: its time, and what differs from the defaults."""
    return {name: value for name, value in to_record(event).items() if name not in ("event", "seq", *without)}


_encode = json.JSONEncoder(ensure_ascii=False, separators=(",", ":"), check_circular=False, allow_nan=False).encode


def to_json(record: object) -> bytes:
    """Write strict JSON in UTF-8: numbers that JSON lacks as words, as in the journal, lone surrogates written out."""
    try:
        return _encode(record).encode()
    except ValueError:
        return _encode(_strict(record)).encode()


def _strict(value: object) -> object:
    if isinstance(value, str):
        return without_surrogates(value)
    if isinstance(value, float) and not math.isfinite(value):
        return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
    if isinstance(value, dict):
        return {without_surrogates(name): _strict(member) for name, member in value.items()}
    return [_strict(item) for item in value] if isinstance(value, list | tuple) else value


def separated(parts: Iterable[bytes]) -> Iterator[bytes]:
    """Yield the items of a JSON array with a comma and a line end between two."""
    mark = b""
    for part in parts:
        yield mark + part
        mark = b",\n"
