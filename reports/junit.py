"""JUnit XML that Jenkins (junit and xunit plug-ins), GitLab and the GitHub readers show truthfully.

There is no standard; ``docs/decisions/0003-junit-writer.md`` says what is written for whom, and why by hand. The
option ``junit-family`` chooses between ``strict`` (default), which is valid against Jenkins' ``junit-10.xsd`` and
therefore says what the schema has no word for as ``[[PROPERTY|name=value]]`` lines in ``system-out``, and ``rich``,
which says it as ``properties`` of the test case, with ``file`` and ``line`` as attributes.

The file is written anew, whole or not at all, while the run goes on. A test that has not ended is an error in it, *not
run: the runner was killed*, until it has; so the file of a run that was killed tells the truth. The file is red exactly
when RTF's exit code is not 0.
"""

from __future__ import annotations

import html
import os
import re
from collections import Counter
from typing import TYPE_CHECKING, BinaryIO

from rtf import clock
from rtf.testing.events import (
    Attached,
    Measured,
    Message,
    OutputCaptured,
    ParametersResolved,
    SeriesRecorded,
    StackDumped,
    SubResultEnded,
)
from rtf.testing.report.files import AttemptEvents, FileReporter
from rtf.testing.report.problems import PASSED_OVER, incident_text, of_run, of_suite
from rtf.testing.report.text import cut, joined, measured, near_path, parameter, place, problem_text, sentence
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rtf.testing.report.problems import Problem
    from rtf.testing.results import RunResult, SuiteResult, TestResult

    Pairs = list[tuple[str, object]]

FAMILIES = ("strict", "rich")

#: What is kept of a case's output, in characters: Jenkins keeps 1000 of a passing one, and GitLab reads 30 MB a file.
_PASSING_LIMIT = 64 * 1024
_FAILING_LIMIT = 1024 * 1024
_EARLIER_LIMIT = 16 * 1024
_MESSAGE_LIMIT = 4096
_PROPERTIES_LIMIT = 200

_FAILURES = (Verdict.FAILED, Verdict.UNEXPECTED_PASS)

_ILLEGAL = re.compile("[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_FOREIGN_MARK = re.compile(r"\[\[(?=\s*(?:ATTACHMENT|PROPERTY))", re.IGNORECASE)
_NOT_IN_A_MARK = re.compile(r"[|\n\r]|\]\]")
_ONE_LINE = {ord("\n"): "\\n", ord("\r"): "\\r"}
_NO_TIME = ("time", "0.000")


class _Names:
    """Gives each case of a class a name that no other has: GitLab passes over a second one of the same name."""

    def __init__(self, given: dict[tuple[str, str], int] | None = None) -> None:
        self._given = given or {}

    def copy(self) -> _Names:
        """Names for the cases that are no tests, which are others each time the file is written."""
        return _Names({**self._given})

    def identity(self, group: str, name: str) -> Pairs:
        """The attributes that say which case it is."""
        name = name or "(unnamed)"
        unique, count = name, self._given.get((group, name), 0)
        while (group, unique) in self._given:
            count += 1
            unique = f"{name}~{count}"
        self._given[group, unique] = 1
        self._given[group, name] = max(count, 1)
        return [("name", unique), ("classname", group)]


class JUnitReporter(FileReporter):
    """Writes ``junit.xml``. Without a target it writes to standard output, once."""

    plugin_name = "junit"
    default_file = "junit.xml"

    def open(self) -> None:
        """Make sure the report can be written. Raises OSError, and ValueError for an unknown family."""
        family = self.options.extra.get("junit-family", FAMILIES[0])
        if family not in FAMILIES:
            raise ValueError(f"junit-family is {family!r}; known families are {' and '.join(FAMILIES)}")
        self._strict = family == "strict"
        self._names = _Names()
        self._identities: dict[str, Pairs] = {}  # of tests; the same each time the file is written
        super().open()

    def entry(self, result: TestResult, attempts: list[AttemptEvents], results: RunResult) -> bytes:
        identity = self._identities.get(result.id)
        if identity is None:
            suite = results.suite_of(result.id)
            group = _class_name(results, suite.name if suite else "")
            identity = self._identities[result.id] = self._names.identity(group, result.label)
        if result.verdict is None and not attempts:
            return f"<testcase{_attributes([*identity, _NO_TIME])}>\n{_NOT_RUN}</testcase>\n".encode()
        return self._case(result, attempts, identity).encode()

    def document(self, stream: BinaryIO, results: RunResult) -> None:
        suites = [*results.suites.values()]
        problems = of_run(results)
        kinds = {suite.id: _kinds(suite) for suite in suites}
        of_run_itself = _kinds_of(problems)
        totals = sum(kinds.values(), Counter(of_run_itself))
        elapsed = sum(map(_elapsed, suites))
        counted: Pairs = [("tests", totals.total()), ("failures", totals["failure"]), ("errors", totals["error"])]
        pairs: Pairs = [("name", "rtf"), *counted, ("time", _seconds(elapsed))]
        names = self._names.copy()
        stream.write(f'<?xml version="1.0" encoding="UTF-8"?>\n<testsuites{_attributes(pairs)}>\n'.encode())
        for suite in suites:
            stream.write(_suite_head(suite, kinds[suite.id], results).encode())
            stream.writelines(self.entries(suite.tests))
            stream.write(_beside_tests(suite, names, results).encode())
        if problems:
            head = _suite_tag("run", of_run_itself, 0.0)
            cases = _problem_cases(problems, _class_name(results, "run"), names)
            stream.write(f"{head}{_properties(_run_facts(results))}{cases}</testsuite>\n".encode())
        stream.write(b"</testsuites>\n")

    # A test ------------------------------------------------------------------------------------------------------

    def _case(self, result: TestResult, attempts: list[AttemptEvents], identity: Pairs) -> str:
        """Verdict, earlier attempts, properties, output."""
        attempts = [attempt for attempt in attempts if attempt.ended is not None] or attempts
        last = attempts[-1] if attempts else AttemptEvents()
        kind, planned = _kind(result), result.planned
        facts = self._facts(result, last, len(attempts))
        head = [*identity, ("time", _seconds(result.duration))]
        parts = []
        if not self._strict:
            head += [("file", near_path(planned.file))] if planned.file else []
            head += [("line", planned.line)] if planned.file and planned.line else []
            parts.append(_properties(facts))
        parts += [_verdict(result, last, kind)] if kind else []
        parts += [_earlier(attempt, "rerunFailure" if kind else "flakyFailure") for attempt in attempts[:-1]]
        out, err = _outputs(last, _FAILING_LIMIT if kind else _PASSING_LIMIT)
        out = self._marks(attempts, facts if self._strict else []) + out
        parts += [_element("system-out", out) if out else "", _element("system-err", err) if err else ""]
        return f"<testcase{_attributes(head)}>\n{''.join(parts)}</testcase>\n"

    def _facts(self, result: TestResult, last: AttemptEvents, attempts: int) -> list[tuple[str, str]]:
        """What is known of a test beside its output, as names and values."""
        planned, ended = result.planned, last.ended
        facts = [("id", result.id), ("name", result.name if result.name != result.label else "")]
        facts += [("verdict", str(result.verdict or Verdict.NOT_RUN))]
        if planned.file and self._strict:
            facts += [("file", near_path(planned.file)), ("line", str(planned.line or ""))]
        facts += [("plugin", planned.plugin), ("param", planned.param), ("description", result.description)]
        facts += [("attempts", str(attempts) if attempts > 1 else "")]
        if ended is not None:
            facts += [("signal", ended.signal), ("exit status", str(ended.exit_status or ""))]
        for event in last.events:
            if isinstance(event, Measured):
                name = f"{event.subject}.{event.name}" if event.subject else event.name
                facts.append((f"measurement.{name}", measured(event)))
            elif isinstance(event, SubResultEnded):
                facts.append((f"part.{event.subject}", f"{event.verdict}: {event.reason}".rstrip(": ")))
            elif isinstance(event, ParametersResolved):
                facts += [(f"parameter.{row.get('name', '')}", parameter(row)) for row in event.parameters]
        facts = [(name, value) for name, value in facts if value]
        if len(facts) > _PROPERTIES_LIMIT:
            left_out = f"{len(facts) - _PROPERTIES_LIMIT} more are in the journal"
            facts = [*facts[:_PROPERTIES_LIMIT], ("left out", left_out)]
        return facts

    def _marks(self, attempts: list[AttemptEvents], properties: list[tuple[str, str]]) -> str:
        """The lines that plug-ins look for, first of all: Jenkins cuts a passing case's output, then searches it."""
        lines = []
        for attempt in attempts:
            for event in attempt.events:
                if isinstance(event, Attached | SeriesRecorded):
                    path = _relative(os.path.join(self.options.run_folder, event.path))  # noqa: PTH118 - no need of a Path
                    lines.append(_defused(path) if _NOT_IN_A_MARK.search(path) else f"[[ATTACHMENT|{path}]]")
        for name, value in properties:
            pair = _defused(cut(f"{name}={value}", _MESSAGE_LIMIT))
            lines.append(f"[[PROPERTY|{pair.replace(']]', '] ]').translate(_ONE_LINE)}]]")
        return "".join(f"{line}\n" for line in lines)


# The elements of a case ----------------------------------------------------------------------------------------------


def _problem_case(problem: Problem, identity: Pairs) -> str:
    """A case for what is no test. What RTF got over is shown as an earlier, failed attempt of a case that passed."""
    parts = [f"<testcase{_attributes([*identity, _NO_TIME])}>\n"]
    message = cut(_filled(problem.message, problem.name), _MESSAGE_LIMIT)
    if problem.red:
        text = cut(_filled(problem.text, message), _FAILING_LIMIT)
        parts.append(_element("error", text, ("type", problem.kind), ("message", message)))
    else:
        for event in problem.incidents:
            cause = cut(_filled(event.cause, message), _MESSAGE_LIMIT)
            head = _attributes([("type", problem.kind), ("message", cause)])
            trace = _element("stackTrace", cut(incident_text(event), _EARLIER_LIMIT))
            parts.append(f"<flakyFailure{head}>{trace}</flakyFailure>\n")
    parts.append(_element("system-out", _defused(cut(problem.text, _PASSING_LIMIT))))
    return "".join([*parts, "</testcase>\n"])


def _kind(result: TestResult) -> str:
    """The element that a test's verdict becomes; none for a pass. A test without one is lost with its runner."""
    verdict = result.verdict
    if verdict is None:
        return "error"
    if verdict in PASSED_OVER:
        return "skipped"
    if verdict.good:
        return ""
    return "failure" if verdict in _FAILURES else "error"


def _verdict(result: TestResult, last: AttemptEvents, kind: str) -> str:
    verdict = result.verdict or (Verdict.NOT_RUN if last.started is None else Verdict.INTERRUPTED)
    ended = last.ended or result.last
    reason, detail = (ended.reason, ended.detail) if ended is not None else ("", _lost(last))
    found = last.problems or result.problems
    problems = [problem_text(one) for one in found]
    message = _filled(detail, problems[0].partition("\n")[0] if problems else "", reason, verdict)
    if verdict not in (Verdict.FAILED, Verdict.ERROR, Verdict.SKIPPED):
        message = f"{verdict}: {message}" if message != verdict else message
    named = verdict is not Verdict.ERROR or not reason
    pairs = [("type", verdict if named else reason), ("message", cut(message, _MESSAGE_LIMIT))]
    text = "\n".join(problems if found and _says(found[0], detail) else [message, *problems])
    return _element(kind, cut(_filled(text, message), _FAILING_LIMIT // 4), *pairs)


def _earlier(attempt: AttemptEvents, name: str) -> str:
    ended = attempt.ended
    if ended is None:
        return ""
    problems = "\n".join(problem_text(event) for event in attempt.problems)
    message = _filled(ended.detail, problems.partition("\n")[0], ended.reason, ended.outcome)
    out, err = _outputs(attempt, _EARLIER_LIMIT)
    head = _attributes([("type", ended.outcome), ("message", cut(message, _MESSAGE_LIMIT))])
    inner = _element("stackTrace", cut(_filled(problems, message), _EARLIER_LIMIT))
    inner += _element("system-out", out) if out else ""
    inner += _element("system-err", err) if err else ""
    return f"<{name}{head}>\n{inner}</{name}>\n"


def _lost(attempt: AttemptEvents) -> str:
    """Why a test has no end: it is in a file that was written while the run went on, and then the run was killed."""
    return "the runner was killed" if attempt.started is None else "the runner was killed while this test was running"


def _filled(*texts: str) -> str:
    """The first text that says something: consumers drop an empty message, and some the failure with it."""
    return next((text for text in texts if text.strip()), "no reason was given")


def _relative(path: str) -> str:
    """Relative to the working directory where it lies below, which is what GitLab and Jenkins look from."""
    return near_path(os.path.normpath(os.path.abspath(path)))  # noqa: PTH100 - links stay as they are


def _says(message: Message, detail: str) -> bool:
    """Whether a message, which has its title before what it says, is what a test ended with."""
    return detail in problem_text(message) or detail == f"{message.subject}: {message.detail}"


def _outputs(attempt: AttemptEvents, limit: int) -> tuple[str, str]:
    """What was said and written to standard output, in order; and what to standard error, with the stacks."""
    out: list[str] = []
    err: list[str] = []
    for event in attempt.events:
        if isinstance(event, Message):
            where = place(event.file, event.line)
            suffix = f" ({where})" if where else ""
            out.append(f"[{event.severity.upper()}] {sentence(event)}{suffix}\n")
        elif isinstance(event, OutputCaptured):
            part = err if event.stream == "stderr" else out
            if event.omitted:
                part.append(f"… {event.omitted} bytes not kept …\n")
            part.append(event.text)
        elif isinstance(event, StackDumped):
            err.append(f"{event.cause}\n{event.text.rstrip()}\n")
    return _defused(cut("".join(out), limit)), _defused(cut("".join(err), limit))


def _defused(text: str) -> str:
    """The text without marks that a plug-in of Jenkins would obey: only ours name files and properties."""
    return _FOREIGN_MARK.sub("[ [", text) if "[[" in text else text


# Suites --------------------------------------------------------------------------------------------------------------


def _kinds(suite: SuiteResult) -> Counter[str]:
    """How many cases of a suite become which element."""
    kinds = Counter(map(_kind, suite.tests.values())) + _kinds_of(of_suite(suite))
    return kinds or Counter({"skipped": 1})


def _kinds_of(problems: list[Problem]) -> Counter[str]:
    return Counter("error" if problem.red else "" for problem in problems)


def _suite_tag(name: str, kinds: Counter[str], elapsed: float, *more: tuple[str, object]) -> str:
    numbers: Pairs = [("tests", kinds.total()), ("failures", kinds["failure"]), ("errors", kinds["error"])]
    pairs = [("name", name), *numbers, ("skipped", kinds["skipped"]), ("time", _seconds(elapsed)), *more]
    return f"<testsuite{_attributes(pairs)}>\n"


def _suite_head(suite: SuiteResult, kinds: Counter[str], results: RunResult) -> str:
    planned, run = suite.planned, results.started
    host = run.environment.get("host", "") if run else ""
    more: Pairs = []
    if suite.started is not None:
        more.append(("timestamp", clock.iso(round(suite.started, 6))))
    more += [("hostname", host)] if host else []
    more.append(("id", suite.id))
    more += [("file", near_path(planned.file))] if planned.file else []
    facts = [("description", planned.description), ("environment", planned.environment)]
    facts += [("tags", " ".join(planned.tags)), ("fixtures", " ".join(planned.fixtures))]
    tag = _suite_tag(suite.name or "(unnamed)", kinds, _elapsed(suite), *more)
    return f"{tag}{_properties([*_run_facts(results), *facts])}"


def _beside_tests(suite: SuiteResult, names: _Names, results: RunResult) -> str:
    group = _class_name(results, suite.name)
    problems = of_suite(suite)
    cases = _problem_cases(problems, group, names)
    if not suite.tests and not problems:  # Jenkins drops a suite without a case
        empty = _attributes([*names.identity(group, "(no tests)"), _NO_TIME])
        skipped = _element("skipped", "the suite has no tests", ("message", "the suite has no tests"))
        cases = f"<testcase{empty}>\n{skipped}</testcase>\n"
    return f"{cases}</testsuite>\n"


def _problem_cases(problems: list[Problem], group: str, names: _Names) -> str:
    return "".join(_problem_case(problem, names.identity(group, problem.name)) for problem in problems)


def _elapsed(suite: SuiteResult) -> float:
    if suite.ended is not None:
        return suite.ended.duration
    return sum(result.duration for result in suite.tests.values())


def _class_name(results: RunResult, suite: str) -> str:
    """``robot.suite``: what stands before the last dot is taken for a package, so the suite has no dot of its own."""
    robot = results.started.robot if results.started else ""
    suite = (suite or "(unnamed)").replace(".", "_")
    return f"{robot}.{suite}" if robot else suite


def _run_facts(results: RunResult) -> list[tuple[str, str]]:
    run = results.started
    if run is None:
        return []
    facts = [("robot", run.robot), ("station", run.station), ("rtf", run.version), ("run", run.run)]
    facts += [(f"device.{key}", value) for key, value in run.device.items()]
    facts += [("command", " ".join(run.command)), ("seed", "" if run.seed is None else str(run.seed))]
    return facts + sorted(run.environment.items())


# XML -----------------------------------------------------------------------------------------------------------------


def _legal(text: str) -> str:
    """The text with characters that XML cannot carry, or that only terminals understand, made visible."""
    return _ILLEGAL.sub(lambda found: f"#x{ord(found.group()):02X}", joined(text))


def _text(text: str) -> str:
    """A text as it stands between tags."""
    return html.escape(_legal(text), quote=False).replace("\r", "&#13;")


def _attributes(pairs: Iterable[tuple[str, object]]) -> str:
    """Attributes as they stand in a tag, each after a blank."""
    return "".join(f' {name}="{_quoted(str(value))}"' for name, value in pairs)


def _quoted(text: str) -> str:
    """A text as it stands between quotation marks; a reader would make blanks of line ends and tabs otherwise."""
    text = html.escape(_legal(text))
    return text.replace("\n", "&#10;").replace("\r", "&#13;").replace("\t", "&#9;")


def _element(name: str, text: str, *pairs: tuple[str, object]) -> str:
    """An element that holds only text, on a line of its own."""
    return f"<{name}{_attributes(pairs)}>{_text(text)}</{name}>\n"


def _seconds(seconds: float) -> str:
    """Three decimals, as the schema wants."""
    return f"{seconds:.3f}" if 0 <= seconds < float("inf") else "0.000"


def _properties(pairs: Iterable[tuple[str, str]]) -> str:
    """The element of those properties that have a value; nothing when none has."""
    rows = [f"<property{_attributes([('name', name), ('value', value)])}/>\n" for name, value in pairs if value]
    return f"<properties>\n{''.join(rows)}</properties>\n" if rows else ""


#: What is said of a test that has not begun. There may be thousands of them, and they are made while the run goes on.
_NOT_RUN = _element(
    "error", "not run: the runner was killed", ("type", "not run"), ("message", "not run: the runner was killed")
)
