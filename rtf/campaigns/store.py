"""The state of a campaign in one file: a history, whose table of tasks says what is to be run, and what was.

The file is complete at every instant: a task and its run, tests, measurements and journal are written together. One
process runs a campaign at a time; others may read it.
"""

from __future__ import annotations

import fcntl
import os
import tempfile
import zlib
from collections import Counter
from contextlib import contextmanager
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rtf.campaigns.errors import CampaignError
from rtf.campaigns.outcomes import Measured, Outcome
from rtf.campaigns.task_run import SUITE
from rtf.campaigns.tasks import Task, from_json, to_json
from rtf.robot_testing.proof.judging import NO_STATEMENT
from rtf.testing import journal
from rtf.testing.events import EventError
from rtf.testing.history import History
from rtf.testing.history.database import record_run
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from rtf.testing.history.database import MeasurementRow

#: The largest journal that is taken from a worker (bytes), so that none fills the client's disk.
MOST_JOURNAL = 256 << 20
_CHUNK = 1 << 20


class State(StrEnum):
    """The state of a task."""

    WAITING = "waiting"
    RUNNING = "running"
    DONE = "done"
    KILLED = "killed"  # its worker died each time: a finding
    BROKEN = "broken"  # it cannot be run, or its result is none
    LOST = "lost"  # begun on a real robot, and without a result; it is not begun again by itself
    REFUSED = "refused"  # the worker's machine does not permit the real robot to be moved


#: The states that a person may have run again.
AGAIN = (State.KILLED, State.BROKEN, State.LOST, State.REFUSED)
_AGAIN = ", ".join(f"'{state}'" for state in AGAIN)  # for SQL


class ResultError(CampaignError):
    """What a worker sent is no result of its task."""


@dataclass(frozen=True, slots=True)
class Row:
    """A task of the file, with its number and how often it was begun without a result."""

    number: int
    task: Task
    attempts: int


class CampaignStore(History):
    """An open file of a campaign. Methods raise HistoryError.

    With ``exclusive`` it is that of the one process that runs the campaign. Raises CampaignError if another one does,
    or if there is no file and none is to be made.
    """

    def __init__(self, path: Path, *, create: bool = False, exclusive: bool = False) -> None:
        self._lock = -1
        if not create and not path.exists():
            raise CampaignError(f"there is no campaign {path}: 'rtf campaign FILE.toml' runs one, into FILE.sqlite")
        if exclusive:
            self._lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
            try:
                fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                os.close(self._lock)
                raise CampaignError(
                    f"{path}: another process runs this campaign; 'rtf campaign status' shows how far it is"
                ) from None
        super().__init__(path, create=create)

    def close(self) -> None:
        """Close the file, and let others run the campaign."""
        super().close()
        if self._lock >= 0:  # after SQLite: the system drops all locks of a process when it closes a file once
            os.close(self._lock)

    # Tasks -------------------------------------------------------------------------------------------------------

    def add(self, tasks: Iterable[Task]) -> int:
        """Add those that are not there; returns how many these are."""
        with self.transaction():
            before = self._connection.total_changes
            self._connection.executemany(
                "INSERT OR IGNORE INTO tasks (key, task, robot, state, attempts, detail) "
                "VALUES (?, ?, ?, 'waiting', 0, '')",
                ((task.key, to_json(task).decode(), task.real.name if task.real else "") for task in tasks),
            )
            return self._connection.total_changes - before

    def begin(self, *, again: bool = False) -> None:
        """Put the tasks in order that ran when the process before died; ``again``: also those that a person may."""
        with self.transaction():
            execute = self._connection.execute
            execute("UPDATE tasks SET state = 'waiting' WHERE state = 'running' AND robot = ''")
            execute(
                "UPDATE tasks SET state = 'lost', attempts = attempts + 1, "
                "detail = 'the campaign ended during the run' WHERE state = 'running'"
            )
            if again:
                execute(
                    f"UPDATE tasks SET state = 'waiting', attempts = CASE robot WHEN '' THEN 0 ELSE attempts END "  # noqa: S608
                    f"WHERE state IN ({_AGAIN})"
                )

    def take(self, count: int, robot: str = "") -> list[Row]:
        """Return so many tasks that wait, those without a failed attempt first, and note that they are running."""
        with self.transaction():
            found = self._connection.execute(
                "SELECT id, task, attempts FROM tasks WHERE state = 'waiting' AND robot = ? "
                "ORDER BY attempts, id LIMIT ?",
                (robot, count),
            ).fetchall()
            self._connection.executemany(
                "UPDATE tasks SET state = 'running' WHERE id = ?", ((number,) for number, _, _ in found)
            )
        return [Row(number, from_json(task), attempts) for number, task, attempts in found]

    def put_back(self, row: Row) -> None:
        """Have a task wait again that was not begun, or whose run was dropped."""
        self._set(row, State.WAITING, row.attempts, "")

    def retry(self, row: Row, detail: str) -> None:
        """Have a task wait again whose worker died."""
        self._set(row, State.WAITING, row.attempts + 1, detail)

    def fail(self, row: Row, state: State, detail: str) -> None:
        """End a task without a result."""
        self._set(row, state, row.attempts + 1, detail)

    def _set(self, row: Row, state: State, attempts: int, detail: str) -> None:
        with self.transaction():
            self._connection.execute(
                "UPDATE tasks SET state = ?, attempts = ?, detail = ? WHERE id = ?",
                (state, attempts, detail, row.number),
            )

    def finish(self, row: Row, packed: bytes, seconds: float) -> bool | None:
        """Put in the compressed journal of a task, and its run; returns what the task found, as :meth:`found` does.

        ``seconds`` is what the task took, with the start of its runner.

        Raises ResultError for one that is no journal of this task, and then writes nothing.
        """
        with _unpacked(packed, row.task.key) as folder:
            try:
                results = journal.results_of(folder)
            except (EventError, journal.JournalError) as error:
                raise ResultError(f"its journal cannot be read: {error}") from None
            if results.started is None or results.ended is None or results.started.run != row.task.key:
                raise ResultError("its journal is not that of a whole run of this task")
            with self.transaction():
                run = record_run(self, folder, results)
                execute = self._connection.execute
                execute(
                    "UPDATE tasks SET state = 'done', detail = '', run = ?, seconds = ? WHERE id = ?",
                    (run, seconds, row.number),
                )
                execute("INSERT OR REPLACE INTO journals VALUES (?, ?)", (row.number, packed))
        verdicts = [test.verdict or Verdict.NOT_RUN for test in results.tests.values()]
        return _found(verdicts, healthy=row.task.fault is None)

    # What is known -----------------------------------------------------------------------------------------------

    def counts(self) -> dict[State, int]:
        """Return the number of tasks in each state."""
        with self._translate_errors():
            rows = self._connection.execute("SELECT state, count(*) FROM tasks GROUP BY state").fetchall()
        return Counter({State(state): count for state, count in rows})

    def endings(self) -> list[tuple[Task, State, str]]:
        """Return the tasks that ended without a result, with the reason."""
        with self._translate_errors():
            rows = self._connection.execute(
                f"SELECT task, state, detail FROM tasks WHERE state IN ({_AGAIN}) ORDER BY id"  # noqa: S608
            ).fetchall()
        return [(from_json(task), State(state), detail) for task, state, detail in rows]

    def latest(self, count: int) -> list[Outcome]:
        """Return so many outcomes of tasks that are done, the newest first, without measurements."""
        with self._translate_errors():
            rows = self._connection.execute(
                "SELECT t.task, s.test, s.verdict, s.attempts, s.duration, s.processor, s.named FROM tasks t "
                "JOIN tests s ON s.run = t.run ORDER BY t.run DESC, s.test LIMIT ?",
                (count,),
            ).fetchall()
        return [_outcome_of(from_json(text), test, row, {}) for text, test, *row in rows]

    def found(self) -> dict[str, bool | None]:
        """Return, for each task that is over, whether its test failed; None where it says nothing of the robot."""
        with self._translate_errors():
            rows = self._connection.execute(
                "SELECT t.key, json_extract(t.task, '$.fault') IS NULL, group_concat(s.verdict, '\n') FROM tasks t "
                "LEFT JOIN tests s ON s.run = t.run WHERE t.state NOT IN ('waiting', 'running') GROUP BY t.id"
            )
            return {
                key: _found([Verdict(one) for one in (verdicts or "").split("\n") if one], healthy=bool(healthy))
                for key, healthy, verdicts in rows
            }

    def means(self) -> tuple[float, float] | None:
        """Return seconds and bytes of an average run of the file; None if there is none."""
        with self._translate_errors():
            seconds, size = self._connection.execute(
                "SELECT avg(t.seconds), avg(length(j.journal)) FROM tasks t JOIN journals j ON j.task = t.id"
            ).fetchone()
        return None if seconds is None else (float(seconds), float(size))

    def journal_of(self, key: str) -> bytes:
        """Return the journal of a task, as it was written. Raises CampaignError if there is none."""
        with self._translate_errors():
            row = self._connection.execute(
                "SELECT j.journal FROM journals j JOIN tasks t ON t.id = j.task WHERE t.key = ?", (key,)
            ).fetchone()
        if row is None:
            raise CampaignError(f"{self.path}: there is no result of a task {key}")
        return zlib.decompress(row[0])

    def journals(self) -> Iterator[tuple[Task, bytes]]:
        """Yield the tasks that are over with their journals; those of tasks that killed their workers are empty."""
        with self._translate_errors():
            for text, packed in self._connection.execute(
                "SELECT t.task, j.journal FROM tasks t LEFT JOIN journals j ON j.task = t.id "
                "WHERE t.state IN ('done', 'killed') ORDER BY t.id"
            ):
                yield from_json(text), zlib.decompress(packed) if packed else b""

    def outcomes(self) -> Iterator[Outcome]:
        """Yield the outcome of each test of each task that is over, in the order in which the tasks were planned.

        A task that killed its worker each time is an outcome, too: an error without measurements.
        """
        with self._translate_errors():
            cursor = self._connection.execute(
                "SELECT t.task, t.state, t.attempts, t.run, s.test, s.verdict, s.attempts, s.duration, s.processor, "
                "s.named FROM tasks t LEFT JOIN tests s ON s.run = t.run WHERE t.state IN ('done', 'killed') "
                "ORDER BY t.id, s.test"
            )
            seen, by_test = None, dict[str, dict[str, Measured]]()
            for text, state, tries, run, test, *values in cursor:
                task = from_json(text)
                if state == State.KILLED:
                    yield _outcome(task, task.test or task.suite, (Verdict.ERROR, tries, 0.0, 0.0, None), {})
                    continue
                if run != seen:
                    seen, by_test = run, _measured(self.measurements(run))
                if test is not None:
                    yield _outcome_of(task, test, values, by_test.get(test, {}))


def outcomes_of(path: Path) -> Iterator[Outcome]:
    """Yield the outcomes of a campaign, by the path of its file. Raises HistoryError."""
    with CampaignStore(path) as store:
        yield from store.outcomes()


def _outcome_of(task: Task, test: str, row: Sequence[Any], measurements: Mapping[str, Measured]) -> Outcome:
    """Return the outcome of a row of tests: verdict, attempts, duration, processor, named."""
    name = test if task.suite else test.removeprefix(f"{SUITE}/")
    verdict, attempts, seconds, processor, named = row
    values = (Verdict(verdict), attempts, seconds or 0.0, processor or 0.0, named)
    return _outcome(task, name, values, measurements)


def _outcome(
    task: Task, test: str, row: tuple[Verdict, int, float, float, str | None], measurements: Mapping[str, Measured]
) -> Outcome:
    verdict, attempts, seconds, processor, named = row
    return Outcome(
        test=test,
        robot=task.robot,
        unit=task.unit,
        seed=task.seed,
        fault=task.fault.kind if task.fault else None,
        joint=task.fault.target if task.fault else None,
        severity=task.fault.severity if task.fault else None,
        verdict=verdict,
        named=named,
        attempts=attempts,
        seconds=seconds,
        processor_seconds=processor,
        measurements=measurements,
    )


def _measured(rows: Iterable[MeasurementRow]) -> dict[str, dict[str, Measured]]:
    """Return the measurements of a run, by test and then by name."""
    by_test: dict[str, dict[str, Measured]] = {}
    for test, subject, name, repetition, value, special, unit, low, high, _, _ in rows:
        key = "/".join(filter(None, (subject, name))) + (f"#{repetition + 1}" if repetition else "")
        number = float(special or "nan") if value is None else value
        by_test.setdefault(test, {})[key] = Measured(number, unit, low, high)
    return by_test


def _found(verdicts: Iterable[Verdict], *, healthy: bool) -> bool | None:
    """Return whether a test failed; None if none says something of the robot.

    An error alarms on a healthy robot, and does not find a fault.
    """
    alarms = (Verdict.FAILED, Verdict.ERROR) if healthy else (Verdict.FAILED,)
    judged = [one for one in verdicts if one not in NO_STATEMENT and (one in alarms or one is not Verdict.ERROR)]
    return any(one in alarms for one in judged) if judged else None


@contextmanager
def _unpacked(packed: bytes, key: str) -> Iterator[Path]:
    """Unpack a journal into the folder of a run, whose name is that of the task. Raises ResultError if it is none."""
    with tempfile.TemporaryDirectory(prefix="rtf-result-") as place:
        folder = Path(place) / key
        folder.mkdir()
        with (folder / journal.FILE_NAME).open("wb") as stream:
            for part in _parts(packed):
                stream.write(part)
        yield folder


def _parts(packed: bytes) -> Iterator[bytes]:
    unpacking = zlib.decompressobj()
    size, rest = 0, packed
    while rest and not unpacking.eof:
        try:
            part = unpacking.decompress(rest, _CHUNK)
        except zlib.error as error:
            raise ResultError(f"its journal is damaged: {error}") from None
        size, rest = size + len(part), unpacking.unconsumed_tail
        if size > MOST_JOURNAL:
            raise ResultError(f"its journal has more than {MOST_JOURNAL >> 20} MiB")
        yield part
    if not unpacking.eof or unpacking.unused_data:
        raise ResultError("its journal is damaged: it does not end where it should")
