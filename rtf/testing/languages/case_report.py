"""What a program under test tells of its cases, in TAP or in a JUnit file: one report for both, to the runner.

The runner makes a test of each case. Whether the program itself passed is decided in
:mod:`rtf.testing.languages.executable`.
"""

from __future__ import annotations

import re
from collections import Counter
from typing import TYPE_CHECKING

from rtf.testing.events import Message
from rtf.testing.isolation.messages import LONGEST_CASE, Case
from rtf.testing.languages.tap import BailOut, Comment, Fault, Item, Point, SkippedAll, TapParser
from rtf.testing.verdict import Phase, Severity, Verdict

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.testing.languages.junit_file import JunitCase
    from rtf.testing.session import Session

    Place = tuple[str, int]
    Said = tuple[Severity, str, Place]

#: Characters of the name of a case, and of all names that a program is given; Linux allows 128 KiB for one variable.
_MAX_NAME = 500
_MAX_NAMES = 100_000
_MAX_DETAIL = 2000

_NUMBERED = re.compile(r" \([0-9]+\)$")
#: What divides the patterns of GoogleTest's filter.
_NOT_IN_A_FILTER = re.compile(r"[:-]")
_BLOCK_FILE = re.compile(r"""^\s*(?:file|fileName):\s*["']?([^"'\n]+?)["']?\s*$""", re.MULTILINE)
_BLOCK_LINE = re.compile(r"""^\s*(?:line|lineNumber):\s*["']?([0-9]{1,9})["']?\s*$""", re.MULTILINE)
_NOWHERE = ("", 0)


def wanted_cases(names: Sequence[str]) -> dict[str, str]:
    """Return the variables that tell a program which cases are wanted; none, so that it runs all, if they do not fit.

    A name that came several times is given without its number, too, as the program knows it.
    """
    known = dict.fromkeys([*names, *(_NUMBERED.sub("", name) for name in names)])
    fit = all(name.isprintable() and "\ufffd" not in name and len(name) < _MAX_NAME for name in known)
    if not known or not fit or sum(len(name.encode()) + 1 for name in known) > _MAX_NAMES:
        return {}
    return {"RTF_CASES": "\n".join(known), "GTEST_FILTER": ":".join(_NOT_IN_A_FILTER.sub("?", name) for name in known)}


class CaseReport:
    """What one run of a program tells of its cases: handed to the runner one by one, and added up."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.failed = False  # a case did, or the protocol was broken
        self.all_skipped: str | None = None  # why, while nothing was tested
        self._counts: Counter[str] = Counter()

    def tell(
        self,
        name: str,
        verdict: Verdict,
        detail: str = "",
        said: Sequence[Said] = (),
        *,
        duration: float = 0.0,
        place: Place = _NOWHERE,
    ) -> None:
        """Tell of a case that is over, with what is said in it. From the second of a name on they are numbered."""
        if verdict is not Verdict.SKIPPED:
            self.all_skipped = None
        elif not self._counts:
            self.all_skipped = detail
        self.failed |= not verdict.good
        session = self.session
        session.bad_cases += not verdict.good
        session.emit(
            Case(
                test=session.test,
                name=self._unique(name[:_MAX_NAME]),
                verdict=verdict,
                detail=detail[:_MAX_DETAIL],
                duration=min(duration, LONGEST_CASE),
                subject=session.subject,
                file=place[0],
                line=place[1],
                messages=tuple(self._message(*one) for one in said),
            )
        )

    def _message(self, severity: Severity, detail: str, place: Place) -> Message:
        test, (file, line) = self.session.test, place
        return Message(
            severity=severity, title="checks", detail=detail, test=test, phase=Phase.RUN, file=file, line=line
        )

    def _unique(self, name: str) -> str:
        self._counts[name] += 1
        count = self._counts[name]
        return name if count == 1 else self._unique(f"{name} ({count})")


class TapReport:
    """Feeds the lines of one run of a program to a parser, and tells what they mean while it runs."""

    def __init__(self, cases: CaseReport) -> None:
        self._cases = cases
        self._parser = TapParser()
        self.bailed_out: str | None = None  # why

    def feed(self, line: str) -> None:
        """Take one line of the program."""
        for item in self._parser.feed(line):
            self._tell(item)

    def finish(self, *, cut_off: bool) -> None:
        """Tell what is known when the program has ended."""
        for item in self._parser.finish(cut_off=cut_off):
            self._tell(item)

    def _tell(self, item: Item) -> None:
        session = self._cases.session
        match item:
            case Point():
                self._tell_point(item)
            case Comment():
                session.message(Severity.INFO, "reports", item.text, _NOWHERE)
            case Fault():
                self._cases.failed = True
                where = f"{'/'.join(item.path)}: " if item.path else ""
                session.judged()
                session.message(Severity.FAILURE, "breaks the TAP protocol", f"{where}{item.text}", _NOWHERE)
            case SkippedAll():
                self._cases.all_skipped = item.reason or "the program has nothing to test (1..0)"
            case BailOut():
                self.bailed_out = item.reason

    def _tell_point(self, point: Point) -> None:
        name = "/".join([*point.path, point.description or f"test {point.number}"])
        text = f"{name}\n{point.block}" if point.block else name
        todo = f"TODO {point.reason}".rstrip()
        place = _place(point.block)
        match point.directive, point.ok:
            case "skip", _:
                self._cases.tell(name, Verdict.SKIPPED, point.reason or "skipped")
            case "todo", True:
                warning = f"{text} passed, and was expected to fail ({todo})"
                self._cases.tell(name, Verdict.PASSED, todo, [(Severity.WARNING, warning, place)])
            case "todo", False:
                self._cases.tell(name, Verdict.EXPECTED_FAILURE, todo, [(Severity.INFO, f"{text} ({todo})", place)])
            case _, True:
                self._cases.tell(name, Verdict.PASSED, said=[(Severity.PASS, text, place)] if point.block else [])
            case _:
                self._cases.tell(name, Verdict.FAILED, point.block, [(Severity.FAILURE, text, place)])


def _place(block: str) -> Place:
    """Where a YAML block says that the failure lies."""
    file = _BLOCK_FILE.search(block)
    line = _BLOCK_LINE.search(block)
    return (file[1], int(line[1]) if line else 0) if file else _NOWHERE


def tell_junit(cases: CaseReport, case: JunitCase) -> None:
    """Tell of a case of a JUnit file. A failure weighs more than an error."""
    place = (case.file, case.line)
    said = [
        (
            Severity.ERROR if problem.kind == "error" else Severity.FAILURE,
            problem.detail or f"{case.subject}: {problem.kind}",
            (problem.file, problem.line) if problem.file else place,
        )
        for problem in case.problems
    ]
    verdict, detail = Verdict.PASSED, ""
    if said:
        verdict = Verdict.FAILED if any(severity is Severity.FAILURE for severity, *_ in said) else Verdict.ERROR
        detail = said[0][1]
    elif case.skipped is not None:
        verdict, detail = Verdict.SKIPPED, case.skipped
    cases.tell(case.subject, verdict, detail, said, duration=case.time or 0.0, place=place)
