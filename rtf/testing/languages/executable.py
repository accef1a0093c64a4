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
import os
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.testing import recording
from rtf.testing.languages.case_report import CaseReport, read_junit, wanted_cases
from rtf.testing.languages.program import LineCutter, run_program
from rtf.testing.languages.scripts import RawParameters
from rtf.testing.languages.tap import TapParser, looks_like_tap
from rtf.testing.verdict import SkipTest, TestFailure, TestProblem, TestStopped

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.testing.languages.program import Ended

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
            recording.emit_attached(self._session, path, path.relative_to(folder).as_posix())
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
        spoke_tap = output.finish(cut_off=bool(ended.signal))
        how = f"{self._path.name}: {ended}"
        if cases.bailed_out is not None:
            raise TestProblem(cases.bailed_out or "the program gave no reason", title="Bail out!")
        if ended.signal:
            raise TestProblem(how, title="the program crashed")
        if not spoke_tap and junit is not None and (junit.exists() or self._mode == "junit"):
            self._report_junit(cases, junit, ended)
        elif not spoke_tap:
            self._judge_status(ended.status, how)
            return
        if ended.status and not cases.failed:
            raise TestProblem(f"{how}, although nothing failed", title="exit status")
        if cases.all_skipped is not None:
            raise SkipTest(cases.all_skipped)

    def _report_junit(self, cases: CaseReport, junit: Path, ended: Ended) -> None:
        if not junit.exists():
            raise TestProblem(
                f"{self._path.name} ended with {ended} and did not write {junit} (RTF_JUNIT, GTEST_OUTPUT)",
                title="no results",
            )
        found = read_junit(junit)
        if not (found or self._session.cases):
            raise TestProblem("the program wrote a JUnit file without a test case", title="no results")
        for case in found:
            cases.report_junit(case)

    def _judge_status(self, status: int | None, text: str) -> None:
        self._session.judged()
        if status == _SKIPPED:
            raise SkipTest(text)
        if status == _HARD_ERROR:
            raise TestProblem(text, title="hard error")
        if status:
            raise TestFailure(text, title="exit status")


class _Output:
    """The output of the program: passed on to the worker's own output, and read as TAP if it is TAP."""

    def __init__(self, cases: CaseReport, mode: str) -> None:
        self._cases = cases
        self._lines = LineCutter()
        self._tap = TapParser() if mode == "tap" else None
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

    def finish(self, *, cut_off: bool) -> bool:
        """Read the last line. Returns whether it was a TAP stream.

        A program that was ``cut_off`` from outside need not have reported everything.
        """
        for line in self._lines.finish():
            self._take_line(line)
        if self._tap is not None:
            self._cases.report_tap(self._tap.finish(cut_off=cut_off))
        return self._tap is not None

    def _take_line(self, line: str) -> None:
        if self._undecided and line.strip():
            self._undecided = False
            if looks_like_tap(line):
                self._tap = TapParser()
        if self._tap is not None:
            self._cases.report_tap(self._tap.feed(line))


def _files_below(folder: Path) -> Iterator[Path]:
    """Yield regular files only, because a link could lead anywhere."""
    for root, folders, files in os.walk(folder):
        folders.sort()
        for name in sorted(files):
            path = Path(root, name)
            if path.is_file() and not path.is_symlink():
                yield path
