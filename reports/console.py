"""What a person sees of a run: a line a test, and on a terminal a region that tells what is going on right now.

Results go to standard output, diagnostics to standard error. Verbosity -1 shows what did not pass and the verdict; 0 a
line a test; 1 messages and measurements, too; 2 what fixtures and tests wrote, as well. The last line is the verdict.
Into a pipe, a file or a CI log nothing moves and, unless ``FORCE_COLOR`` says so, nothing is coloured. Whatever a test
says is shown with its control characters written out.

What several tests or incidents have in common is said once. The tracebacks of tests whose fixture was lost, and of
parameters that do not fit, tell of RTF and not of a mistake in the test; they are shown from verbosity 1 on.

The option ``reports`` names the files that other reporters write, separated by ``:``; they are listed at the end. With
``summary`` ``no`` the end is the verdict alone.
"""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from msgspec.structs import replace

from rtf.testing.events import (
    Answered,
    Asked,
    Diagnosed,
    Event,
    FixtureChanged,
    FixtureIncident,
    InternalError,
    Interrupted,
    Measured,
    Message,
    OutputCaptured,
    PhaseStarted,
    Progressed,
    StackDumped,
    SubResultEnded,
    SuiteStarted,
    TestEnded,
    TestStarted,
)
from rtf.testing.measurement import MeasurementVerdict
from rtf.testing.report import text as report_text
from rtf.testing.report.text import measurement, one_line, place, problem_text, sentence, shown
from rtf.testing.reporting import Reporter, ReportOptions
from rtf.testing.verdict import FixtureState, Severity, Verdict

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.testing.report.live import Region
    from rtf.testing.results import RunResult, TestResult

_STYLES = {
    Verdict.PASSED: "32",
    Verdict.MEASURED: "32",
    Verdict.SKIPPED: "33",
    Verdict.EXPECTED_FAILURE: "33",
    Verdict.FLAKY: "33",
    Verdict.BLOCKED: "35",
    Verdict.NOT_RUN: "35",
    Verdict.INTERRUPTED: "35",
}
_BAD, _DIM, _BOLD, _WARNING = "31", "2", "1", "33"
_SEVERITIES = {Severity.FAILURE: _BAD, Severity.ERROR: _BAD, Severity.WARNING: _WARNING, Severity.DEBUG: _DIM}

_SLOW = 1.0
_SLOWEST = 5
_TAIL_LINES = 5
_VERDICT_WIDTH = 12
_NAMED = 3  # more tests that were not begun for one reason are counted, not named

#: What being asked to stop does, and what being asked again would; after that nothing is waited for.
_STAGES = {
    1: "the running test goes on to its end, then the run stops; once more stops the test now",
    2: "stopping the running test; once more kills it",
}
#: A parameter that does not fit: the message says where it was given, which a place in RTF's own code does not.
_WRONG_PARAMETER = "ParameterError: "


class ConsoleReporter(Reporter):
    """Shows a run to a person. Writes no file."""

    plugin_name = "console"
    patience = 600.0  # a person may hold the screen

    def __init__(self, options: ReportOptions) -> None:
        super().__init__(options)
        self._out: TextIO | None = None
        self._err: TextIO = sys.stderr
        self._coloured = False
        self._err_coloured = False
        self._region: Region | None = None
        self._suite = ""
        self._reason = ""  # why tests were not begun, as it was said last
        self._incidents_said: dict[tuple[str, str], FixtureIncident] = {}  # the last of each fixture of a suite
        self._errors_said: set[str] = set()
        self._handlers = self._choose_handlers(options.verbosity)

    def open(self) -> None:
        """Find out where and to whom it is shown."""
        self._out, self._err = sys.stdout, sys.stderr
        self._coloured = report_text.wants_colour(self._out, self.options.colour)
        self._err_coloured = report_text.wants_colour(self._err, self.options.colour)
        moving = report_text.capable_terminal(self._out) and not os.environ.get("CI")
        if moving and self.options.verbosity >= 0 and self.options.extra.get("moving") != "no":
            from rtf.testing.report.live import Region

            self._region = Region(self._out, coloured=self._coloured)

    def handle(self, event: Event, results: RunResult) -> None:
        """Show one event."""
        handler = self._handlers.get(type(event))
        if handler is not None:
            handler(event, results)
        if self._region is not None:
            self._region.take(event, results)

    def close(self, results: RunResult) -> None:
        """Tell what it came to; the verdict is the last line."""
        if self._region is not None:
            self._region.close()
            self._region = None
        if self._out is None:
            return
        if self.options.verbosity >= 0 and self.options.extra.get("summary") != "no":
            self._failures(results)
            self._incidents(results)
            self._slowest(results)
            self._paths()
        elif self.options.verbosity < 0:
            self._not_begun(results)
        self._verdict(results)
        self._out = None

    def _choose_handlers(self, verbosity: int) -> dict[type[Event], Callable[..., None]]:
        handlers: dict[type[Event], Callable[..., None]] = {
            Diagnosed: self._diagnosed,
            InternalError: self._internal_error,
            Interrupted: self._interrupted,
            FixtureIncident: self._incident,
            FixtureChanged: self._fixture,
            TestEnded: self._test_ended,
            Asked: self._asked,
            Answered: self._answered,
            Message: self._message,
        }
        if verbosity >= 1:
            handlers |= {
                SuiteStarted: self._suite_started,
                TestStarted: self._test_started,
                Measured: self._measured,
                SubResultEnded: self._part,
                StackDumped: self._stacks,
            }
        if verbosity > 1:
            handlers |= {OutputCaptured: self._output, PhaseStarted: self._phase, Progressed: self._progress}
        return handlers

    # Writing -----------------------------------------------------------------------------------------------------

    def _styled(self, text: str, style: str) -> str:
        return f"\x1b[{style}m{text}\x1b[0m" if self._coloured and style else text

    def _print(self, text: str = "") -> None:
        """Print lines that are safe already."""
        out = self._out
        if out is None:
            return
        text = report_text.encodable(text, out.encoding)
        try:
            if self._region is not None:
                self._region.print(text)
            else:
                out.write(f"{text}\n")
                out.flush()
        except BrokenPipeError:  # the reader has seen enough
            self._out = self._region = None

    def _print_error(self, text: str, style: str = "") -> None:
        if self._region is not None and self._err.isatty():
            self._print(self._styled(text, style))
            return
        text = f"\x1b[{style}m{text}\x1b[0m" if self._err_coloured and style else text
        with suppress(BrokenPipeError):
            self._err.write(f"{report_text.encodable(text, self._err.encoding)}\n")
            self._err.flush()

    def _indented(self, text: str, mark: str = "    ", style: str = "") -> None:
        """Print what somebody said, a mark before each line."""
        for line in shown(text.rstrip("\n")).split("\n"):
            self._print(self._styled(f"{mark}{line}".rstrip(), style))

    # What is beside the tests ------------------------------------------------------------------------------------

    def _diagnosed(self, event: Diagnosed, _results: RunResult) -> None:
        where = place(event.file, event.line, event.column)
        text = f"{event.severity}: {shown(event.text)}"
        self._print_error(f"{where}: {text}" if where else text, _SEVERITIES.get(event.severity, ""))
        if event.hint:
            self._print_error(f"  {shown(event.hint)}")

    def _internal_error(self, event: InternalError, _results: RunResult) -> None:
        if event.text in self._errors_said:  # of several suite workers, for one reason
            return
        self._errors_said.add(event.text)
        self._print_error(f"internal error: {shown(event.text)}", _BAD)
        if event.traceback:
            self._print_error(shown(event.traceback.rstrip("\n")))

    def _interrupted(self, event: Interrupted, _results: RunResult) -> None:
        what = _STAGES.get(event.stage, "killing what still runs")
        self._print_error(f"interrupted by {shown(event.source)}: {what}", _WARNING)

    def _incident(self, event: FixtureIncident, _results: RunResult) -> None:
        fixture = (event.suite, event.fixture)
        last = self._incidents_said.get(fixture)
        self._incidents_said[fixture] = event
        if last is not None and _same_incident(last) == _same_incident(event):
            again = f"fixture {shown(event.fixture)} #{event.generation} in {event.phase}: the same again"
            self._print(self._styled(again, _BAD))
            return
        self._print(self._styled(f"fixture {shown(report_text.incident(event))}", _BAD))
        if self.options.verbosity < 0:
            return
        if event.traceback:
            self._indented(event.traceback)
        tail = event.output.rstrip("\n").split("\n")
        for line in tail if self.options.verbosity > 0 else tail[-_TAIL_LINES:]:
            if line:
                self._indented(line, "    | ", _DIM)

    def _fixture(self, event: FixtureChanged, _results: RunResult) -> None:
        name = f"fixture {shown(event.fixture)} #{event.generation}"
        if event.state is FixtureState.FAILED:
            last = self._incidents_said.get((event.suite, event.fixture))
            repeated = last is not None and event.detail.startswith(last.cause)
            why = event.detail.removeprefix(last.cause) if last is not None and repeated else f": {event.detail}"
            self._print(self._styled(f"{name} is given up{shown(why)}", _BAD))
        elif self.options.verbosity > 0 or (self.options.verbosity == 0 and event.generation > 1):
            words = {FixtureState.STARTING: "is being restarted" if event.generation > 1 else "is being set up"}
            words[FixtureState.READY] = "is back" if event.generation > 1 else "is ready"
            printed = event.state in words if self.options.verbosity == 0 else event.state is not FixtureState.COLLAPSED
            if printed:
                self._print(self._styled(f"{name} {words.get(event.state, f'is {event.state}')}", _DIM))

    def _suite_started(self, event: SuiteStarted, results: RunResult) -> None:
        self._heading(event.suite, results)

    def _heading(self, suite: str, results: RunResult) -> None:
        if suite != self._suite:
            self._suite = suite
            known = results.suites.get(suite)
            self._print(self._styled(f"Suite {one_line(known.name if known else suite)}", _BOLD))

    # Tests -------------------------------------------------------------------------------------------------------

    def _test_started(self, event: TestStarted, results: RunResult) -> None:
        test = results.tests.get(event.test)
        if test is not None:
            self._heading(test.planned.suite, results)
            attempt = f", attempt {event.attempt}" if event.attempt > 1 else ""
            self._print(self._styled(f"  {'running':<{_VERDICT_WIDTH}}  {one_line(test.name)}{attempt}", _DIM))

    def _test_ended(self, event: TestEnded, results: RunResult) -> None:
        test = results.tests.get(event.test)
        quiet = self.options.verbosity < 0
        if test is None or (quiet and (event.verdict.good or not event.final or not event.attempt)):
            return
        if self.options.verbosity >= 0:
            self._heading(test.planned.suite, results)
        verdict = event.verdict if event.final else event.outcome
        style = _STYLES.get(verdict, _BAD)
        name = one_line(test.name) if self.options.verbosity >= 0 else one_line(test.id)
        again = "" if event.final else f"  (attempt {event.attempt}, once more)"
        word = self._styled(f"{verdict:<{_VERDICT_WIDTH}}", style)
        elapsed = f"  {report_text.duration(event.duration)}" if event.attempt and event.duration else ""
        self._print(f"  {word}  {name}{elapsed}{again}")
        if event.verdict is Verdict.PASSED or not event.detail:
            return
        if event.attempt or event.detail != self._reason:
            self._print(f"      {one_line(event.detail)}{self._where(test)}")
        if not event.attempt:
            self._reason = event.detail

    @staticmethod
    def _where(test: TestResult) -> str:
        where = place(test.problems[0].file, test.problems[0].line) if test.problems else ""
        return f"  ({where})" if where else ""

    def _message(self, event: Message, _results: RunResult) -> None:
        """Show a message: those of tests from verbosity 1 on, failures of suites and fixtures always."""
        style = _SEVERITIES.get(event.severity, "")
        if self.options.verbosity > 0 or (not event.test and style == _BAD):
            who = f"fixture {event.fixture}: " if event.fixture else ""
            where = place(event.file, event.line)
            text = shown(f"{who}{sentence(event)}").replace("\n", "\n               ")
            word = self._styled(f"{event.severity:<7}", style)
            self._print(f"      {word}  {text}{f'  ({where})' if where else ''}")
            if event.traceback:
                self._indented(event.traceback, "               ", _DIM)

    def _measured(self, event: Measured, _results: RunResult) -> None:
        bad = event.verdict is MeasurementVerdict.FAILED
        style = _BAD if bad else _WARNING if event.verdict is MeasurementVerdict.MARGINAL else ""
        self._print(f"      {self._styled('measure', style)}  {one_line(measurement(event))}")

    def _part(self, event: SubResultEnded, _results: RunResult) -> None:
        reason = f": {one_line(event.reason)}" if event.reason else ""
        word = self._styled(event.verdict, _STYLES.get(event.verdict, _BAD))
        self._print(f"      part     {one_line(event.subject)} {word}{reason}")

    def _stacks(self, event: StackDumped, _results: RunResult) -> None:
        self._print(f"      stacks   {one_line(event.cause)}")
        self._indented(event.text, "      | ", _DIM)

    def _output(self, event: OutputCaptured, _results: RunResult) -> None:
        fixture = f"[fixture {one_line(event.fixture)}] " if event.fixture else ""
        mark = f"      {fixture}{one_line(event.stream)} | "
        if event.omitted:
            self._print(self._styled(f"{mark}… {event.omitted} bytes left out …", _DIM))
        self._indented(event.text, mark, _DIM)

    def _phase(self, event: PhaseStarted, _results: RunResult) -> None:
        limit = f" (at most {report_text.duration(event.limit)})" if event.limit is not None else ""
        count = f" {event.repetition}" if event.repetition else ""
        self._print(self._styled(f"      phase    {event.phase}{count}{limit}", _DIM))

    def _progress(self, event: Progressed, _results: RunResult) -> None:
        self._print(self._styled(f"      {100 * event.fraction:.0f} %  {one_line(event.text)}".rstrip(), _DIM))

    def _asked(self, event: Asked, _results: RunResult) -> None:
        choices = f" [{' / '.join(event.choices)}]" if event.choices else ""
        self._print(shown(f"  question     {event.text}{choices}  ({report_text.duration(event.timeout)})"))

    def _answered(self, event: Answered, _results: RunResult) -> None:
        answer = "no answer" if event.answer is None else event.answer
        self._print(shown(f"  answer       {answer} ({event.source})"))

    # The end -----------------------------------------------------------------------------------------------------

    def _failures(self, results: RunResult) -> None:
        bad = [test for test in results.tests.values() if test.verdict is not None and not test.verdict.good]
        if bad or any(suite.problems for suite in results.suites.values()):
            self._print(self._styled("\nFailures", _BOLD))
        alike: dict[tuple[Verdict, tuple[str, ...]], list[TestResult]] = {}
        for test in bad:
            verdict = test.verdict or Verdict.NOT_RUN
            alike.setdefault((verdict, self._reasons(test, verdict)), []).append(test)
        for (verdict, reasons), tests in alike.items():
            self._alike(verdict, tests)
            for reason in reasons:
                self._indented(reason, "      ")
            planned = tests[0].planned
            if not tests[0].problems and len(tests) == 1 and planned.file:
                self._print(f"        at {place(planned.file, planned.line)}")
        for suite in results.suites.values():
            for message in suite.problems:
                self._print(f"  {self._styled(str(message.severity), _BAD)}  suite {one_line(suite.name)}")
                self._indented(problem_text(message), "      ")

    def _alike(self, verdict: Verdict, tests: list[TestResult], width: int = 0) -> None:
        """Name tests of which the same is to be said; of those that were not begun the number says enough."""
        word = self._styled(f"{verdict:<{width}}", _STYLES.get(verdict, _BAD))
        if len(tests) > _NAMED and not verdict.ran and not any(test.problems for test in tests):
            self._print(f"  {word}  {len(tests)} tests: {one_line(tests[0].id)} … {one_line(tests[-1].id)}")
            return
        for test in tests:
            self._print(f"  {word}  {one_line(test.id)}")

    def _not_begun(self, results: RunResult) -> None:
        """Say once of all tests that were not begun for one reason what each would say."""
        alike: dict[tuple[Verdict, str], list[TestResult]] = {}
        for test in results.tests.values():
            if test.last is not None and not test.last.attempt and not test.last.verdict.good:
                alike.setdefault((test.last.verdict, test.last.detail), []).append(test)
        for (verdict, reason), tests in alike.items():
            self._alike(verdict, tests, width=_VERDICT_WIDTH)
            if reason:
                self._indented(reason, "      ")

    def _reasons(self, test: TestResult, verdict: Verdict) -> tuple[str, ...]:
        """Why a test is not good: what it said, else the sentence of its end; nothing twice."""
        ending = test.last.detail if test.last else ""
        lost = verdict is Verdict.FIXTURE_LOST
        reasons = [ending] if ending and (lost or not test.problems) else []
        for message in test.problems:
            ours = lost or message.detail.startswith(_WRONG_PARAMETER)
            brief = ours and self.options.verbosity <= 0
            reasons.append(problem_text(replace(message, traceback="") if brief else message))
        left_out = test.problem_count - len(test.problems)
        if left_out:
            reasons.append(f"… {left_out} more in the journal")
        return tuple(dict.fromkeys(reasons))

    def _incidents(self, results: RunResult) -> None:
        alike: dict[tuple[str, str], list[FixtureIncident]] = {}
        for suite in results.suites.values():
            for event in suite.incidents:
                sentence_of_any = report_text.incident(replace(event, generation=0))
                alike.setdefault((suite.id, sentence_of_any), []).append(event)
        if alike:
            self._print(self._styled("\nFixture incidents", _BOLD))
        for first, *more in alike.values():
            again = f"  (and {len(more)} more like it, up to #{more[-1].generation})" if more else ""
            self._print(f"  {one_line(report_text.incident(first))}{again}")

    def _slowest(self, results: RunResult) -> None:
        least = 0.0 if self.options.verbosity > 0 else _SLOW
        tests = sorted(results.tests.values(), key=lambda test: -test.duration)[:_SLOWEST]
        tests = [test for test in tests if test.duration > least]
        if tests:
            self._print(self._styled("\nSlowest tests", _BOLD))
        for test in tests:
            self._print(f"  {report_text.duration(test.duration):>10}  {one_line(test.id)}")

    def _paths(self) -> None:
        paths = [path for path in self.options.extra.get("reports", "").split(os.pathsep) if path]
        self._print(self._styled("\nReports", _BOLD))
        for path in [*paths, str(self.options.run_folder)]:
            reason = self.options.unwritten.get(Path(path), "")
            line = f"  {place(path)}  is not complete: {one_line(reason)}" if reason else f"  {place(path)}"
            self._print(self._styled(line, _BAD if reason else ""))

    def _verdict(self, results: RunResult) -> None:
        verdict = results.ended.verdict if results.ended else results.verdict()
        elapsed = f" in {report_text.duration(results.ended.duration)}" if results.ended else ""
        word = self._styled(str(verdict).upper(), f"1;{'32' if verdict is Verdict.PASSED else _BAD}")
        blank = "\n" if self.options.verbosity >= 0 else ""
        self._print(f"{blank}{word}  {report_text.counts(results.counts())}{elapsed}")


def _same_incident(event: FixtureIncident) -> FixtureIncident:
    """The incident without what distinguishes it from the same one of another generation."""
    return replace(event, generation=0, time=0.0, seq=0)
