"""Texts of reports: the line of the short summary, the text of a failure, and the sections below it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.testing.events import Measured, Message, OutputCaptured, StackDumped, SubResultEnded
from rtf.testing.measurement import MeasurementVerdict
from rtf.testing.report.problems import incident_text
from rtf.testing.report.text import cut, measurement, one_line, place, problem_text, sentence, shown
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from rtf.pytest_suites.listener import FinishedTest
    from rtf.testing.events import FixtureIncident
    from rtf.testing.report.files import AttemptEvents
    from rtf.testing.results import TestResult

#: Characters of one section; the record of the run has the rest.
_SECTION_LIMIT = 256 * 1024
#: The greatest number of cases of a program in a text; the record of the run has all.
_CASES = 20


def headline(finished: FinishedTest) -> str:
    """Return the line of the short summary for a test that did not pass."""
    problems = finished.last.problems
    if finished.verdict is Verdict.FAILED and problems and problems[0].detail in ("", finished.ended.detail):
        first = problems[0]
        return one_line(": ".join(part for part in (first.subject, first.detail or first.title) if part))
    said = one_line(_last_word(finished))
    return said if finished.verdict is Verdict.FAILED else f"{finished.verdict}: {said}"


def explanation(finished: FinishedTest) -> str:
    """Return the text of the failure of a test."""
    said = _last_word(finished)
    # What the runner itself noted is its last word, too.
    parts = [problem_text(message) for message in finished.last.problems if message.file or message.detail != said]
    if finished.verdict is not Verdict.FAILED:
        parts.insert(0, f"{finished.verdict}: {said}")
    elif not any(said in part for part in parts):
        parts.insert(0, said)
    parts += _parts_not_passed(finished)
    parts += [f"{case.name}: {case.verdict}: {_problem_of(case)}" for case in finished.bad_cases[:_CASES]]
    parts += [
        f"{event.cause}:\n{event.text.rstrip()}" for event in finished.last.events if isinstance(event, StackDumped)
    ]
    parts += [incident_text(event) for event in finished.incidents]
    return "\n\n".join(cut(shown(part), _SECTION_LIMIT) for part in parts)


def _last_word(finished: FinishedTest) -> str:
    if finished.ended.verdict.good and finished.bad_cases:
        names = ", ".join(case.planned.case for case in finished.bad_cases[:_CASES])
        more = " …" if len(finished.bad_cases) > _CASES else ""
        return f"{len(finished.bad_cases)} of {len(finished.result.cases)} cases did not pass: {names}{more}"
    return (finished.ended.detail or finished.ended.reason or finished.verdict).strip("\n")


def _problem_of(case: TestResult) -> str:
    said = "\n".join(problem_text(message) for message in case.problems)
    return said or (case.last.detail if case.last else "")


def where(finished: FinishedTest) -> tuple[str, int]:
    """Return file and line of the first problem, or of the test in its suite."""
    for message in finished.last.problems:
        if message.file and message.line:
            return message.file, message.line
    return finished.result.planned.file, finished.result.planned.line


def sections(finished: FinishedTest) -> Iterator[tuple[str, str]]:
    """Return messages, measurements and output by the name of the section, without empty ones."""
    parts = {
        "log": _lines(_log(finished.last)),
        "stdout": _output(finished.last, "stdout"),
        "stderr": _output(finished.last, "stderr"),
        "sub-results": _lines(_subresults(finished.last)),
        "earlier attempts": _lines(earlier_attempt(attempt) for attempt in finished.earlier),
        "fixture incidents": _lines(incident_text(event) for event in finished.incidents),
    }
    for name, text in parts.items():
        if text:
            yield name, cut(shown(text), _SECTION_LIMIT)


def suite_problem(event: FixtureIncident | Message) -> str:
    """Return the problems of a suite or its fixtures outside of tests."""
    text = problem_text(event) if isinstance(event, Message) else incident_text(event)
    return cut(shown(text), _SECTION_LIMIT)


def earlier_attempt(attempt: AttemptEvents) -> str:
    """Return the outcome of an earlier attempt, in one or more lines."""
    number = attempt.started.attempt if attempt.started else "?"
    ended = attempt.ended
    said = f"{ended.outcome}: {ended.detail or ended.reason}" if ended else "it never ended"
    return "\n".join([f"attempt {number}: {said}", *(f"  {sentence(message)}" for message in attempt.problems)])


def _parts_not_passed(finished: FinishedTest) -> list[str]:
    parts = [event for event in finished.last.events if isinstance(event, SubResultEnded)]
    bad = [event.subject for event in parts if not event.verdict.good]
    return [f"{len(bad)} of {len(parts)} sub-results did not pass: {', '.join(bad)}"] if bad else []


def _subresults(attempt: AttemptEvents) -> Iterator[str]:
    for event in attempt.events:
        if isinstance(event, SubResultEnded):
            yield f"{event.subject}: {event.verdict}{': ' if event.reason else ''}{event.reason}"


def _log(attempt: AttemptEvents) -> Iterator[str]:
    for event in attempt.events:
        if isinstance(event, Message):
            at = place(event.file, event.line)
            yield f"{event.severity.upper():8} {sentence(event)}{f' ({at})' if at else ''}"
        elif isinstance(event, Measured) and event.verdict is not MeasurementVerdict.FAILED:
            yield f"MEASURED {measurement(event)}"  # a failed one is said by the failure that follows it


def _output(attempt: AttemptEvents, stream: str) -> str:
    parts: list[str] = []
    for event in attempt.events:
        if isinstance(event, OutputCaptured) and event.stream == stream:
            if event.omitted:
                parts.append(f"… {event.omitted} bytes not kept …\n")
            parts.append(event.text)
    return "".join(parts)


def _lines(lines: Iterable[str]) -> str:
    return "".join(f"{line}\n" for line in lines)
