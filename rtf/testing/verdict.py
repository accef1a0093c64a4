"""The verdicts of tests, suites and runs, and the exceptions with which a test ends itself."""

from __future__ import annotations

from enum import IntEnum, StrEnum
from typing import TYPE_CHECKING

from rtf.errors import RtfError

if TYPE_CHECKING:
    from rtf.testing.measurement import Measurement


class Verdict(StrEnum):
    """The verdict of one test.

    ``failed`` means the thing under test is wrong; ``error`` means it could not be tested. The two are never mixed.
    The order is that of reports: what needs attention comes first.
    """

    FAILED = "failed"
    ERROR = "error"
    FIXTURE_LOST = "fixture lost"  # a fixture of the test collapsed during the test
    UNEXPECTED_PASS = "unexpected pass"  # noqa: S105 - a verdict, not a secret
    INCONCLUSIVE = "inconclusive"
    INTERRUPTED = "interrupted"
    BLOCKED = "blocked"  # a fixture or another test it needs is not usable
    NOT_RUN = "not run"
    FLAKY = "flaky"  # failed first, passed in a later attempt
    EXPECTED_FAILURE = "expected failure"
    SKIPPED = "skipped"
    MEASURED = "measured"  # data were recorded, nothing was judged
    PASSED = "passed"

    @property
    def good(self) -> bool:
        """Whether a run in which every test ends like this may end with exit code 0."""
        return self in _GOOD

    @property
    def ran(self) -> bool:
        """Whether the test's body was started and reached a verdict of its own."""
        return self not in _DID_NOT_RUN


_GOOD = frozenset(
    {Verdict.PASSED, Verdict.MEASURED, Verdict.SKIPPED, Verdict.EXPECTED_FAILURE, Verdict.FLAKY},
)
_DID_NOT_RUN = frozenset({Verdict.SKIPPED, Verdict.BLOCKED, Verdict.NOT_RUN})


class ExitCode(IntEnum):
    """The exit code of a run. Documented, and never changed once released."""

    PASSED = 0
    FAILURES = 1
    INTERRUPTED = 2
    INTERNAL = 3
    USAGE = 4
    NOTHING_RAN = 5
    FIXTURE = 6


class Severity(StrEnum):
    """The severity of a message. ``pass`` is a check that held."""

    DEBUG = "debug"
    INFO = "info"
    PASS = "pass"  # noqa: S105 - a word, not a secret
    WARNING = "warning"
    FAILURE = "failure"
    ERROR = "error"


class Phase(StrEnum):
    """The phase of a test or fixture."""

    LOAD = "load"
    SETUP = "setup"
    RUN = "run"
    TEARDOWN = "teardown"
    CLEANUP = "cleanup"
    CHECK = "check"


#: Those in which a test undoes what it has done.
UNDOING_PHASES = (Phase.TEARDOWN, Phase.CLEANUP)


class FixtureState(StrEnum):
    """The state of a fixture."""

    STARTING = "starting"
    READY = "ready"
    COLLAPSED = "collapsed"
    STOPPING = "stopping"
    STOPPED = "stopped"
    FAILED = "failed"  # its restarts are used up


# Exceptions, each also a fitting built-in ----------------------------------------------------------------------------


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
    """The test ran and cannot judge: not enough samples, disturbed conditions."""


class TestStopped(BaseException):
    """The runner asks the test to end now: time-out, lost fixture or interrupt. Not for authors to catch."""

    __test__ = False


class FixtureCollapsed(TestingError, RuntimeError):
    """Raised in a fixture's ``check``, with the reason why tests cannot use it any more."""
