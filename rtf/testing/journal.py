"""The folder of a run and the journal in it: one event a line, appended only, from which everything can be rebuilt.

The journal is complete at every instant: each event is with the kernel before any reporter gets it, so that not even
``kill -9`` of the runner loses one, and on the disk soon after each test's end. There is one writer. A reader tolerates
a last line that was torn by a crash of the machine. :func:`as_one_run` reads a run that was killed or resumed as if it
had been made in one go.
"""

from __future__ import annotations

import contextlib
import fcntl
import mmap
import os
import threading
from typing import TYPE_CHECKING

from rtf import clock
from rtf.testing.events import (
    Event,
    EventError,
    FixtureChanged,
    Interrupted,
    PlanChanged,
    RunEnded,
    RunStarted,
    SuiteEnded,
    SuitePlanned,
    SuiteStarted,
    TestEnded,
    TestPlanned,
    TestStarted,
    UnknownEventError,
    from_line,
    to_line,
)
from rtf.testing.results import RunResult
from rtf.testing.verdict import TestingError, Verdict

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator
    from pathlib import Path

FILE_NAME = "journal.jsonl"
#: The link beside the folders of runs to that of the last run in which something was done.
LATEST = "latest"
#: So many runs are looked at to learn which cases a program has.
_LOOKED_AT = 10

#: Seconds between two turns of the disk. Each costs the run some wake-ups of a thread that competes with it.
_SYNC_PAUSE = 0.1
#: After these events the journal is put on the disk; with these a run does something.
_TO_DISK = frozenset({RunStarted, TestEnded, SuiteEnded})
_DOES_SOMETHING = frozenset({FixtureChanged, TestStarted, TestEnded})
_MOST_A_SECOND = 1000


class JournalError(TestingError, OSError):
    """The journal cannot be written or is none."""


def make_run_folder(runs: Path, *words: str) -> Path:
    """Make a new folder in ``runs``; its name has the time and then these words, so that names sort by age.

    Raises OSError.
    """
    stem = "_".join(part.replace("/", "-") for part in (clock.local_stamp(clock.now()), *words) if part)
    for count in range(1, _MOST_A_SECOND):
        folder = runs / (stem if count == 1 else f"{stem}~{count}")
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            continue
        return folder
    raise FileExistsError(f"{runs}: there are a thousand runs of this second already")


class Journal:
    """The writer of a journal. Safe to use from several threads, one writer a file.

    With ``latest`` the link of this name, beside the run's folder, points to the run as soon as it does something. A
    run that is refused before that, or in which nothing is selected, leaves the link at the run before.
    """

    def __init__(self, path: Path, *, resume: bool = False, latest: bool = False) -> None:
        self.path = path
        self._link = latest
        flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC | (0 if resume else os.O_EXCL)
        try:
            self._descriptor = os.open(path, flags, 0o644)
            _claim(self._descriptor)
            if resume:
                _repair_torn_end(path)
        except OSError as error:
            raise self._error(error) from None
        self._lock = threading.Lock()
        self._dirty = False
        self._closing = threading.Event()
        # A thread of its own waits for the disk: the next test need not, and tests that follow each other quickly share
        # one turn of it.
        self._syncer = threading.Thread(target=self._keep_syncing, name="rtf-journal-sync", daemon=True)
        self._syncer.start()

    def append(self, event: Event) -> None:
        """Write one event. Raises JournalError when the disk is full or gone."""
        line = to_line(event)
        with self._lock:
            try:
                view = memoryview(line)
                while view:
                    view = view[os.write(self._descriptor, view) :]
            except OSError as error:
                raise self._error(error) from None
        if type(event) in _TO_DISK:
            self._dirty = True
        if self._link and type(event) in _DOES_SOMETHING:
            self._link = False
            _point_to(self.path.parent.with_name(LATEST), self.path.parent.name)

    def close(self) -> None:
        """Put everything on the disk, and close the file. Raises JournalError when the disk does not take it."""
        if self._closing.is_set():
            return
        self._closing.set()
        self._syncer.join()
        try:
            os.fsync(self._descriptor)
        except OSError as error:
            raise self._error(error) from None
        finally:
            os.close(self._descriptor)

    def close_quietly(self) -> None:
        """Close a journal that cannot be written any more."""
        with contextlib.suppress(OSError):
            self.close()

    def _error(self, error: OSError) -> JournalError:
        return JournalError(error.errno, f"cannot write the journal {self.path}: {error.strerror}")

    def _keep_syncing(self) -> None:
        while not self._closing.wait(_SYNC_PAUSE):
            if self._dirty:
                self._dirty = False
                with contextlib.suppress(OSError):  # the next write meets the same error, and says so
                    os.fsync(self._descriptor)


def _claim(descriptor: int) -> None:
    """Lock the journal as its one writer until this process ends, so that a run that still goes on is not resumed."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        os.close(descriptor)
        raise OSError(error.errno, "another runner is writing it") from None
    except OSError:
        return  # a file system without locks has to be trusted


def _repair_torn_end(path: Path) -> None:
    """Cut off a last line without an end, so that what is appended begins on a line of its own."""
    if path.stat().st_size:
        with path.open("rb+") as stream:
            with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as lines:
                end = lines.rfind(b"\n") + 1
            stream.truncate(end)


def _point_to(link: Path, name: str) -> None:
    temporary = link.with_name(f".{LATEST}.{os.getpid()}")
    with contextlib.suppress(OSError):  # a file system without links has no 'latest', and that is all
        temporary.symlink_to(name)
        temporary.replace(link)


class JournalReader:
    """Reads a journal from its beginning, and what is appended to it later.

    A last line without its end waits for it; events of a newer RTF are passed over. Raises JournalError when there is
    no such file, and EventError for a line in the middle that is no event.
    """

    def __init__(self, path: Path) -> None:
        self._run = path
        self.path = path / FILE_NAME if path.is_dir() else path
        self._offset = 0
        self._line = 0

    def new_events(self) -> Iterator[Event]:
        """Yield the events that were appended since the last call, in order."""
        try:
            stream = self.path.open("rb")
        except FileNotFoundError:
            raise JournalError(f"there is no run in {self._run}: {self.path} is missing") from None
        except OSError as error:
            raise JournalError(f"cannot read the journal {self.path}: {error.strerror}") from None
        with stream:
            stream.seek(self._offset)
            damage: EventError | None = None  # an error if another line follows: the end of a file may be lost
            for line in stream:
                if damage is not None:
                    raise damage
                if not line.endswith(b"\n"):
                    return
                try:
                    event = from_line(line)
                except UnknownEventError:
                    event = None
                except EventError as error:
                    damage = EventError(f"{self.path}:{self._line + 1}: {error}")
                    continue
                self._offset += len(line)
                self._line += 1
                if event is not None:
                    yield event


def read(path: Path) -> Iterator[Event]:
    """Yield the events of a journal, or of a run's folder, in order. Raises as :class:`JournalReader` does."""
    return JournalReader(path).new_events()


class _Parts:
    """The parts of a run that was resumed, counted from 0, and what a later part made void in earlier ones."""

    def __init__(self) -> None:
        self.results = RunResult()
        self.last = 0
        self._finished: list[frozenset[str]] = []  # for each part but the last, the tests that were finished by its end
        self._replaced: dict[str, int] = {}  # suites and tests that this part took out of the run, or changed

    def begin(self) -> None:
        """Begin a part."""
        self.last += 1
        self._finished.append(self.results.finished())

    def take_out(self, ids: Iterable[str]) -> None:
        """Make void what earlier parts report of suites and tests."""
        self._replaced |= dict.fromkeys(self.results.with_cases(ids), self.last)

    def is_void(self, event: Event, part: int) -> bool:
        """Whether a later part has made an event of this one void."""
        if isinstance(event, RunEnded | SuiteEnded | Interrupted):
            return part < self.last
        test = getattr(event, "test", "")
        if any(part < self._replaced.get(gone, 0) for gone in (test, getattr(event, "suite", ""))):
            return True
        planned = isinstance(event, TestPlanned) and not event.parent
        return bool(test) and not planned and part < self.last and test not in self._finished[part]


def as_one_run(path: Path, *, resuming: bool = False, void: Collection[str] = ()) -> Iterator[Event]:
    """Yield the events of a journal, or of a run's folder, as if the run had been made in one go.

    Of a run that was resumed, or is being ``resuming``-ed, the ends of its earlier parts and all that belongs to tests
    that were run again are left out, as are the suites and tests that a later part, or ``void``, took out of the run.
    At the end of a journal that just stops, unless it is resumed, follow the ends that a killed runner left out. Reads
    the file twice, and keeps the results in memory meanwhile. Raises as :class:`JournalReader` does.
    """
    parts = _Parts()
    for event in read(path):
        if isinstance(event, RunStarted) and event.resumed:
            parts.begin()
        elif isinstance(event, PlanChanged):
            parts.take_out((*event.removed, *event.changed))
        parts.results.apply(event)
    if resuming:
        parts.begin()
        parts.take_out(void)
    events = _one_part(read(path), parts)
    return events if resuming else _with_ends(events)


def results_of(path: Path) -> RunResult:
    """The results of a run that is over. Raises as :class:`JournalReader` does."""
    return RunResult.of(as_one_run(path))


def reported_cases(runs: Path, programs: Collection[str]) -> dict[str, dict[str, str]]:
    """Return the cases of programs, their names by their ids, as the last runs in this folder reported them.

    A run that was limited to some cases of a program does not have all of them; one before it may.
    """
    cases: dict[str, dict[str, str]] = {}
    missing = set(programs)
    if not missing:
        return cases
    folders = sorted((path for path in runs.glob("*") if path.is_dir() and not path.is_symlink()), reverse=True)
    for folder in folders[:_LOOKED_AT]:
        try:
            planned = [event for event in read(folder) if isinstance(event, TestPlanned)]
        except (JournalError, EventError):
            continue
        for event in planned:
            if event.parent in missing:
                cases.setdefault(event.parent, {})[event.test] = event.case
        missing.difference_update(event.test for event in planned if not event.cases)
        if not missing:
            break
    return cases


def _one_part(events: Iterable[Event], parts: _Parts) -> Iterator[Event]:
    number = 0
    planned: set[tuple[str, str]] = set()  # and suites that were started: a later part has them again
    for event in events:
        if isinstance(event, PlanChanged):
            continue
        if isinstance(event, RunStarted) and event.resumed:
            number += 1
            continue
        if parts.is_void(event, number):
            continue
        if isinstance(event, SuitePlanned | TestPlanned | SuiteStarted):
            key = event.kind, event.test if isinstance(event, TestPlanned) else event.suite
            if key in planned:
                continue
            planned.add(key)
        yield event


def _with_ends(events: Iterable[Event]) -> Iterator[Event]:
    running: dict[str, TestStarted] = {}
    ended = False
    last = 0.0
    for event in events:
        last = event.time
        if isinstance(event, TestStarted):
            running[event.test] = event
        elif isinstance(event, TestEnded):
            running.pop(event.test, None)
        ended = isinstance(event, RunEnded) or (ended and not isinstance(event, RunStarted))
        yield event
    if ended or not last:
        return
    yield Interrupted(time=last, source="the runner was killed", stage=3)
    for start in running.values():
        yield TestEnded(
            time=last,
            test=start.test,
            verdict=Verdict.INTERRUPTED,
            outcome=Verdict.INTERRUPTED,
            attempt=start.attempt,
            reason="killed",
            detail="the runner was killed while this test was running",
            duration=max(0.0, last - start.time),
        )
