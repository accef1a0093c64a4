"""A test that is any program: its verdict is what it says in TAP, in a JUnit file, or by its exit status.

The program gets the words of the parameter string as arguments, and in its environment:

=====================  ==========================================================================================
``RTF_TEST``           the test's id, ``suite/test``
``RTF_ENVIRONMENT``    the suite's environment string
``RTF_FOLDER``         an existing folder; what the program leaves there is attached to the test
``RTF_JUNIT``          the file to which it may write its results as JUnit
``RTF_PARAM_<KEY>``    each ``<parameter>`` and ``--set``, the key in capitals
``GTEST_OUTPUT``       the same file, said to GoogleTest
=====================  ==========================================================================================

Its standard input is empty, its output is the test's output, and it works in the folder of the run's start. Exit status
0 is passed, 77 skipped and 99 an error as with automake, any other failed; death by a signal is always an error.
"""

from __future__ import annotations

import contextlib
import os
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rtf import clock
from rtf.testing import recording
from rtf.testing.events import SubResultEnded
from rtf.testing.isolation import processes
from rtf.testing.languages import core_dumps
from rtf.testing.languages.program import LineCutter, run_program
from rtf.testing.languages.raw_parameters import RawParameters
from rtf.testing.languages.tap import BailOut, Comment, Fault, Item, Point, SkippedAll, TapParser, looks_like_tap
from rtf.testing.outcome import SkipTest, TestFailure, TestProblem
from rtf.testing.verdict import Severity, Verdict

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.testing.languages.junit_file import JunitCase
    from rtf.testing.session import Session

MODES = ("", "tap", "junit", "exit")

#: automake's words for "there is nothing to test here" and "it could not be tested".
_SKIPPED = 77
_HARD_ERROR = 99
_MAX_ATTACHED = 1000
_STDOUT = 1


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
        junit = recording.free_path(self._session, "junit", ".xml") if self._mode in ("", "junit") else None
        output = _Output(self._session, self._mode)
        words = [str(self._path), *self.words]
        if self._session.core_dumps:
            began = clock.now()
            status, signal_text = run_program(
                words,
                self._environ(junit),
                output.take,
                before=_allow_core_dumps,
                crashed=lambda pid: self._keep_core(pid, began),
            )
        else:
            status, signal_text = run_program(words, self._environ(junit), output.take)
        self._judge(output, junit, status, signal_text)

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
            recording.emit_attached(self._session, path, path.relative_to(folder).as_posix())
        if not count:
            with contextlib.suppress(OSError):
                folder.rmdir()

    def _keep_core(self, pid: int, since: float) -> None:
        """Put the core file where ``teardown`` attaches it."""
        problem = core_dumps.keep(pid, self.folder, since)
        if problem:
            self.warn(problem)

    # Behind it -------------------------------------------------------------------------------------------------------

    def _environ(self, junit: Path | None) -> dict[str, str]:
        environ = {
            **os.environ,
            "RTF_TEST": self._session.test,
            "RTF_ENVIRONMENT": self.environment,
            "RTF_FOLDER": str(self.folder.absolute()),
        }
        for key, value in self.added.items():
            environ[f"RTF_PARAM_{re.sub('[^A-Z0-9]', '_', key.upper())}"] = value
        if junit is not None:
            file = str(junit.absolute())
            environ |= {"RTF_JUNIT": file, "GTEST_OUTPUT": f"xml:{file}", "GTEST_COLOR": "no"}
        return environ

    def _judge(self, output: _Output, junit: Path | None, status: int | None, signal_text: str) -> None:
        tap = output.finish()
        account = tap.finish(cut_off=bool(signal_text)) if tap is not None else None
        how = f"{self._path.name}: {processes.describe_end(status, signal_text)}"
        if signal_text:
            raise TestProblem(how, title="the program crashed")
        if account is None and junit is not None and (junit.exists() or self._mode == "junit"):
            account = self._judge_junit(junit, status)
        if account is None:
            self._judge_status(status, how)
        elif status and not account.failed:
            raise TestProblem(f"{how}, although nothing failed", title="exit status")
        elif account.skipped is not None:
            raise SkipTest(account.skipped)

    def _judge_junit(self, junit: Path, status: int | None) -> Account:
        from rtf.testing.languages.junit_file import read_junit

        if not junit.exists():
            how = processes.describe_end(status, "")
            raise TestProblem(
                f"{self._path.name} ended with {how} and did not write {junit} (RTF_JUNIT, GTEST_OUTPUT)",
                title="no results",
            )
        return tell_junit(self._session, read_junit(junit))

    def _judge_status(self, status: int | None, text: str) -> None:
        self._session.judged()
        if status == _SKIPPED:
            raise SkipTest(text)
        if status == _HARD_ERROR:
            raise TestProblem(text, title="hard error")
        if status:
            raise TestFailure(text, title="exit status")


class _Output:
    """What the program writes: passed on to the worker's own output, and read as TAP when it is."""

    def __init__(self, session: Session, mode: str) -> None:
        self._session = session
        self._lines = LineCutter()
        self._tap = TapReport(session) if mode == "tap" else None
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

    def finish(self) -> TapReport | None:
        """Read the last line. Returns the report of the TAP stream, None when it was none."""
        for line in self._lines.finish():
            self._take_line(line)
        return self._tap

    def _take_line(self, line: str) -> None:
        if self._undecided and line.strip():
            self._undecided = False
            if looks_like_tap(line):
                self._tap = TapReport(self._session)
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


def _allow_core_dumps() -> None:
    processes.die_with_parent()
    core_dumps.allow()


# What a program says of itself. Each test point or case is a sub-result with a verdict of its own, and a check in it.


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
