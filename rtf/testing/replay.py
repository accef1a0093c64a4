"""A journal read back as if it had been one run: for reports made later, and for a run that is resumed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.testing import journal
from rtf.testing.events import (
    Event,
    Interrupted,
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
    from collections.abc import Iterable, Iterator
    from pathlib import Path

#: A test that ended like this has said nothing yet, and runs again when the run is resumed.
_OPEN = frozenset({Verdict.NOT_RUN, Verdict.INTERRUPTED, Verdict.BLOCKED})


def finished_tests(events: Iterable[Event]) -> frozenset[str]:
    """The tests whose final verdict stands."""
    done: dict[str, bool] = {}
    for event in events:
        if isinstance(event, TestStarted):
            done[event.test] = False
        elif isinstance(event, TestEnded) and event.final:
            done[event.test] = event.verdict not in _OPEN
    return frozenset(test for test, ended in done.items() if ended)


def planned_tests(events: Iterable[Event]) -> frozenset[str] | None:
    """The tests that a run consists of; None for one that was killed while it was still telling its plan."""
    planned: set[str] = set()
    told = False
    for event in events:
        if isinstance(event, TestPlanned):
            planned.add(event.test)
        elif isinstance(event, SuiteStarted):
            told = True  # all suites are planned before the first is started
    return frozenset(planned) if told else None


def as_one_run(path: Path, *, resuming: bool = False) -> Iterator[Event]:
    """The events of a journal without what a later part of the same run has made void.

    Of a run that was resumed, or is being ``resuming``-ed, the ends of its earlier parts and all that belongs to tests
    that were run again are left out. Reads the file twice and keeps no events in memory.
    """
    done_before: list[frozenset[str]] = []
    part: dict[str, bool] = {}
    for event in journal.read(path):
        if isinstance(event, RunStarted) and event.resumed:
            done_before.append(frozenset(test for test, ended in part.items() if ended))
        elif isinstance(event, TestStarted):
            part[event.test] = False
        elif isinstance(event, TestEnded) and event.final:
            part[event.test] = event.verdict not in _OPEN
    if resuming:
        done_before.append(frozenset(test for test, ended in part.items() if ended))
    yield from _filtered(journal.read(path), done_before)


def _filtered(events: Iterator[Event], done_before: list[frozenset[str]]) -> Iterator[Event]:
    index = 0
    seen: set[str] = set()
    for event in events:
        if isinstance(event, RunStarted) and event.resumed:
            index += 1
            continue
        if isinstance(event, SuitePlanned | TestPlanned):
            key = f"{event.kind} {event.test if isinstance(event, TestPlanned) else event.suite}"
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
        test = getattr(event, "test", "")
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
