"""The elements of a JUnit test case, written by hand: text, attributes, verdict, earlier attempts, output.

``reports/junit.py`` puts them together to a file; ``docs/decisions/0003-junit-writer.md`` says why they are as they
are.
"""

from __future__ import annotations

import html
import os
import re
from typing import TYPE_CHECKING

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
from rtf.testing.report.files import AttemptEvents
from rtf.testing.report.problems import PASSED_OVER, incident_text
from rtf.testing.report.text import cut, joined, measured, near_path, parameter, place, problem_text, sentence
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from rtf.testing.report.problems import Problem
    from rtf.testing.results import TestResult

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


def legal(text: str) -> str:
    """The text with characters that XML cannot carry, or that only terminals understand, made visible."""
    return _ILLEGAL.sub(lambda found: f"#x{ord(found.group()):02X}", joined(text))


def text_of(text: str) -> str:
    """A text as it stands between tags."""
    return html.escape(legal(text), quote=False).replace("\r", "&#13;")


def attributes(pairs: Iterable[tuple[str, object]]) -> str:
    """Attributes as they stand in a tag, each after a blank."""
    return "".join(f' {name}="{_quoted(str(value))}"' for name, value in pairs)


def _quoted(text: str) -> str:
    """A text as it stands between quotation marks; a reader would make blanks of line ends and tabs otherwise."""
    text = html.escape(legal(text))
    return text.replace("\n", "&#10;").replace("\r", "&#13;").replace("\t", "&#9;")


def element(name: str, text: str, *pairs: tuple[str, object]) -> str:
    """An element that holds only text, on a line of its own."""
    return f"<{name}{attributes(pairs)}>{text_of(text)}</{name}>\n"


def seconds_of(seconds: float) -> str:
    """Three decimals, as the schema wants."""
    return f"{seconds:.3f}" if 0 <= seconds < float("inf") else "0.000"


def kind_of(result: TestResult) -> str:
    """The element that a test's verdict becomes; none for a pass. A test without one is lost with its runner."""
    verdict = result.verdict
    if verdict is None:
        return "error"
    if verdict in PASSED_OVER:
        return "skipped"
    if verdict.good:
        return ""
    return "failure" if verdict in _FAILURES else "error"


def properties_of(pairs: Iterable[tuple[str, str]]) -> str:
    """The element of those properties that have a value; nothing when none has."""
    rows = [f"<property{attributes([('name', name), ('value', value)])}/>\n" for name, value in pairs if value]
    return f"<properties>\n{''.join(rows)}</properties>\n" if rows else ""


def problem_case(problem: Problem, identity: list[tuple[str, object]]) -> str:
    """A case for what is no test. What RTF got over is shown as an earlier, failed attempt of a case that passed."""
    parts = [f"<testcase{attributes([*identity, ('time', '0.000')])}>\n"]
    message = cut(_filled(problem.message, problem.name), _MESSAGE_LIMIT)
    if problem.red:
        text = cut(_filled(problem.text, message), _FAILING_LIMIT)
        parts.append(element("error", text, ("type", problem.kind), ("message", message)))
    else:
        for event in problem.incidents:
            cause = cut(_filled(event.cause, message), _MESSAGE_LIMIT)
            head = attributes([("type", problem.kind), ("message", cause)])
            trace = element("stackTrace", cut(incident_text(event), _EARLIER_LIMIT))
            parts.append(f"<flakyFailure{head}>{trace}</flakyFailure>\n")
    parts.append(element("system-out", _defused(cut(problem.text, _PASSING_LIMIT))))
    return "".join([*parts, "</testcase>\n"])


class CaseWriter:
    """Writes what stands inside a test case, from the events of its attempts; ``strict`` keeps to junit-10.xsd."""

    def __init__(self, run_folder: Path, *, strict: bool) -> None:
        self._folder = run_folder
        self._strict = strict

    def case(self, result: TestResult, attempts: list[AttemptEvents], identity: list[tuple[str, object]]) -> str:
        """A test case whole: verdict, earlier attempts, properties, output."""
        attempts = [attempt for attempt in attempts if attempt.ended is not None] or attempts
        last = attempts[-1] if attempts else AttemptEvents()
        kind, planned = kind_of(result), result.planned
        properties = self._facts(result, last, len(attempts))
        head = [*identity, ("time", seconds_of(result.duration))]
        parts = []
        if not self._strict:
            head += [("file", near_path(planned.file))] if planned.file else []
            head += [("line", planned.line)] if planned.file and planned.line else []
            parts.append(properties_of(properties))
        parts += [self._verdict(result, last, kind)] if kind else []
        parts += [self._earlier(attempt, "rerunFailure" if kind else "flakyFailure") for attempt in attempts[:-1]]
        marks = self._marks(attempts, properties if self._strict else [])
        out, err = _outputs(last, _FAILING_LIMIT if kind else _PASSING_LIMIT)
        parts += [element("system-out", marks + out) if marks + out else "", element("system-err", err) if err else ""]
        return f"<testcase{attributes(head)}>\n{''.join(parts)}</testcase>\n"

    @staticmethod
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
        return element(kind, cut(_filled(text, message), _FAILING_LIMIT // 4), *pairs)

    @staticmethod
    def _earlier(attempt: AttemptEvents, name: str) -> str:
        ended = attempt.ended
        if ended is None:
            return ""
        problems = "\n".join(problem_text(event) for event in attempt.problems)
        message = _filled(ended.detail, problems.partition("\n")[0], ended.reason, ended.outcome)
        out, err = _outputs(attempt, _EARLIER_LIMIT)
        head = attributes([("type", ended.outcome), ("message", cut(message, _MESSAGE_LIMIT))])
        inner = element("stackTrace", cut(_filled(problems, message), _EARLIER_LIMIT))
        inner += element("system-out", out) if out else ""
        inner += element("system-err", err) if err else ""
        return f"<{name}{head}>\n{inner}</{name}>\n"

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
                    path = _relative(os.path.join(self._folder, event.path))  # noqa: PTH118 - no need of a Path
                    lines.append(_defused(path) if _NOT_IN_A_MARK.search(path) else f"[[ATTACHMENT|{path}]]")
        for name, value in properties:
            pair = _defused(cut(f"{name}={value}", _MESSAGE_LIMIT))
            lines.append(f"[[PROPERTY|{pair.replace(']]', '] ]').translate(_ONE_LINE)}]]")
        return "".join(f"{line}\n" for line in lines)


def _lost(attempt: AttemptEvents) -> str:
    """Why a test has no end: it is in a file that was written while the run went on, and then the run was killed."""
    return "the runner was killed" if attempt.started is None else "the runner was killed while this test was running"


_ONE_LINE = {ord("\n"): "\\n", ord("\r"): "\\r"}


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
