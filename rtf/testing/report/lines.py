"""The lines of the C++ Robot Testing Framework, which people's scripts and eyes know.

What the C++ framework had no word for (measurements, retries, fixtures that come back, tests that never ran) is said
with its tags, so that a script that looks for ``[FAIL]``, ``[ERROR]`` and ``passed!`` is never misled.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf.testing.events import (
    Answered,
    Asked,
    Attached,
    Diagnosed,
    Event,
    FixtureChanged,
    FixtureIncident,
    InternalError,
    Interrupted,
    Measured,
    Message,
    OutputCaptured,
    ParametersResolved,
    RunEnded,
    RunStarted,
    SeriesRecorded,
    StackDumped,
    SubResultEnded,
    SuiteEnded,
    SuiteStarted,
    TestEnded,
    TestStarted,
)
from rtf.testing.report.text import incident, measurement, place, shown
from rtf.testing.verdict import FixtureState, MeasurementVerdict, Severity, Verdict

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rtf.testing.results import RunResult

_TAGS = {"info": "[INFO]  ", "fail": "[FAIL]  ", "error": "[ERROR] "}
#: The C++ framework's colours, but for its grey, which is black and cannot be read on a dark terminal.
_COLOURS = {"start": "94", "passed": "92", "failed": "91", "fail": "91", "error": "91", "info": "90"}
_RUNNER = "rtf"
#: Verdicts that ``passed!`` does not tell, and no message before it did.
_NOTED = (Verdict.MEASURED, Verdict.FLAKY, Verdict.EXPECTED_FAILURE)


@dataclass(frozen=True, slots=True)
class Line:
    """One line: its text after the tag, what it is (``info``, ``fail``, ``error``, ``start``, ``passed``, ``failed``).

    ``runner`` marks the lines about the runner itself, which the C++ framework's result file does not have. ``place``
    is the line of the detail mode, or empty.
    """

    text: str
    kind: str
    place: str = ""
    runner: bool = False

    @property
    def tag(self) -> str:
        """The tag with its blanks, or nothing."""
        return _TAGS.get(self.kind, "")

    @property
    def critical(self) -> bool:
        """Whether it is shown without ``-v``."""
        return self.kind in ("fail", "error")


def formatted(line: Line, *, detail: bool, coloured: bool = False) -> str:
    """Write a line as it is printed, with its place below it in the detail mode."""
    text = f"{line.tag}{line.text}"
    if coloured:
        start = f"\x1b[{_COLOURS[line.kind]}m"
        text = f"{start}{line.tag}\x1b[0m{line.text}" if line.tag else f"{start}{line.text}\x1b[0m"
    return f"{text}\n{line.place}\n\n" if line.place and detail else f"{text}\n"


def lines(event: Event, results: RunResult) -> Iterator[Line]:
    """What the C++ framework would say of an event."""
    teller = _TELLERS.get(type(event))
    if teller is not None:
        yield from teller(event, results)


def _said(kind: str, who: str, title: str, detail: str = "", where: str = "") -> Line:
    return Line(shown(f"({who}) {title}: {detail}"), kind, where)


def _where(file: str, line: int) -> str:
    return f"{place(file)} at {line}." if line else ""


def _test_name(test: str, results: RunResult) -> str:
    known = results.tests.get(test)
    return known.name if known is not None else test


def _suite_name(suite: str, results: RunResult) -> str:
    known = results.suites.get(suite)
    return known.name if known is not None else suite or _RUNNER


def _run_started(_event: RunStarted, _results: RunResult) -> Iterator[Line]:
    yield Line("Starting test runner.", "start", runner=True)


def _run_ended(_event: RunEnded, _results: RunResult) -> Iterator[Line]:
    yield Line("Ending test runner.", "start", runner=True)


def _suite_started(event: SuiteStarted, results: RunResult) -> Iterator[Line]:
    yield Line(shown(f"Test suite {_suite_name(event.suite, results)} started..."), "start")


def _suite_ended(event: SuiteEnded, results: RunResult) -> Iterator[Line]:
    word = "passed" if event.verdict.good else "failed"
    yield Line(shown(f"Test suite {_suite_name(event.suite, results)} {word}!"), word)


def _test_started(event: TestStarted, results: RunResult) -> Iterator[Line]:
    yield Line(shown(f"Test case {_test_name(event.test, results)} started..."), "start")


def _test_ended(event: TestEnded, results: RunResult) -> Iterator[Line]:
    name = _test_name(event.test, results)
    if not event.final:
        yield _said("info", name, "reports", f"attempt {event.attempt} came to: {event.outcome}; once more")
        return
    known = results.tests.get(event.test)
    good = event.verdict.good
    if not good and (known is None or not known.problem_count):
        kind = "fail" if event.verdict in (Verdict.FAILED, Verdict.UNEXPECTED_PASS) else "error"
        yield _said(kind, name, event.verdict, event.detail or event.reason)
    elif event.verdict in _NOTED or (good and not event.attempt):
        yield _said("info", name, event.verdict, event.detail)
    word = "passed" if good else "failed"
    yield Line(shown(f"Test case {name} {word}!"), word)


_KINDS = {Severity.FAILURE: "fail", Severity.ERROR: "error"}


def _message(event: Message, results: RunResult) -> Iterator[Line]:
    who = _test_name(event.test, results) if event.test else event.fixture or _suite_name(event.suite, results)
    title = f"{event.subject}: {event.title}" if event.subject else event.title
    yield _said(_KINDS.get(event.severity, "info"), who, title, event.detail, _where(event.file, event.line))


def _measured(event: Measured, results: RunResult) -> Iterator[Line]:
    if event.verdict is not MeasurementVerdict.FAILED:  # a failed one is followed by its failure message
        where = _where(event.file, event.line)
        yield _said("info", _test_name(event.test, results), "measures", measurement(event), where)


def _parameters(event: ParametersResolved, results: RunResult) -> Iterator[Line]:
    for row in event.parameters:
        value = " ".join(part for part in (row.get("value", ""), row.get("unit", "")) if part)
        detail = f"{row.get('name', '')} = {value} ({row.get('source', '')})"
        yield _said("info", _test_name(event.test, results), "parameter", detail)


def _part(event: SubResultEnded, results: RunResult) -> Iterator[Line]:
    detail = f"{event.verdict}: {event.reason}" if event.reason else event.verdict
    yield _said("info", _test_name(event.test, results), event.subject, detail)


def _kept(event: Attached | SeriesRecorded, results: RunResult) -> Iterator[Line]:
    word = "attaches" if isinstance(event, Attached) else "records"
    yield _said("info", _test_name(event.test, results), word, f"{event.name}: {event.path}")


def _asked(event: Asked, results: RunResult) -> Iterator[Line]:
    yield _said("info", _test_name(event.test, results), "asks", event.text)


def _answered(event: Answered, results: RunResult) -> Iterator[Line]:
    answer = "no answer" if event.answer is None else event.answer
    yield _said("info", _test_name(event.test, results), "answer", f"{answer} ({event.source})")


def _output(event: OutputCaptured, results: RunResult) -> Iterator[Line]:
    who = _test_name(event.test, results) if event.test else event.fixture
    if event.omitted:
        yield _said("info", who, event.stream, f"({event.omitted} bytes left out)")
    for text in event.text.split("\n")[: -1 if event.text.endswith("\n") else None]:
        yield _said("info", who, event.stream, text)


def _stacks(event: StackDumped, results: RunResult) -> Iterator[Line]:
    who = _test_name(event.test, results) if event.test else event.fixture
    yield _said("info", who, "stacks", f"{event.cause}\n{event.text.rstrip()}")


def _fixture_incident(event: FixtureIncident, results: RunResult) -> Iterator[Line]:
    detail = "\n".join(part.rstrip("\n") for part in (incident(event), event.traceback, event.output) if part)
    yield _said("error", _suite_name(event.suite, results), "Fixture collapsed", detail)


def _fixture_changed(event: FixtureChanged, results: RunResult) -> Iterator[Line]:
    who = _suite_name(event.suite, results)
    if event.state is FixtureState.STARTING and event.generation > 1:
        yield _said("info", who, "reports", f"restarting fixture setup of {event.fixture} (#{event.generation})")
    elif event.state is FixtureState.FAILED:
        yield _said("error", who, "Fixture collapsed", f"{event.fixture} is given up: {event.detail}")
    else:
        yield _said("info", who, "reports", f"fixture {event.fixture} #{event.generation} is {event.state}")


def _diagnosed(event: Diagnosed, results: RunResult) -> Iterator[Line]:
    where = place(event.file, event.line, event.column)
    text = f"{event.text}; {event.hint}" if event.hint else event.text
    kind = _KINDS.get(event.severity, "info")
    who = _suite_name(event.suite, results)
    yield _said("error" if kind == "fail" else kind, who, "loading", f"{where}: {text}" if where else text)


def _interrupted(event: Interrupted, _results: RunResult) -> Iterator[Line]:
    yield _said("error", _RUNNER, "interrupted!", event.source)


def _internal_error(event: InternalError, _results: RunResult) -> Iterator[Line]:
    text = f"{event.text}\n{event.traceback.rstrip()}" if event.traceback else event.text
    yield _said("error", _RUNNER, "internal error", text)


_TELLERS: dict[type[Event], Callable[..., Iterator[Line]]] = {
    RunStarted: _run_started,
    RunEnded: _run_ended,
    SuiteStarted: _suite_started,
    SuiteEnded: _suite_ended,
    TestStarted: _test_started,
    TestEnded: _test_ended,
    Message: _message,
    Measured: _measured,
    ParametersResolved: _parameters,
    SubResultEnded: _part,
    Attached: _kept,
    SeriesRecorded: _kept,
    Asked: _asked,
    Answered: _answered,
    OutputCaptured: _output,
    StackDumped: _stacks,
    FixtureIncident: _fixture_incident,
    FixtureChanged: _fixture_changed,
    Diagnosed: _diagnosed,
    Interrupted: _interrupted,
    InternalError: _internal_error,
}


def summary(results: RunResult, title: str) -> str:
    """The block of totals. A suite or test counts as passed when the exit code may be 0 with it; each counts once."""
    rows = [f"\n---------- {title} -----------"]
    suites = [suite.ended is not None and suite.ended.verdict.good for suite in results.suites.values()]
    if suites:
        rows += [
            f"Total number of test suites  : {len(suites)}",
            f"Number of passed test suites : {sum(suites)}",
            f"Number of failed test suites : {len(suites) - sum(suites)}",
        ]
    numbers = results.counts()
    total = sum(numbers.values())
    passed = sum(count for verdict, count in numbers.items() if verdict.good)
    rows += [
        f"Total number of test cases   : {total}",
        f"Number of passed test cases  : {passed}",
        f"Number of failed test cases  : {total - passed}",
    ]
    return "\n".join(rows) + "\n"
