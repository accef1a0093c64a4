"""A test that is any program: its verdict is what it says in TAP, in a JUnit file, or by its exit status.

The program gets the words of the parameter string as arguments, and in its environment:

=====================  ==========================================================================================
``RTF_TEST``           the test's id, ``suite/test``
``RTF_ENVIRONMENT``    the suite's environment string
``RTF_FOLDER``         an existing folder; what the program leaves there is attached to the test
``RTF_JUNIT``          the file to which it may write its results as JUnit
``RTF_PARAM_<KEY>``    each ``<parameter>`` and ``--set``, the key in capitals
``GTEST_OUTPUT``       the same file, said to GoogleTest
``RTF_CASES``          the names of the only cases that are wanted, one a line; not set when all are
``GTEST_FILTER``       the same, said to GoogleTest
=====================  ==========================================================================================

Each test point or case that it reports is a test of its own; the verdict of the program is about the rest: whether it
could be run, ended well and kept to the protocol. A program that takes no notice of the wanted cases runs all of them,
and only those count.

Its standard input is empty, its output is the test's output, and it works in the folder of the run's start. Exit status
0 is passed, 77 skipped and 99 an error as with automake, any other failed; death by a signal is always an error.
"""

from __future__ import annotations

import contextlib
import mimetypes
import os
import re
import sys
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.testing.events import Attached, Message
from rtf.testing.isolation.messages import Case
from rtf.testing.languages.program import LineCutter, run_program
from rtf.testing.languages.scripts import RawParameters
from rtf.testing.languages.tap import BailOut, Comment, Fault, Item, Point, SkippedAll, TapParser, looks_like_tap
from rtf.testing.outcome import SkipTest, TestFailure, TestProblem, TestStopped
from rtf.testing.verdict import Phase, Severity, Verdict

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from rtf.testing.languages.junit_file import JunitCase
    from rtf.testing.languages.program import Ended
    from rtf.testing.session import Session

MODES = ("", "tap", "junit", "exit")

#: automake's words for "there is nothing to test here" and "it could not be tested".
_SKIPPED = 77
_HARD_ERROR = 99
_MAX_ATTACHED = 1000
_STDOUT = 1
#: Characters of the name of a case, and of all names that a program is given; Linux allows 128 KiB for one variable.
_MAX_NAME = 500
_MAX_NAMES = 100_000


class ExecutableTest(RawParameters):
    """The program ``path``. ``mode`` says how to read it: ``tap``, ``junit``, ``exit``, or ``""`` to find out.

    Finding out: it is TAP when the first line that is not empty looks like it, else JUnit when the file was written,
    else the exit status.
    """

    def __init__(self, path: Path, mode: str = "") -> None:
        super().__init__()
        if mode not in MODES:
            raise ValueError(f"an executable is read as {', '.join(MODES[1:])} or by itself, not as {mode!r}")
        self._path = path
        self._mode = mode

    def run(self) -> None:
        """Run the program to its end and judge it. Called in the worker, once more for each repetition."""
        junit = self._free_path("junit", ".xml") if self._mode in ("", "junit") else None
        cases = CaseReport(self._session)
        output = _Output(cases, self._mode)
        cores = self.folder if self._session.core_dumps else None
        try:
            ended = run_program([str(self._path), *self.words], self._environ(junit), output.take, cores=cores)
        except TestStopped:
            output.finish(cut_off=True)
            raise
        if ended.no_core:
            self.warn(ended.no_core)
        self._judge(output, cases, junit, ended)

    def teardown(self) -> None:
        """Attach what the program left in its folder."""
        folder = self._session.folder
        if not folder.is_dir():
            return
        count = 0
        for count, path in enumerate(_files_below(folder), 1):
            if count > _MAX_ATTACHED:
                self.warn(f"more than {_MAX_ATTACHED} files in {folder}; the others are there and not listed")
                break
            self._attach_in_place(path)
        if not count:
            with contextlib.suppress(OSError):
                folder.rmdir()

    # Behind it -------------------------------------------------------------------------------------------------------

    def _environ(self, junit: Path | None) -> dict[str, str]:
        environ = {
            **os.environ,
            "RTF_TEST": self._session.test,
            "RTF_ENVIRONMENT": self.environment,
            "RTF_FOLDER": str(self.folder.absolute()),
            **wanted_cases(self._session.cases),
        }
        for key, value in self.added.items():
            environ[f"RTF_PARAM_{re.sub('[^A-Z0-9]', '_', key.upper())}"] = value
        if junit is not None:
            file = str(junit.absolute())
            environ |= {"RTF_JUNIT": file, "GTEST_OUTPUT": f"xml:{file}", "GTEST_COLOR": "no"}
        return environ

    def _judge(self, output: _Output, cases: CaseReport, junit: Path | None, ended: Ended) -> None:
        tap = output.finish(cut_off=bool(ended.signal))
        how = f"{self._path.name}: {ended}"
        if tap is not None and tap.bailed_out is not None:
            raise TestProblem(tap.bailed_out or "the program gave no reason", title="Bail out!")
        if ended.signal:
            raise TestProblem(how, title="the program crashed")
        if tap is None and junit is not None and (junit.exists() or self._mode == "junit"):
            self._tell_junit(cases, junit, ended)
        elif tap is None:
            self._judge_status(ended.status, how)
            return
        if ended.status and not cases.failed:
            raise TestProblem(f"{how}, although nothing failed", title="exit status")
        if cases.all_skipped is not None:
            raise SkipTest(cases.all_skipped)

    def _tell_junit(self, cases: CaseReport, junit: Path, ended: Ended) -> None:
        from rtf.testing.languages.junit_file import read_junit

        if not junit.exists():
            raise TestProblem(
                f"{self._path.name} ended with {ended} and did not write {junit} (RTF_JUNIT, GTEST_OUTPUT)",
                title="no results",
            )
        told = read_junit(junit)
        if not (told or self._session.cases):
            raise TestProblem("the program wrote a JUnit file without a test case", title="no results")
        for case in told:
            _tell_junit_case(cases, case)

    def _judge_status(self, status: int | None, text: str) -> None:
        self._session.judged()
        if status == _SKIPPED:
            raise SkipTest(text)
        if status == _HARD_ERROR:
            raise TestProblem(text, title="hard error")
        if status:
            raise TestFailure(text, title="exit status")

    def _attach_in_place(self, path: Path) -> None:
        self._session.emit(
            Attached(
                test=self._session.test,
                name=path.relative_to(self._session.folder).as_posix(),
                path=self._relative(path),
                media_type=mimetypes.guess_type(path.name)[0] or "application/octet-stream",
                size=path.stat().st_size,
            )
        )


def wanted_cases(names: Sequence[str]) -> dict[str, str]:
    """Return the variables that tell a program which cases are wanted; none, so that it runs all, if they do not fit.

    A name that came several times is given without its number, too, as the program knows it.
    """
    known = dict.fromkeys([*names, *(_NUMBERED.sub("", name) for name in names)])
    fit = all(name.isprintable() and "\ufffd" not in name and len(name) < _MAX_NAME for name in known)
    if not known or not fit or sum(len(name.encode()) + 1 for name in known) > _MAX_NAMES:
        return {}
    return {"RTF_CASES": "\n".join(known), "GTEST_FILTER": ":".join(_NOT_IN_A_FILTER.sub("?", name) for name in known)}


_NUMBERED = re.compile(r" \([0-9]+\)$")
#: What divides the patterns of GoogleTest's filter.
_NOT_IN_A_FILTER = re.compile(r"[:-]")


class _Output:
    """What the program writes: passed on to the worker's own output, and read as TAP when it is."""

    def __init__(self, cases: CaseReport, mode: str) -> None:
        self._cases = cases
        self._lines = LineCutter()
        self._tap = TapReport(cases) if mode == "tap" else None
        self._undecided = mode == ""
        sys.stdout.flush()  # what the worker wrote before comes before

    def take(self, data: bytes) -> None:
        """Pass one piece on, and read the lines it completes."""
        view = memoryview(data)
        while view:
            view = view[os.write(_STDOUT, view) :]
        if self._tap is not None or self._undecided:
            for line in self._lines.feed(data):
                self._take_line(line)

    def finish(self, *, cut_off: bool) -> TapReport | None:
        """Read the last line. Returns the report of the TAP stream, None when it was none.

        The program may have been ``cut_off`` from outside; then it is no fault that it did not say everything.
        """
        for line in self._lines.finish():
            self._take_line(line)
        if self._tap is not None:
            self._tap.finish(cut_off=cut_off)
        return self._tap

    def _take_line(self, line: str) -> None:
        if self._undecided and line.strip():
            self._undecided = False
            if looks_like_tap(line):
                self._tap = TapReport(self._cases)
        if self._tap is not None:
            self._tap.feed(line)


def _files_below(folder: Path) -> Iterator[Path]:
    """Regular files only: a link could lead anywhere."""
    for root, folders, files in os.walk(folder):
        folders.sort()
        for name in sorted(files):
            path = Path(root, name)
            if path.is_file() and not path.is_symlink():
                yield path


# What a program says of itself ---------------------------------------------------------------------------------------


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
        messages: Sequence[Message] = (),
        *,
        duration: float = 0.0,
        place: tuple[str, int] = ("", 0),
    ) -> None:
        """Tell of a case that is over. From the second of a name on they are numbered."""
        first = not self._counts
        session, name = self.session, self._unique(name[:_MAX_NAME])
        if not verdict.good:
            self.failed = True
            session.bad_cases += 1
        if verdict is not Verdict.SKIPPED:
            self.all_skipped = None
        elif first:
            self.all_skipped = detail
        session.emit(
            Case(
                test=session.test,
                name=name,
                verdict=verdict,
                detail=detail,
                duration=duration,
                subject=session.subject,
                file=place[0],
                line=place[1],
                messages=tuple(messages),
            )
        )

    def message(self, severity: Severity, detail: str, place: tuple[str, int] = ("", 0)) -> Message:
        """Make a message of a case."""
        test, title = self.session.test, "checks"
        return Message(
            severity=severity, title=title, detail=detail, test=test, phase=Phase.RUN, file=place[0], line=place[1]
        )

    def _unique(self, name: str) -> str:
        self._counts[name] += 1
        count = self._counts[name]
        return name if count == 1 else self._unique(f"{name} ({count})")


_BLOCK_FILE = re.compile(r"""^\s*(?:file|fileName):\s*["']?([^"'\n]+?)["']?\s*$""", re.MULTILINE)
_BLOCK_LINE = re.compile(r"""^\s*(?:line|lineNumber):\s*["']?([0-9]{1,9})["']?\s*$""", re.MULTILINE)


class TapReport:
    """Feeds the lines of one run of a program to a parser, and tells what they mean while it runs."""

    def __init__(self, cases: CaseReport) -> None:
        self._cases = cases
        self._session = cases.session
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
        match item:
            case Point():
                self._tell_point(item)
            case Comment():
                self._session.message(Severity.INFO, "reports", item.text, ("", 0))
            case Fault():
                self._cases.failed = True
                self._session.judged()
                where = f"{'/'.join(item.path)}: " if item.path else ""
                self._session.message(Severity.FAILURE, "breaks the TAP protocol", f"{where}{item.text}", ("", 0))
            case SkippedAll():
                self._cases.all_skipped = item.reason or "the program has nothing to test (1..0)"
            case BailOut():
                self.bailed_out = item.reason

    def _tell_point(self, point: Point) -> None:
        name = "/".join([*point.path, point.description or f"test {point.number}"])
        detail = f"{name}\n{point.block}" if point.block else name
        place = _place(point.block)
        todo = f"TODO {point.reason}".rstrip()
        if point.directive == "skip":
            self._cases.tell(name, Verdict.SKIPPED, point.reason or "skipped")
        elif point.directive == "todo" and point.ok:
            warning = self._cases.message(Severity.WARNING, f"passed, and was expected to fail: {todo}")
            self._cases.tell(name, Verdict.PASSED, todo, [warning])
        elif point.directive == "todo":
            note = self._cases.message(Severity.INFO, f"{detail} ({todo})", place)
            self._cases.tell(name, Verdict.EXPECTED_FAILURE, todo, [note])
        elif point.ok:
            notes = [self._cases.message(Severity.PASS, detail, place)] if point.block else []
            self._cases.tell(name, Verdict.PASSED, messages=notes)
        else:
            failure = self._cases.message(Severity.FAILURE, detail, place)
            self._cases.tell(name, Verdict.FAILED, detail, [failure])


def _place(block: str) -> tuple[str, int]:
    """Where a YAML block says that the failure lies."""
    file = _BLOCK_FILE.search(block)
    line = _BLOCK_LINE.search(block)
    return (file[1], int(line[1]) if line else 0) if file else ("", 0)


def _tell_junit_case(cases: CaseReport, case: JunitCase) -> None:
    place, duration = (case.file, case.line), case.time or 0.0
    problems = [
        cases.message(
            Severity.ERROR if problem.kind == "error" else Severity.FAILURE,
            str(problem) or f"{case.subject}: {problem.kind}",
            (problem.file, problem.line) if problem.file else place,
        )
        for problem in case.problems
    ]
    if problems:
        failed = any(problem.severity is Severity.FAILURE for problem in problems)
        verdict = Verdict.FAILED if failed else Verdict.ERROR
        cases.tell(case.subject, verdict, problems[0].detail, problems, duration=duration, place=place)
    elif case.skipped is not None:
        cases.tell(case.subject, Verdict.SKIPPED, case.skipped, duration=duration, place=place)
    else:
        cases.tell(case.subject, Verdict.PASSED, duration=duration, place=place)
