"""A journal read back as if it had been one run: for reports made later, and for a run that is resumed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from rtf.testing import journal
from rtf.testing.events import (
    Event,
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


class RunSoFar:
    """What the parts of a run have come to: the tests that are planned, and those whose final verdict stands."""

    def __init__(self, events: Iterable[Event]) -> None:
        self.started: RunStarted | None = None
        self.planned: dict[str, str] = {}  # test -> fingerprint
        self.suites: set[str] = set()
        self.finished: set[str] = set()
        self.plan_is_whole = False  # all suites are planned before the first is started
        for event in events:
            self._take(event)

    def _take(self, event: Event) -> None:
        if isinstance(event, RunStarted):
            self.started = self.started or event
        elif isinstance(event, SuitePlanned):
            self.suites.add(event.suite)
        elif isinstance(event, TestPlanned):
            self.planned[event.test] = event.fingerprint
        elif isinstance(event, SuiteStarted):
            self.plan_is_whole = True
        elif isinstance(event, PlanChanged):
            self.finished.difference_update(event.removed, event.changed)
            self.suites.difference_update(event.removed)
            for test in event.removed + event.changed:
                self.planned.pop(test, None)
        elif isinstance(event, TestStarted):
            self.finished.discard(event.test)
        elif isinstance(event, TestEnded) and event.final and event.verdict not in _OPEN:
            self.finished.add(event.test)

    def changes(self, suites: Collection[str], fingerprints: Mapping[str, str]) -> PlanChanged | None:
        """How the plan differs from what suites and tests there are now; None where it does not."""
        changed = PlanChanged(
            added=tuple(test for test in fingerprints if test not in self.planned),
            removed=tuple(sorted((*(self.planned.keys() - fingerprints.keys()), *self.suites.difference(suites)))),
            changed=tuple(test for test, told in self.planned.items() if told and fingerprints.get(test, told) != told),
        )
        if not self.plan_is_whole:
            changed = msgspec.structs.replace(changed, added=())
        return changed if changed.added or changed.removed or changed.changed else None


def as_one_run(path: Path, *, resuming: bool = False, void: Collection[str] = ()) -> Iterator[Event]:
    """The events of a journal without what a later part of the same run has made void.

    Of a run that was resumed, or is being ``resuming``-ed, the ends of its earlier parts and all that belongs to tests
    that were run again are left out, as are the suites and tests that a later part, or ``void``, says are none of it
    any more. Reads the file twice and keeps no events in memory.
    """
    done: list[frozenset[str]] = []
    gone: list[set[str]] = [set()]
    ended: dict[str, bool] = {}
    for event in journal.read(path):
        if isinstance(event, RunStarted) and event.resumed:
            done.append(frozenset(test for test, over in ended.items() if over))
            gone.append(set())
        elif isinstance(event, PlanChanged):
            for earlier in gone[:-1]:
                earlier.update(event.removed, event.changed)
        elif isinstance(event, TestStarted):
            ended[event.test] = False
        elif isinstance(event, TestEnded) and event.final:
            ended[event.test] = event.verdict not in _OPEN
    if resuming:
        done.append(frozenset(test for test, over in ended.items() if over))
    for earlier in gone:
        earlier.update(void)
    yield from _filtered(journal.read(path), done, gone)


def _filtered(events: Iterator[Event], done_before: list[frozenset[str]], gone: list[set[str]]) -> Iterator[Event]:
    index = 0
    seen: set[str] = set()
    for event in events:
        if isinstance(event, RunStarted) and event.resumed:
            index += 1
            continue
        test = getattr(event, "test", "")
        if isinstance(event, PlanChanged) or test in gone[index] or getattr(event, "suite", "") in gone[index]:
            continue
        if isinstance(event, SuitePlanned | TestPlanned):
            key = f"{event.kind} {test or event.suite}"
            if key not in seen:
                seen.add(key)
                yield event
            continue
        if isinstance(event, SuiteStarted):
            if event.suite not in seen:
                seen.add(event.suite)
                yield event
            continue
        superseded = index < len(done_before)
        if superseded and isinstance(event, RunEnded | SuiteEnded | Interrupted):
            continue
        if superseded and test and test not in done_before[index]:
            continue
        yield event


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
