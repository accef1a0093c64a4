"""The run in the Common Test Report Format, https://ctrf.io, for the tools that read it.

Written to specification 0.1.0: ``retryAttempts`` is what came before the last attempt, and ``retries`` their number.
CTRF knows five statuses; ``rawStatus`` has RTF's verdict. What is no test (a fixture that collapsed, a suite that
could not be loaded) is a test of its own, ``failed`` exactly when it is a reason for RTF's exit code, else ``other``.
A test that has not ended is ``pending``: the file was written while the run went on, and its runner killed.
What has no place in the format is below ``extra.rtf``; the ``json`` report has all of it.
"""

from __future__ import annotations

import uuid
from collections import Counter
from typing import TYPE_CHECKING, Any, BinaryIO

from rtf import clock
from rtf.testing.events import (
    Attached,
    Event,
    Measured,
    Message,
    OutputCaptured,
    ParametersResolved,
    SeriesRecorded,
    StackDumped,
    SubResultEnded,
)
from rtf.testing.report.files import AttemptEvents, FileReporter, members, separated, to_json
from rtf.testing.report.problems import of_run, of_suite
from rtf.testing.report.text import near_path, problem_text, shown
from rtf.testing.verdict import Severity, Verdict

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.testing.report.problems import Problem
    from rtf.testing.results import RunResult, TestResult

SPECIFICATION = "0.1.0"

_STATUS = {
    Verdict.PASSED: "passed",
    Verdict.MEASURED: "passed",
    Verdict.FLAKY: "passed",
    Verdict.SKIPPED: "skipped",
    Verdict.BLOCKED: "skipped",
    Verdict.NOT_RUN: "pending",
    Verdict.EXPECTED_FAILURE: "other",
}
_KILLED = "not run: the runner was killed"
_STATUSES = ("passed", "failed", "skipped", "pending", "other")


class CtrfReporter(FileReporter):
    """Writes ``ctrf.json`` when the run is over. Without a target it writes to standard output."""

    plugin_name = "ctrf"
    default_file = "ctrf.json"

    def open(self) -> None:
        self._first: float | None = None
        self._last = 0.0
        super().open()

    def handle(self, event: Event, results: RunResult) -> None:
        if self._first is None:
            self._first = event.time
        self._last = event.time
        super().handle(event, results)

    def entry(self, result: TestResult, attempts: list[AttemptEvents], results: RunResult) -> bytes:
        suite, program = results.suite_of(result.id), results.tests.get(result.planned.parent)
        suites = [suite.name if suite is not None else "", *([program.name] if program is not None else [])]
        if result.verdict is None and not attempts:
            record = {"name": result.name or "(unnamed)", "status": "pending", "rawStatus": "not run", "duration": 0}
            return to_json({**record, "suite": suites, "message": _KILLED})
        return to_json(self._test(result, suites, attempts))

    def document(self, stream: BinaryIO, results: RunResult) -> None:
        statuses: Counter[str] = Counter()
        stream.write(to_json(self._head(results))[:-1] + b',\n"results":{"tests":[')
        stream.writelines(separated(self._items(results, statuses)))
        stream.write(b"],\n" + to_json(self._tail(results, statuses))[1:] + b"}\n")

    def _items(self, results: RunResult, statuses: Counter[str]) -> Iterator[bytes]:
        for suite in results.suites.values():
            statuses.update(_status(result.verdict or Verdict.NOT_RUN) for result in suite.tests.values())
            yield from self.entries(suite.tests)
            yield from (_problem(problem, suite.name, statuses) for problem in of_suite(suite))
        yield from (_problem(problem, "run", statuses) for problem in of_run(results))

    def _head(self, results: RunResult) -> dict[str, Any]:
        run = results.started.run if results.started else ""
        return {
            "reportFormat": "CTRF",
            "specVersion": SPECIFICATION,
            "reportId": _uuid(f"rtf:run:{run}:{self._milliseconds(self._first)}"),
            "timestamp": clock.iso(round(self._last, 6)),
            "generatedBy": "rtf",
        }

    def _tail(self, results: RunResult, statuses: Counter[str]) -> dict[str, Any]:
        started = results.started
        start, stop = self._milliseconds(self._first), self._milliseconds(self._last)
        flaky = results.counts()[Verdict.FLAKY]
        summary = {"tests": statuses.total(), **{status: statuses[status] for status in _STATUSES}, "flaky": flaky}
        summary |= {"suites": len(results.suites), "start": start, "stop": stop, "duration": max(0, stop - start)}
        environment: dict[str, Any] = {"extra": {"rtf": started.environment if started else {}}}
        if started and started.robot:
            environment["testEnvironment"] = started.robot
        return {
            "tool": {"name": "rtf", "version": started.version if started else ""},
            "summary": summary,
            "environment": environment,
            "extra": {"rtf": {"run": members(started, "environment") if started else {}}},
        }

    @staticmethod
    def _milliseconds(time: float | None) -> int:
        return int(round(time or 0.0, 6) * 1000)

    # One test ----------------------------------------------------------------------------------------------------

    def _test(self, result: TestResult, suites: list[str], attempts: list[AttemptEvents]) -> dict[str, Any]:
        planned, ended = result.planned, result.last
        verdict = result.verdict or Verdict.NOT_RUN
        attempts = [attempt for attempt in attempts if attempt.ended is not None] or attempts
        last = attempts[-1] if attempts else AttemptEvents()
        record: dict[str, Any] = {
            "id": _uuid(f"rtf:test:{result.id}"),
            "name": result.name or "(unnamed)",
            "status": _status(verdict),
            "rawStatus": verdict,
            "suite": suites,
            **self._times(last),
        }
        if planned.file:
            record["filePath"] = near_path(planned.file)
        if planned.line > 0:
            record["line"] = planned.line
        if planned.tags:
            record["tags"] = planned.tags
        if planned.type:
            record["type"] = planned.type
        if result.verdict is None:
            record["message"] = _KILLED
        elif ended is not None and (ended.detail or verdict is not Verdict.PASSED):
            record["message"] = ended.detail or ended.reason or verdict
        earlier = attempts[:-1]
        if earlier:
            record |= {"retries": len(earlier), "flaky": verdict is Verdict.FLAKY}
            record["retryAttempts"] = [self._earlier(number, attempt) for number, attempt in enumerate(earlier, 1)]
        return record | self._details(last) | self._beyond(result, last)

    def _times(self, attempt: AttemptEvents) -> dict[str, int]:
        started, ended = attempt.started, attempt.ended
        times = {"duration": max(0, round(ended.duration * 1000)) if ended else 0}
        if started is not None:
            times["start"] = self._milliseconds(started.time)
        if ended is not None:
            times["stop"] = self._milliseconds(ended.time)
        return times

    def _earlier(self, number: int, attempt: AttemptEvents) -> dict[str, Any]:
        ended = attempt.ended
        outcome = ended.outcome if ended else Verdict.NOT_RUN
        record = {"attempt": number, "status": _status(outcome), **self._times(attempt)}
        if ended is not None and (ended.detail or ended.reason):
            record["message"] = ended.detail or ended.reason
        details = self._details(attempt)
        allowed = ("trace", "stdout", "stderr", "attachments")
        return record | {name: details[name] for name in allowed if name in details}

    def _details(self, attempt: AttemptEvents) -> dict[str, Any]:
        """What the events of an attempt say that CTRF has a word for."""
        details: dict[str, Any] = {}
        trace = [text for text in map(_trace, attempt.events) if text]
        for event in attempt.events:
            if isinstance(event, OutputCaptured):
                stream = "stderr" if event.stream == "stderr" else "stdout"
                details.setdefault(stream, []).extend(event.text.splitlines())
            elif isinstance(event, Attached):
                details.setdefault("attachments", []).append(self._file(event.name, event.path, event.media_type))
            elif isinstance(event, SeriesRecorded):
                details.setdefault("attachments", []).append(self._file(event.name, event.path, "application/x-npz"))
            elif isinstance(event, SubResultEnded):
                details.setdefault("steps", []).append({"name": event.subject, "status": _status(event.verdict)})
            elif isinstance(event, ParametersResolved):
                details["parameters"] = {row.get("name", ""): row.get("value", "") for row in event.parameters}
        if trace:
            details["trace"] = "\n".join(trace)
        return details

    def _beyond(self, result: TestResult, attempt: AttemptEvents) -> dict[str, Any]:
        extra: dict[str, Any] = {"id": result.id, "plugin": result.planned.plugin, "param": result.planned.param}
        if result.description:
            extra["description"] = result.description
        measured = [members(event, "test") for event in attempt.events if isinstance(event, Measured)]
        if measured:
            extra["measurements"] = measured
        if attempt.started is not None and attempt.started.fixtures:
            extra["fixtures"] = attempt.started.fixtures
        return {"extra": {"rtf": extra}}

    def _file(self, name: str, path: str, media_type: str) -> dict[str, str]:
        return {"name": name, "contentType": media_type, "path": near_path(str(self.options.run_folder / path))}


def _uuid(name: str) -> str:
    """An identifier that is the same whenever the report is made again."""
    return str(uuid.uuid5(uuid.NAMESPACE_URL, shown(name)))


def _trace(event: Event) -> str:
    if isinstance(event, Message) and event.severity in (Severity.FAILURE, Severity.ERROR):
        return problem_text(event)
    return f"{event.cause}\n{event.text}" if isinstance(event, StackDumped) else ""


def _status(verdict: Verdict) -> str:
    return _STATUS.get(verdict, "failed")


def _problem(problem: Problem, suite: str, statuses: Counter[str]) -> bytes:
    status = "failed" if problem.red else "other"
    statuses[status] += 1
    record = {
        "name": problem.name,
        "status": status,
        "rawStatus": problem.kind,
        "duration": 0,
        "suite": [suite],
        "message": problem.message or problem.name,
        "trace": problem.text,
    }
    return to_json(record)
