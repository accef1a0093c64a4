"""Verdicts in pytest's terms: a test passes, or an exception says what it came to, and the report says it in our words.

=================================================  ==========================================================
verdict                                            in pytest
=================================================  ==========================================================
passed, measured                                   passed
flaky                                              passed, with a warning
skipped                                            skipped
expected failure                                   xfailed (failed under ``--runxfail``)
unexpected pass                                    failed (passed under ``--runxfail``)
failed                                             failed
error, fixture lost, inconclusive, interrupted     failed, or an error of the setup if it never started
blocked                                            likewise
not run                                            skipped; an error of the setup if nothing else is red for it
=================================================  ==========================================================
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

# pytest has no public way to make the text of a failure that survives the way from a worker to the terminal and has a
# line for the short summary; these classes are what its own reports consist of.
from _pytest._code.code import ReprExceptionInfo, ReprFileLocation, ReprTracebackNative

from rtf.pytest_suites import texts
from rtf.pytest_suites.warnings import FixtureWarning, FlakyTestWarning
from rtf.testing.report.text import incident, near_path, one_line
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from rtf.pytest_suites.listener import FinishedTest

_PASSED = (Verdict.PASSED, Verdict.MEASURED, Verdict.FLAKY)


class NotTestedError(Exception):
    """A robot test could not be carried out, so the robot was not judged."""


def exception_for(finished: FinishedTest, config: pytest.Config, *, anything_red: bool) -> BaseException | None:
    """Return the exception that reports a verdict to pytest; None for a pass."""
    verdict = finished.verdict
    if verdict is Verdict.UNEXPECTED_PASS and config.getoption("runxfail", False):
        return None
    if verdict in _PASSED:
        return None
    text = texts.headline(finished)
    if verdict is Verdict.SKIPPED or (verdict is Verdict.NOT_RUN and anything_red):
        reason = finished.ended.detail or finished.ended.reason
        return pytest.skip.Exception(text if verdict is Verdict.NOT_RUN else one_line(reason), _use_item_location=True)
    if verdict is Verdict.EXPECTED_FAILURE:
        return pytest.xfail.Exception(one_line(finished.ended.detail), pytrace=False)
    if verdict in (Verdict.FAILED, Verdict.UNEXPECTED_PASS):
        return pytest.fail.Exception(text, pytrace=False)
    return NotTestedError(text)


def warn_about(item: pytest.Item, finished: FinishedTest) -> None:
    """Issue a warning for what the report of a passing test does not show."""
    if finished.verdict is Verdict.FLAKY:
        first = texts.earlier_attempt(finished.earlier[0]) if finished.earlier else "it failed before"
        item.warn(FlakyTestWarning(f"passed at attempt {finished.ended.attempt}; {one_line(first)}"))
    for event in finished.incidents:
        item.warn(FixtureWarning(one_line(incident(event))))


def longrepr(finished: FinishedTest, raised: BaseException) -> ReprExceptionInfo:
    """Return the text of a failed test, with the line for the summary and its place."""
    headline, text = texts.headline(finished), texts.explanation(finished)
    if isinstance(raised, Warning):
        headline = f"{type(raised).__name__}: {raised}"
        text = f"{headline}\n\n{text}"
    file, line = texts.where(finished)
    return ReprExceptionInfo(
        reprtraceback=ReprTracebackNative([f"{text}\n"]),
        reprcrash=ReprFileLocation(path=near_path(file), lineno=line, message=headline),
    )
