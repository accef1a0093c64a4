"""A journal read back as if it had been one run: for reports made later, and for a run that is resumed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.testing import journal
from rtf.testing.events import (
    Event,
    EventError,
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
)
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping
    from pathlib import Path

#: A test that ended like this has said nothing yet, and runs again when the run is resumed.
_OPEN = frozenset({Verdict.NOT_RUN, Verdict.INTERRUPTED, Verdict.BLOCKED})
#: So many runs are looked at to learn which cases a program has.
_LOOKED_AT = 10


class RunIndex:
    """What a run has come to, and where its parts begin: one for each time that it was started or resumed.

    ``planned`` has the fingerprint of each test, ``finished`` the tests whose final verdict stands. Of each part that
    another one follows ``finished_by`` has the tests that were finished by its end, and ``void`` the suites and tests
    of which a later part says that they are no part of the run any more. ``cases`` has the program of each case: it
    stands and falls with its program. ``limited`` has the ids and names of the only cases that are wanted of a program.
    """

    def __init__(self, events: Iterable[Event]) -> None:
        self.started: RunStarted | None = None
        self.planned: dict[str, str] = {}
        self.cases: dict[str, str] = {}
        self.limited: dict[str, dict[str, str]] = {}
        self.suites: set[str] = set()
        self.finished: set[str] = set()
        self.plan_is_whole = False  # all suites are planned before the first is started
        self.finished_by: list[frozenset[str]] = []
        self.void: list[set[str]] = []
        for event in events:
            self._take(event)

    def _take(self, event: Event) -> None:
        if isinstance(event, RunStarted):
            if event.resumed:
                self.end_part()
            self.started = self.started or event
        elif isinstance(event, SuitePlanned):
            self.suites.add(event.suite)
        elif isinstance(event, TestPlanned):
            self._take_plan(event)
        elif isinstance(event, SuiteStarted):
            self.plan_is_whole = True
        elif isinstance(event, PlanChanged):
            self.drop((*event.removed, *event.changed))
        elif isinstance(event, TestStarted):
            self.finished.discard(event.test)
        elif isinstance(event, TestEnded) and event.final and event.verdict not in _OPEN:
            self.finished.add(event.test)

    def _take_plan(self, event: TestPlanned) -> None:
        if not event.parent:
            self.planned[event.test] = event.fingerprint
            if event.cases:
                self.limited[event.test] = dict.fromkeys(event.cases, "")
            return
        self.cases[event.test] = event.parent
        limited = self.limited.get(event.parent, {})
        if event.test in limited:
            limited[event.test] = event.case

    def end_part(self) -> None:
        """Take note that another part follows."""
        self.finished.difference_update([case for case, program in self.cases.items() if program not in self.finished])
        self.finished_by.append(frozenset(self.finished))
        self.void.append(set())

    def drop(self, ids: Collection[str]) -> None:
        """Take these suites and tests out of the parts before."""
        ids = [*ids, *(case for case, program in self.cases.items() if program in ids)]
        self.finished.difference_update(ids)
        self.suites.difference_update(ids)
        for test in ids:
            self.planned.pop(test, None)
        for part in self.void:
            part.update(ids)

    def changes(self, suites: Collection[str], fingerprints: Mapping[str, str]) -> PlanChanged | None:
        """How the plan differs from what suites and tests there are now; None where it does not."""
        added = [test for test in fingerprints if test not in self.planned and self.plan_is_whole]
        removed = [*self.planned.keys() - fingerprints.keys(), *self.suites.difference(suites)]
        changed = [test for test, told in self.planned.items() if told and fingerprints.get(test, told) != told]
        if not (added or removed or changed):
            return None
        return PlanChanged(added=tuple(added), removed=tuple(sorted(removed)), changed=tuple(changed))


def cases_told(runs: Path, programs: Collection[str]) -> dict[str, dict[str, str]]:
    """Return the cases of programs, their names by their ids, as the last runs in this folder told them.

    A run that was limited to some cases of a program does not say which there are; one before it may.
    """
    told: dict[str, dict[str, str]] = {}
    missing = set(programs)
    folders = sorted((path for path in runs.glob("*") if path.is_dir() and not path.is_symlink()), reverse=True)
    for folder in folders[:_LOOKED_AT] if missing else ():
        try:
            planned = [event for event in journal.read(folder) if isinstance(event, TestPlanned)]
        except (journal.JournalError, EventError):
            continue
        for event in planned:
            if event.parent in missing:
                told.setdefault(event.parent, {})[event.test] = event.case
        missing.difference_update(event.test for event in planned if not event.cases)
        if not missing:
            break
    return told


def as_one_run(path: Path, *, resuming: bool = False, void: Collection[str] = ()) -> Iterator[Event]:
    """The events of a journal without what a later part of the same run has made void.

    Of a run that was resumed, or is being ``resuming``-ed, the ends of its earlier parts and all that belongs to tests
    that were run again are left out, as are the suites and tests that a later part, or ``void``, says are none of it
    any more. Reads the file twice and keeps no events in memory.
    """
    index = RunIndex(journal.read(path))
    if resuming:
        index.end_part()
        index.drop(void)
    part = 0
    seen: set[str] = set()
    for event in journal.read(path):
        if isinstance(event, PlanChanged):
            continue
        if isinstance(event, RunStarted) and event.resumed:
            part += 1
        elif part == len(index.void):
            if _is_new(event, seen):
                yield event
        elif not _is_void(event, index, part) and _is_new(event, seen):
            yield event


def _is_void(event: Event, index: RunIndex, part: int) -> bool:
    """Whether a later part than this one has made an event void."""
    if isinstance(event, RunEnded | SuiteEnded | Interrupted):
        return True
    test, gone = getattr(event, "test", ""), index.void[part]
    if test in gone or getattr(event, "suite", "") in gone:
        return True
    planned = isinstance(event, TestPlanned) and not event.parent
    return bool(test) and not planned and test not in index.finished_by[part]


def _is_new(event: Event, seen: set[str]) -> bool:
    """Whether this is no plan or start of a suite, or the first: a later part tells them again."""
    if not isinstance(event, SuitePlanned | TestPlanned | SuiteStarted):
        return True
    key = f"{event.kind} {event.test if isinstance(event, TestPlanned) else event.suite}"
    told = key in seen
    seen.add(key)
    return not told


def with_ends(events: Iterable[Event]) -> Iterator[Event]:
    """The events, and at the end of a journal that just stops the ends that the killed runner could not tell of."""
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
