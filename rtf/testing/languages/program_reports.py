"""Tell a session what a program said about itself: test points of a TAP stream, cases of a JUnit file.

Each point or case is a sub-result with a verdict of its own, and a check in it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf.testing.events import SubResultEnded
from rtf.testing.languages.tap import BailOut, Comment, Fault, Item, Point, SkippedAll, TapParser
from rtf.testing.outcome import SkipTest, TestProblem
from rtf.testing.verdict import Severity, Verdict

if TYPE_CHECKING:
    from rtf.testing.languages.junit_file import JunitCase
    from rtf.testing.session import Session


@dataclass(frozen=True, slots=True)
class Account:
    """What a program's own account comes to. ``skipped`` is the reason when nothing at all was tested, else None."""

    failed: bool
    skipped: str | None = None


_NOWHERE = ("", 0)
_BLOCK_FILE = re.compile(r"""^\s*(?:file|fileName):\s*["']?([^"'\n]+?)["']?\s*$""", re.MULTILINE)
_BLOCK_LINE = re.compile(r"""^\s*(?:line|lineNumber):\s*["']?([0-9]{1,9})["']?\s*$""", re.MULTILINE)


class Subjects:
    """Gives each sub-result a name of its own within one run of a program."""

    def __init__(self) -> None:
        self._counts: dict[str, int] = {}

    def unique(self, subject: str) -> str:
        """The name itself, or with ``(2)``, ``(3)`` … behind it where it was given before."""
        count = self._counts[subject] = self._counts.get(subject, 0) + 1
        return subject if count == 1 else self.unique(f"{subject} ({count})")


class TapReport:
    """Feeds the lines of one run of a program to a parser, and what they mean to the session, while it runs."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._parser = TapParser()
        self._subjects = Subjects()
        self._points = 0
        self._skipped = 0
        self._reason = ""
        self._nothing: SkippedAll | None = None
        self._bailed: BailOut | None = None
        self._failed = False

    def feed(self, line: str) -> None:
        """Take one line of the program."""
        for item in self._parser.feed(line):
            self._tell(item)

    def finish(self, *, cut_off: bool) -> Account:
        """The program has ended, by a signal when ``cut_off``. Raises TestProblem when it bailed out."""
        for item in self._parser.finish(cut_off=cut_off):
            self._tell(item)
        if self._bailed is not None:
            raise TestProblem(self._bailed.reason or "the program gave no reason", title="Bail out!")
        if self._failed:
            return Account(failed=True)
        if self._nothing is not None:
            return Account(failed=False, skipped=self._nothing.reason or "the program has nothing to test (1..0)")
        if self._points and self._skipped == self._points:
            return Account(failed=False, skipped=self._reason or "every test point was skipped")
        return Account(failed=False)

    def _tell(self, item: Item) -> None:
        match item:
            case Point():
                self._tell_point(item)
            case Comment():
                self._session.message(Severity.INFO, "reports", item.text, _NOWHERE)
            case Fault():
                self._failed = True
                self._session.judged()
                where = f"{'/'.join(item.path)}: " if item.path else ""
                self._session.message(Severity.FAILURE, "breaks the TAP protocol", f"{where}{item.text}", _NOWHERE)
            case SkippedAll():
                self._nothing = item
            case BailOut():
                self._bailed = item

    def _tell_point(self, point: Point) -> None:
        name = point.description or f"test {point.number}"
        subject = self._subjects.unique("/".join([*point.path, name]))
        if not point.path:
            self._points += 1
            self._skipped += point.directive == "skip"
            self._reason = self._reason or point.reason
        if point.directive == "todo":
            self._tell_todo(point, name, subject)
            return
        with self._session.part(subject):
            if point.directive == "skip":
                raise SkipTest(point.reason or "skipped")
            self._session.judged()
            self._failed |= point.failed
            severity = Severity.FAILURE if point.failed else Severity.PASS
            detail = f"{name}\n{point.block}" if point.block else name
            self._session.message(severity, "checks", detail, _place(point.block))

    def _tell_todo(self, point: Point, name: str, subject: str) -> None:
        session = self._session
        session.judged()
        verdict = Verdict.UNEXPECTED_PASS if point.ok else Verdict.EXPECTED_FAILURE
        severity = Severity.WARNING if point.ok else Severity.INFO
        reason = f" (TODO {point.reason})" if point.reason else " (TODO)"
        block = f"\n{point.block}" if point.block else ""
        session.message(severity, str(verdict), f"{name}{reason}{block}", _place(point.block))
        outer = f"{session.subject}/" if session.subject else ""
        session.emit(
            SubResultEnded(test=session.test, subject=f"{outer}{subject}", verdict=verdict, reason=point.reason)
        )


def _place(block: str) -> tuple[str, int]:
    """Where a YAML block says that the failure lies."""
    file = _BLOCK_FILE.search(block)
    line = _BLOCK_LINE.search(block)
    return (file[1], int(line[1]) if line else 0) if file else _NOWHERE


def tell_junit(session: Session, cases: list[JunitCase]) -> Account:
    """Tell the session every case of a JUnit file. Raises TestProblem when there is none at all."""
    if not cases:
        raise TestProblem("the program wrote a JUnit file without a test case", title="no results")
    subjects = Subjects()
    for case in cases:
        with session.part(subjects.unique(case.subject)):
            _tell_case(session, case)
    if any(case.problems for case in cases):
        return Account(failed=True)
    return Account(failed=False, skipped=None if any(case.skipped is None for case in cases) else cases[0].skipped)


def _tell_case(session: Session, case: JunitCase) -> None:
    if case.skipped is not None and not case.problems:
        raise SkipTest(case.skipped)
    session.judged()
    for problem in case.problems:
        severity = Severity.ERROR if problem.kind == "error" else Severity.FAILURE
        place = (problem.file, problem.line) if problem.file else (case.file, case.line)
        session.message(severity, "checks", str(problem) or f"{case.subject}: {problem.kind}", place)
    if not case.problems:
        took = "" if case.time is None else f" ({case.time:g} s)"
        session.message(Severity.PASS, "checks", f"{case.subject}{took}", (case.file, case.line))
