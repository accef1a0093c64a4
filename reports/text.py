"""What the C++ Robot Testing Framework printed and wrote, line for line, which people's scripts and eyes know.

Two reporters share the lines: ``text`` writes the result file, and ``classic`` is the console. What the C++ framework
had no word for (measurements, retries, fixtures that come back, tests that never ran) is said with its tags, so that a
script that looks for ``[FAIL]``, ``[ERROR]`` and ``passed!`` is never misled.

Unlike the C++ framework's the result file is written while the run goes on, so that a runner that is killed leaves what
was known; it is complete when it ends with the summary, which is written in one piece. It contains everything, whatever
the verbosity. On the console verbosity 0 shows errors, failures and the totals, as the C++ framework does without
``-v``; with 1 everything is shown. Colours appear only where a person sees them. ``detail`` adds the places to both.
"""

from __future__ import annotations

import io
import os
import sys
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, TextIO

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
from rtf.testing.measurement import MeasurementVerdict
from rtf.testing.report.files import Target
from rtf.testing.report.text import encodable, incident, measurement, parameter, place, shown, wants_colour
from rtf.testing.reporting import Reporter
from rtf.testing.verdict import FixtureState, Severity, Verdict

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.testing.results import RunResult

_TAGS = {"info": "[INFO]  ", "fail": "[FAIL]  ", "error": "[ERROR] "}
#: The C++ framework's colours, but for its grey, which is black and cannot be read on a dark terminal.
_COLOURS = {"start": "94", "passed": "92", "failed": "91", "fail": "91", "error": "91", "info": "90"}
_KINDS = {Severity.FAILURE: "fail", Severity.ERROR: "error"}
_RUNNER = "rtf"
#: Verdicts that ``passed!`` does not tell, and no message before it did.
_NOTED = (Verdict.MEASURED, Verdict.FLAKY, Verdict.EXPECTED_FAILURE)


class TextReporter(Reporter):
    """Writes ``result.txt``. Without a target it writes to standard output."""

    plugin_name = "text"
    default_file = "result.txt"

    def open(self) -> None:
        """Begin the file anew. Raises OSError when it cannot be written."""
        target = Target(self.options.target)
        target.check()
        self._stream = io.TextIOWrapper(target.open(), encoding="utf-8", errors="backslashreplace", newline="\n")

    def handle(self, event: Event, results: RunResult) -> None:
        try:
            for line in _lines(event, results):
                if not line.runner:
                    self._stream.write(_formatted(line, detail=self.options.detail))
            if isinstance(event, TestEnded | SuiteEnded):
                self._stream.flush()
        except OSError:
            with suppress(OSError):  # the same again
                self._stream.close()
            raise

    def close(self, results: RunResult) -> None:
        with self._stream as stream:
            stream.flush()
            stream.write(_summary(results, "summary"))
            stream.flush()
            if stream.seekable():
                os.fsync(stream.fileno())


class ClassicReporter(Reporter):
    """Prints to standard output what the C++ framework printed.

    ``detail`` adds the places; with the option ``summary`` ``no`` the totals are left out.
    """

    plugin_name = "classic"
    patience = 600.0  # a person may hold the screen

    _stream: TextIO | None = None
    _coloured = False

    def open(self) -> None:
        self._stream = sys.stdout
        self._coloured = wants_colour(sys.stdout, self.options.colour)

    def handle(self, event: Event, results: RunResult) -> None:
        for line in _lines(event, results):
            if line.critical or self.options.verbosity > 0:
                self._print(_formatted(line, detail=self.options.detail, coloured=self._coloured))

    def close(self, results: RunResult) -> None:
        if self.options.extra.get("summary") != "no":
            self._print(_summary(results, "results"))
        self._stream = None

    def _print(self, text: str) -> None:
        stream = self._stream
        if stream is None:
            return
        try:
            stream.write(encodable(text, stream.encoding))
            stream.flush()
        except BrokenPipeError:  # the reader has seen enough
            self._stream = None


# The lines -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Line:
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


def _formatted(line: _Line, *, detail: bool, coloured: bool = False) -> str:
    """Write a line as it is printed, with its place below it in the detail mode."""
    text = f"{line.tag}{line.text}"
    if coloured:
        start = f"\x1b[{_COLOURS[line.kind]}m"
        text = f"{start}{line.tag}\x1b[0m{line.text}" if line.tag else f"{start}{line.text}\x1b[0m"
    return f"{text}\n{line.place}\n\n" if line.place and detail else f"{text}\n"


def _lines(event: Event, results: RunResult) -> Iterator[_Line]:
    """What the C++ framework would say of an event."""
    known = results.tests.get(getattr(event, "test", ""))
    test = known.name if known is not None else getattr(event, "test", "")
    of = results.suites.get(getattr(event, "suite", ""))
    suite = of.name if of is not None else getattr(event, "suite", "") or _RUNNER
    match event:
        case RunStarted():
            yield _Line("Starting test runner.", "start", runner=True)
        case RunEnded():
            yield _Line("Ending test runner.", "start", runner=True)
        case SuiteStarted():
            yield _Line(shown(f"Test suite {suite} started..."), "start")
        case SuiteEnded():
            yield _passed_or_failed(f"Test suite {suite}", event.verdict)
        case TestStarted():
            yield _Line(shown(f"Test case {test} started..."), "start")
        case TestEnded():
            yield from _test_ended(event, test, reported=known is not None and known.problem_count > 0)
        case FixtureIncident() | FixtureChanged() | Diagnosed() | Interrupted() | InternalError():
            yield from _beside_tests(event, suite)
        case _:
            yield from _said_by(event, test or getattr(event, "fixture", "") or suite)


def _said(kind: str, who: str, title: str, detail: str = "", where: str = "") -> _Line:
    return _Line(shown(f"({who}) {title}: {detail}"), kind, where)


def _passed_or_failed(what: str, verdict: Verdict) -> _Line:
    word = "passed" if verdict.good else "failed"
    return _Line(shown(f"{what} {word}!"), word)


def _test_ended(event: TestEnded, test: str, *, reported: bool) -> Iterator[_Line]:
    """The end of a test, and its verdict where neither that nor what was ``reported`` before says it."""
    if not event.final:
        yield _said("info", test, "reports", f"attempt {event.attempt} came to: {event.outcome}; once more")
        return
    if not event.verdict.good and not reported:
        kind = "fail" if event.verdict in (Verdict.FAILED, Verdict.UNEXPECTED_PASS) else "error"
        yield _said(kind, test, event.verdict, event.detail or event.reason)
    elif event.verdict in _NOTED or (event.verdict.good and not event.attempt):
        yield _said("info", test, event.verdict, event.detail)
    yield _passed_or_failed(f"Test case {test}", event.verdict)


def _said_by(event: Event, who: str) -> Iterator[_Line]:
    """What a test, a fixture or a suite says, measures, keeps or writes."""
    match event:
        case Message():
            title = f"{event.subject}: {event.title}" if event.subject else event.title
            where = _where(event.file, event.line)
            yield _said(_KINDS.get(event.severity, "info"), who, title, event.detail, where)
        case Measured() if event.verdict is not MeasurementVerdict.FAILED:  # that is followed by its failure message
            yield _said("info", who, "measures", measurement(event), _where(event.file, event.line))
        case ParametersResolved():
            for row in event.parameters:
                yield _said("info", who, "parameter", f"{row.get('name', '')} = {parameter(row)}")
        case SubResultEnded():
            detail = f"{event.verdict}: {event.reason}" if event.reason else event.verdict
            yield _said("info", who, event.subject, detail)
        case Attached() | SeriesRecorded():
            word = "attaches" if isinstance(event, Attached) else "records"
            yield _said("info", who, word, f"{event.name}: {event.path}")
        case Asked():
            yield _said("info", who, "asks", event.text)
        case Answered():
            answer = "no answer" if event.answer is None else event.answer
            yield _said("info", who, "answer", f"{answer} ({event.source})")
        case OutputCaptured():
            if event.omitted:
                yield _said("info", who, event.stream, f"({event.omitted} bytes left out)")
            yield from (_said("info", who, event.stream, text) for text in event.text.removesuffix("\n").split("\n"))
        case StackDumped():
            yield _said("info", who, "stacks", f"{event.cause}\n{event.text.rstrip()}")


def _beside_tests(event: Event, suite: str) -> Iterator[_Line]:
    """What happens to a fixture, to a suite as it is read, and to the run."""
    match event:
        case FixtureIncident():
            parts = (incident(event), event.traceback, event.output)
            detail = "\n".join(part.rstrip("\n") for part in parts if part)
            yield _said("error", suite, "Fixture collapsed", detail)
        case FixtureChanged(state=FixtureState.FAILED):
            yield _said("error", suite, "Fixture collapsed", f"{event.fixture} is given up: {event.detail}")
        case FixtureChanged(state=FixtureState.STARTING) if event.generation > 1:
            detail = f"restarting fixture setup of {event.fixture} (#{event.generation})"
            yield _said("info", suite, "reports", detail)
        case FixtureChanged():
            yield _said("info", suite, "reports", f"fixture {event.fixture} #{event.generation} is {event.state}")
        case Diagnosed():
            where = place(event.file, event.line, event.column)
            text = f"{event.text}; {event.hint}" if event.hint else event.text
            kind = "error" if event.severity in _KINDS else "info"
            yield _said(kind, suite, "loading", f"{where}: {text}" if where else text)
        case Interrupted():
            yield _said("error", _RUNNER, "interrupted!", event.source)
        case InternalError():
            yield _said("error", _RUNNER, "internal error", f"{event.text}\n{event.traceback}".rstrip())


def _where(file: str, line: int) -> str:
    return f"{place(file)} at {line}." if line else ""


def _summary(results: RunResult, title: str) -> str:
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
