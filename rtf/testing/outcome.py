"""The exceptions with which a test says that it is over, each also a fitting built-in."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.errors import RtfError

if TYPE_CHECKING:
    from rtf.testing.measurement import Measurement


class TestingError(RtfError):
    """Base of the errors of the testing layer."""

    __test__ = False


class TestFailure(TestingError, AssertionError):
    """The thing under test is wrong; the test, or the sub-result it is raised in, ends as failed."""

    __test__ = False

    def __init__(
        self,
        detail: str,
        *,
        title: str = "asserts failure with exception",
        measurement: Measurement | None = None,
    ) -> None:
        super().__init__(detail)
        self.title = title
        self.detail = detail
        self.measurement = measurement


class TestProblem(TestingError, RuntimeError):
    """The test could not be carried out; it ends as an error."""

    __test__ = False

    def __init__(self, detail: str, *, title: str = "asserts error with exception") -> None:
        super().__init__(detail)
        self.title = title
        self.detail = detail


class SkipTest(TestingError, Exception):
    """There is nothing to test here, for a reason that is no defect."""


class Inconclusive(TestingError, Exception):
    """The test ran, and nothing can be said: not enough samples, disturbed conditions."""


class TestStopped(BaseException):
    """The runner asks the test to end now: time-out, lost fixture or interrupt. Not for authors to catch."""

    __test__ = False


class FixtureCollapsed(TestingError, RuntimeError):
    """A fixture says from its own ``check`` why it can no longer be stood on."""
