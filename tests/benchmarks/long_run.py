"""The journal of a long run, as a runner would have written it: for what has to read one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.testing.events import (
    FixtureChanged,
    FixtureIncident,
    Measured,
    Message,
    RunEnded,
    RunStarted,
    SubResultEnded,
    SuiteEnded,
    SuitePlanned,
    SuiteStarted,
    TestEnded,
    TestPlanned,
    TestStarted,
    to_line,
)
from rtf.testing.journal import FILE_NAME
from rtf.testing.measurement import MeasurementVerdict
from rtf.testing.verdict import FixtureState, Phase, Severity, Verdict

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from rtf.testing.events import Event

_TESTS_OF_A_SUITE = 200
#: Of so many tests one fails, and of so many suites one loses its fixture once.
_FAILING, _INCIDENT = 50, 5


def write_journal(folder: Path, tests: int, events: int) -> Path:
    """Write the journal of a run of so many tests, each of so many events (at least 2), a few of which failed."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / FILE_NAME).open("wb") as stream:
        for seq, event in enumerate(_run(tests, events), 1):
            stream.write(to_line(event.with_seq(seq)))
    return folder


def _run(tests: int, events: int) -> Iterator[Event]:
    time = 1_750_000_000.0
    suites = [f"suite {number:02}" for number in range(-(-tests // _TESTS_OF_A_SUITE))]
    yield RunStarted(run="long", version="1", time=time, robot="icubSim", environment={"host": "bench"})
    plans = []
    for number in range(tests):
        suite = suites[number // _TESTS_OF_A_SUITE]
        name = f"joint {number:05}"
        plans.append((suite, TestPlanned(test=f"{suite}/{name}", suite=suite, name=name, plugin="limits", time=time)))
    for suite in suites:
        yield SuitePlanned(suite=suite, name=suite, fixtures=("server",), time=time)
        yield from (planned for of, planned in plans if of == suite)
    failed = 0
    for index, suite in enumerate(suites):
        yield SuiteStarted(suite=suite, time=time)
        yield FixtureChanged(fixture="server", suite=suite, generation=1, state=FixtureState.READY, time=time)
        for number, (of, planned) in enumerate(plans):
            if of == suite:
                bad = number % _FAILING == 0
                failed += bad
                for event in _test(planned.test, events, bad=bad, time=time):
                    yield event
                    time = event.time
        if index % _INCIDENT == 0:
            cause = "the program died"
            yield FixtureIncident(
                fixture="server", suite=suite, generation=1, phase=Phase.CHECK, cause=cause, time=time
            )
        verdict = Verdict.FAILED if failed else Verdict.PASSED
        yield SuiteEnded(suite=suite, verdict=verdict, duration=1.0, time=time)
    counts = {"failed": failed, "passed": tests - failed}
    yield RunEnded(verdict=Verdict.FAILED, exit_code=1, duration=time - 1_750_000_000.0, counts=counts, time=time)


def _test(test: str, events: int, *, bad: bool, time: float) -> Iterator[Event]:
    yield TestStarted(test=test, pid=4711, time=time)
    for number in range(events - 2):
        time += 0.001
        kind = number % 4
        if kind == 0:
            value = number / 100 + len(test) / 50 + (time * 1000) % 50 / 100
            yield Measured(
                test=test,
                name=f"error {number}",
                subject=f"part {number // 4}",
                value=value,
                unit="deg",
                low=-1.0,
                high=1.0,
                margin=1.0 - value,
                verdict=MeasurementVerdict.PASSED,
                time=time,
            )
        elif kind == 3:
            yield SubResultEnded(test=test, subject=f"part {number // 4}", verdict=Verdict.PASSED, time=time)
        else:
            severity = Severity.FAILURE if bad and number == 1 else Severity.INFO
            yield Message(test=test, severity=severity, title="reports", detail=f"step {number} of {test}", time=time)
    verdict = Verdict.FAILED if bad else Verdict.PASSED
    yield TestEnded(test=test, verdict=verdict, outcome=verdict, duration=0.5, time=time + 0.001)
