"""The cases that a program under test reports, in TAP or in a JUnit file, as one report to the runner.

The runner makes a test of each case. :mod:`rtf.testing.languages.executable` decides whether the program itself passed.
A JUnit file is not trusted: its size and number of cases are bounded, it may have no document type, no entity is
expanded and nothing is fetched.
"""

from __future__ import annotations

import itertools
import math
import re
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf.errors import Location
from rtf.testing.events import Message
from rtf.testing.isolation.messages import LONGEST_CASE, Case
from rtf.testing.languages.tap import BailOut, Comment, Fault, Item, Point, SkippedAll
from rtf.testing.verdict import Phase, Severity, TestingError, Verdict

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from lxml import etree

    from rtf.testing.session import Session

    Place = tuple[str, int]
    Said = tuple[Severity, str, Place]

#: Bytes and cases of a JUnit file, and characters of one failure.
MAX_SIZE = 32 << 20
MAX_CASES = 100_000
MAX_TEXT = 64 * 1024

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
_ROOTS = frozenset({"testsuites", "testsuite"})
_LINE = re.compile("[0-9]{1,9}")
#: GoogleTest begins the text of a failure with the place, as compilers do.
_PLACE = re.compile(r"\s*([^\s:][^:\n]*):([0-9]{1,9})(?::[0-9]+)?\s*(?:\n|:|$)")


def wanted_cases(names: Sequence[str]) -> dict[str, str]:
    """Return the variables that name the wanted cases to a program; none, so that it runs all, if they do not fit.

    A name that came several times is also given without its number, as the program knows it.
    """
    known = dict.fromkeys([*names, *(_NUMBERED.sub("", name) for name in names)])
    fit = all(name.isprintable() and "\ufffd" not in name and len(name) < _MAX_NAME for name in known)
    if not known or not fit or sum(len(name.encode()) + 1 for name in known) > _MAX_NAMES:
        return {}
    return {"RTF_CASES": "\n".join(known), "GTEST_FILTER": ":".join(_NOT_IN_A_FILTER.sub("?", name) for name in known)}


class CaseReport:
    """The cases that one run of a program reports: handed to the runner one by one, and added up."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.failed = False  # a case did, or the protocol was broken
        self.all_skipped: str | None = None  # why, while nothing was tested
        self.bailed_out: str | None = None  # why
        self._counts: Counter[str] = Counter()

    def report(
        self,
        name: str,
        verdict: Verdict,
        detail: str = "",
        said: Sequence[Said] = (),
        *,
        duration: float = 0.0,
        place: Place = _NOWHERE,
    ) -> None:
        """Report a case that is over, with its messages. From the second of a name on they are numbered."""
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

    def report_tap(self, items: Iterable[Item]) -> None:
        """Report what was read from a TAP stream."""
        for item in items:
            self._report_item(item)

    def _report_item(self, item: Item) -> None:
        session = self.session
        match item:
            case Point():
                self._report_point(item)
            case Comment():
                session.message(Severity.INFO, "reports", item.text, _NOWHERE)
            case Fault():
                self.failed = True
                where = f"{'/'.join(item.path)}: " if item.path else ""
                session.judged()
                session.message(Severity.FAILURE, "breaks the TAP protocol", f"{where}{item.text}", _NOWHERE)
            case SkippedAll():
                self.all_skipped = item.reason or "the program has nothing to test (1..0)"
            case BailOut():
                self.bailed_out = item.reason

    def _report_point(self, point: Point) -> None:
        name = "/".join([*point.path, point.description or f"test {point.number}"])
        text = f"{name}\n{point.block}" if point.block else name
        todo = f"TODO {point.reason}".rstrip()
        place = _place(point.block)
        match point.directive, point.ok:
            case "skip", _:
                self.report(name, Verdict.SKIPPED, point.reason or "skipped")
            case "todo", True:
                warning = f"{text} passed, and was expected to fail ({todo})"
                self.report(name, Verdict.PASSED, todo, [(Severity.WARNING, warning, place)])
            case "todo", False:
                self.report(name, Verdict.EXPECTED_FAILURE, todo, [(Severity.INFO, f"{text} ({todo})", place)])
            case _, True:
                self.report(name, Verdict.PASSED, said=[(Severity.PASS, text, place)] if point.block else [])
            case _:
                self.report(name, Verdict.FAILED, point.block, [(Severity.FAILURE, text, place)])

    def report_junit(self, case: JunitCase) -> None:
        """Report a case of a JUnit file. A failure counts more than an error."""
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
        self.report(case.subject, verdict, detail, said, duration=case.time or 0.0, place=place)

    def _message(self, severity: Severity, detail: str, place: Place) -> Message:
        test, (file, line) = self.session.test, place
        return Message(
            severity=severity, title="checks", detail=detail, test=test, phase=Phase.RUN, file=file, line=line
        )

    def _unique(self, name: str) -> str:
        self._counts[name] += 1
        count = self._counts[name]
        return name if count == 1 else self._unique(f"{name} ({count})")


def _place(block: str) -> Place:
    """Return the place of the failure that a YAML block names."""
    file = _BLOCK_FILE.search(block)
    line = _BLOCK_LINE.search(block)
    return (file[1], int(line[1]) if line else 0) if file else _NOWHERE


# JUnit ---------------------------------------------------------------------------------------------------------------


class JunitFileError(TestingError, ValueError):
    """A file that is no usable JUnit file; the sentence names file, line and what is wrong."""


@dataclass(frozen=True, slots=True)
class JunitProblem:
    """One ``<failure>`` or ``<error>`` of a case; ``file`` and ``line`` are known where the text names them."""

    kind: str
    message: str = ""
    text: str = ""
    file: str = ""
    line: int = 0

    def __str__(self) -> str:
        """Message and text; often the text repeats the message, then only the text."""
        return self.text if self.message in self.text else f"{self.message}\n{self.text}".strip()

    @property
    def detail(self) -> str:
        """Message and text, without the place if they begin with it."""
        text = str(self)
        return (_PLACE.sub("", text, count=1).strip() if self.file else text) or text


@dataclass(frozen=True, slots=True)
class JunitCase:
    """One ``<testcase>``. ``skipped`` is the reason, None when it was not skipped; ``time`` is in seconds."""

    name: str
    classname: str = ""
    suite: str = ""
    problems: tuple[JunitProblem, ...] = ()
    skipped: str | None = None
    time: float | None = None
    file: str = ""
    line: int = 0

    @property
    def subject(self) -> str:
        """The case's name in a report: ``classname.name``, or with the suite's name if it has no class."""
        return ".".join(part for part in (self.classname or self.suite, self.name) if part) or "unnamed"


def read_junit(path: Path) -> list[JunitCase]:
    """Read all cases of a file in their order. Raises JunitFileError, and OSError when it cannot be opened."""
    with path.open("rb") as stream:
        data = stream.read(MAX_SIZE + 1)
    if len(data) > MAX_SIZE:
        raise JunitFileError(f"{path}: larger than {MAX_SIZE >> 20} MiB")
    if not data.strip():
        raise JunitFileError(f"{path}: is empty; did the program end before it wrote its results?")
    root = _parse(path, data)
    name = _local(root)
    if name not in _ROOTS:
        place = Location(str(path), root.sourceline)  # type: ignore[arg-type]  # the stubs lack it
        raise JunitFileError(f"{place}: <{name}> is no root of a JUnit file")
    cases = [*itertools.islice(root.iter("{*}testcase"), MAX_CASES + 1)]
    if len(cases) > MAX_CASES:
        raise JunitFileError(f"{path}: more than {MAX_CASES} test cases")
    return [_case(element) for element in cases]


def _parse(path: Path, data: bytes) -> etree._Element:
    from lxml import etree

    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)
    try:
        root = etree.fromstring(data, parser)
    except etree.XMLSyntaxError as error:
        line, column = error.position
        raise JunitFileError(f"{Location(str(path), line, column)}: no XML: {error.msg}") from None
    except ValueError as error:
        raise JunitFileError(f"{path}: no XML: {error}") from None
    if root.getroottree().docinfo.doctype:  # type: ignore[union-attr]  # the stubs lack it
        raise JunitFileError(f"{path}: has a document type; results need none, and it may hide anything")
    return root


def _case(element: etree._Element) -> JunitCase:
    suite = next(element.iterancestors("{*}testsuite"), None)
    skipped = next(element.iterchildren("{*}skipped"), None)
    reason: str | None = None
    if skipped is not None:
        reason = _attribute(skipped, "message") or _text(skipped) or "skipped"
    elif element.get("status") == "notrun" or element.get("result") == "suppressed":
        reason = "disabled"  # GoogleTest's DISABLED_ tests
    line = _attribute(element, "line")
    return JunitCase(
        name=_attribute(element, "name"),
        classname=_attribute(element, "classname"),
        suite=_attribute(suite, "name") if suite is not None else "",
        problems=tuple(map(_problem, element.iterchildren("{*}failure", "{*}error"))),
        skipped=reason,
        time=_seconds(_attribute(element, "time")),
        file=_attribute(element, "file"),
        line=int(line) if _LINE.fullmatch(line) else 0,
    )


def _problem(element: etree._Element) -> JunitProblem:
    text = _text(element)
    message = _attribute(element, "message") or _attribute(element, "type")
    match = _PLACE.match(text or message)
    file, line = (match[1].strip(), int(match[2])) if match else ("", 0)
    return JunitProblem(_local(element), message, text, file, line)


def _local(element: etree._Element) -> str:
    return str(element.tag).rpartition("}")[2]


def _attribute(element: etree._Element, name: str) -> str:
    return str(element.get(name, "")).strip()[:MAX_TEXT]


def _text(element: etree._Element) -> str:
    return "".join(str(part) for part in element.itertext()).strip()[:MAX_TEXT]


def _seconds(text: str) -> float | None:
    try:
        value = float(text.replace(",", ""))
    except ValueError:
        return None
    return value if math.isfinite(value) and value >= 0 else None
