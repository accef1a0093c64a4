"""The run as one JSON document: everything the events said, in order, under stable names.

``result.schema.json`` beside this file describes it. ``version`` grows when a member changes its meaning, not when
one is added, so readers must pass over members they do not know. Members of messages, measurements and the like are
left out where they have their default value. Numbers that JSON lacks are the words ``NaN``, ``Infinity`` and
``-Infinity``. The order of suites and tests is that of the plan; each test stands on a line of its own. In a document
that was written while the run went on, a test that has not ended is ``not run``, and the run has no ``ended``.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, BinaryIO

from rtf import clock
from rtf.testing.events import (
    Answered,
    Asked,
    Attached,
    Event,
    FixtureChanged,
    FixtureIncident,
    Measured,
    Message,
    OutputCaptured,
    ParametersResolved,
    PhaseStarted,
    RunStarted,
    SeriesRecorded,
    StackDumped,
    SubResultEnded,
    SuiteEnded,
    TestEnded,
    TestStarted,
)
from rtf.testing.report.files import FileReporter, members, separated, to_json
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from rtf.testing.report.files import AttemptEvents
    from rtf.testing.results import RunResult, SuiteResult, TestResult

FORMAT = "rtf-result"
VERSION = 2

#: Where each kind of event goes in the record of an attempt.
_LISTS: dict[type[Event], str] = {
    PhaseStarted: "phases",
    Message: "messages",
    Measured: "measurements",
    SeriesRecorded: "series",
    SubResultEnded: "parts",
    Attached: "attachments",
    Asked: "questions",
    Answered: "answers",
    OutputCaptured: "output",
    StackDumped: "stacks",
}


#: What belongs to a suite and not to one of its tests.
_SAID = (Message, OutputCaptured, StackDumped, Attached)
_BESIDE_TESTS = ("messages", "output", "stacks", "attachments", "fixtures")


class JsonReporter(FileReporter):
    """Writes ``result.json`` when the run is over. Without a target it writes to standard output."""

    plugin_name = "json"
    default_file = "result.json"

    def open(self) -> None:
        self._suites: dict[str, dict[str, Any]] = {}
        self._suite_of_fixture: dict[str, str] = {}
        self._began: float | None = None
        self._ended: set[str] = set()
        self._earlier: dict[str, list[dict[str, Any]]] = {}  # attempts before the run was resumed, and the test with it
        super().open()

    def handle(self, event: Event, results: RunResult) -> None:
        if isinstance(event, TestStarted) and event.test in self._ended:
            self._earlier[event.test] = json.loads(self.kept(event.test))["attempts"]
            self._ended.remove(event.test)
        super().handle(event, results)
        if isinstance(event, TestEnded) and event.final and event.test in results.tests:
            self._ended.add(event.test)
        elif isinstance(event, FixtureChanged | FixtureIncident) or (isinstance(event, _SAID) and not event.test):
            self._beside_tests(event, results)
        elif isinstance(event, SuiteEnded):
            self._put_suite(event.suite)
        elif isinstance(event, RunStarted) and self._began is None:
            self._began = event.time

    def entry(self, result: TestResult, attempts: list[AttemptEvents], results: RunResult) -> bytes:  # noqa: ARG002 - as the base has it
        record = _test(result, attempts)
        record["attempts"] = self._earlier.get(result.id, []) + record["attempts"]
        return to_json(record)

    # Suites and fixtures -----------------------------------------------------------------------------------------

    def _beside_tests(self, event: Event, results: RunResult) -> None:
        fixture: str = getattr(event, "fixture", "")
        suite: str = getattr(event, "suite", "") or self._suite_of_fixture.get(fixture, "")
        if suite not in results.suites:
            suite = ""
        record = self._suite(suite)
        if not fixture:
            record[_LISTS[type(event)]].append(members(event, "suite"))
            return
        self._suite_of_fixture[fixture] = suite
        if isinstance(event, FixtureChanged):
            _enter_state(_fixture(record, fixture), event)
        elif isinstance(event, FixtureIncident):
            _fixture(record, fixture)["incidents"].append(members(event, "suite", "fixture"))
        else:
            _fixture(record, fixture)[_LISTS[type(event)]].append(members(event, "suite", "fixture"))

    def _suite(self, suite: str) -> dict[str, Any]:
        """The record of what is beside a suite's tests, to be added to."""
        record = self._suites.get(suite)
        if record is None:
            record = self._suites[suite] = self._stored(suite)
        return record

    def _stored(self, suite: str) -> dict[str, Any]:
        kept = json.loads(self.kept(f"{suite} suite") or b"{}")
        return {**{member: [] for member in _BESIDE_TESTS}, **kept}

    def _put_suite(self, suite: str) -> None:
        record = self._suites.pop(suite, None)
        if record is not None:
            self.keep(f"{suite} suite", to_json(record))

    # The document ------------------------------------------------------------------------------------------------

    def document(self, stream: BinaryIO, results: RunResult) -> None:
        head = {
            "format": FORMAT,
            "version": VERSION,
            "run": _run(results, self._began),
            "diagnostics": [members(event) for event in results.diagnostics],
            "internal_errors": [members(event) for event in results.internal_errors],
            **self._suite(""),
        }
        stream.write(to_json(head)[:-1] + b',\n"suites":[')
        for index, suite in enumerate(results.suites.values()):
            beside = self._suites.get(suite.id) or self._stored(suite.id)
            record = to_json({**_suite_head(suite), **beside})
            stream.write((b",\n" if index else b"\n") + record[:-1] + b',\n"tests":[\n')
            stream.writelines(separated(self.entries(suite.tests)))
            stream.write(b"]}")
        stream.write(b"]}\n")


def _moment(time: float | None) -> str | None:
    return None if time is None else clock.iso(round(time, 6))


def _run(results: RunResult, began: float | None) -> dict[str, Any]:
    started, ended, stopped = results.started, results.ended, results.interrupted
    return {
        "id": started.run if started else "",
        "rtf": started.version if started else "",
        "command": started.command if started else (),
        "environment": started.environment if started else {},
        "robot": started.robot if started else "",
        "station": started.station if started else "",
        "device": started.device if started else {},
        "seed": started.seed if started else None,
        "resumed": started.resumed if started else False,
        "started": _moment(began),
        "ended": _moment(ended.time) if ended else None,
        "duration": ended.duration if ended else None,
        "verdict": ended.verdict if ended else results.verdict(),
        "exit_code": ended.exit_code if ended else None,
        "counts": {str(verdict): count for verdict, count in results.counts().items()},
        "interrupted": {"source": stopped.source, "stage": stopped.stage} if stopped else None,
    }


def _suite_head(suite: SuiteResult) -> dict[str, Any]:
    planned, ended = suite.planned, suite.ended
    return {
        "id": suite.id,
        "name": suite.name,
        "file": planned.file,
        "description": planned.description,
        "environment": planned.environment,
        "needs": planned.fixtures,
        "tags": planned.tags,
        "started": _moment(suite.started),
        "ended": _moment(ended.time) if ended else None,
        "duration": ended.duration if ended else None,
        "verdict": ended.verdict if ended else None,
        "counts": {str(verdict): count for verdict, count in suite.counts().items()},
    }


def _fixture(suite: dict[str, Any], name: str) -> dict[str, Any]:
    for fixture in suite["fixtures"]:
        if fixture["name"] == name:
            found: dict[str, Any] = fixture
            return found
    lists = ("generations", "incidents", "messages", "output", "stacks", "attachments")
    made: dict[str, Any] = {"name": name, **{member: [] for member in lists}}
    suite["fixtures"].append(made)
    return made


def _enter_state(fixture: dict[str, Any], event: FixtureChanged) -> None:
    generations = fixture["generations"]
    if not generations or generations[-1]["generation"] != event.generation:
        generations.append({"generation": event.generation, "pid": event.pid, "states": []})
    generations[-1]["pid"] = generations[-1]["pid"] or event.pid
    generations[-1]["states"].append(members(event, "suite", "fixture", "generation", "pid"))


def _test(result: TestResult, attempts: list[AttemptEvents]) -> dict[str, Any]:
    planned, last = result.planned, result.last
    lost = "the runner was killed" if result.verdict is None else ""
    return {
        "id": result.id,
        "name": result.name,
        "description": result.description,
        "parent": planned.parent,
        "plugin": planned.plugin,
        "type": planned.type,
        "param": planned.param,
        "tags": planned.tags,
        "file": planned.file,
        "line": planned.line,
        "expected": planned.expected,
        "repetition": planned.repetition,
        "retries": planned.retries,
        "run_timeout": planned.run_timeout,
        "verdict": result.verdict or Verdict.NOT_RUN,
        "reason": "not run" if lost else last.reason if last else "",
        "detail": lost or (last.detail if last else ""),
        "duration": result.duration,
        "attempts": [_attempt(attempt) for attempt in attempts],
    }


def _attempt(attempt: AttemptEvents) -> dict[str, Any]:
    started, ended = attempt.started, attempt.ended
    lists: dict[str, list[dict[str, Any]]] = {name: [] for name in _LISTS.values()}
    parameters: tuple[dict[str, str], ...] = ()
    for event in attempt.events:
        name = _LISTS.get(type(event))
        if name is not None:
            lists[name].append(members(event, "test"))
        elif isinstance(event, ParametersResolved):
            parameters = event.parameters
    return {
        "attempt": ended.attempt if ended else started.attempt if started else 0,
        "outcome": ended.outcome if ended else None,
        "reason": ended.reason if ended else "",
        "detail": ended.detail if ended else "",
        "started": _moment(started.time) if started else None,
        "ended": _moment(ended.time) if ended else None,
        "duration": ended.duration if ended else 0.0,
        "pid": started.pid if started else 0,
        "exit_status": ended.exit_status if ended else None,
        "signal": ended.signal if ended else "",
        "cpu_time": ended.cpu_time if ended else 0.0,
        "max_rss": ended.max_rss if ended else 0,
        "fixtures": started.fixtures if started else {},
        "parameters": parameters,
        **lists,
    }
