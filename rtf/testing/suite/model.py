"""The model of a suite that has been read: fixtures in starting order and tests in running order.

Plain data, without a file format, a plug-in or a process in it. The runner is written against these classes; the XML
that fills them is read in :mod:`rtf.testing.suite.xml`, and choosing among tests is :mod:`rtf.testing.selection`.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from enum import StrEnum
from typing import TYPE_CHECKING

from rtf.errors import Location, RtfError
from rtf.testing.plugin_spec import UNKNOWN, PluginSpec
from rtf.testing.suite.ids import NameBook, slug, suite_id

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rtf.testing.plugins import PluginRef

_NOWHERE = Location()
TEST_REQUIREMENT = "test:"
"""The prefix of a requirement that names another test; behind it stands that test's id."""


class SuiteError(RtfError, ValueError):
    """A suite, a selection or a suite file that cannot be used as it is."""


class Isolation(StrEnum):
    """How many tests share a process: none (``test``), those of a suite, or all of them with the runner (``none``)."""

    TEST = "test"
    SUITE = "suite"
    NONE = "none"


class Expected(StrEnum):
    """The expected outcome of a test."""

    PASS = "pass"  # noqa: S105 - an outcome, not a password
    FAIL = "fail"


class LostPolicy(StrEnum):
    """The treatment of a test whose fixture collapsed under it, once the fixture is up again."""

    RERUN = "rerun"
    ERROR = "error"
    SKIP = "skip"


class Scope(StrEnum):
    """How long a fixture stays up: for one suite, or for the whole run and all suites that name it."""

    SUITE = "suite"
    RUN = "run"


@dataclass(frozen=True, slots=True, kw_only=True)
class Timeouts:
    """Limits in seconds; None means that the next wider default decides."""

    setup: float | None = None
    run: float | None = None
    teardown: float | None = None
    total: float | None = None

    def inherit(self, defaults: Timeouts) -> Timeouts:
        """Fill what is not set here from ``defaults``."""
        return replace(defaults, **{name: limit for name, limit in asdict(self).items() if limit is not None})


@dataclass(frozen=True, slots=True, kw_only=True)
class FixtureEntry:
    """A fixture of a suite.

    ``name`` is unique in the suite. ``backoff`` is the wait in seconds before the first restart and doubles with each
    further one; ``check_period`` is in seconds too. ``on_lost`` None leaves the decision to the test that was lost. In
    a plan it has the plug-in that was ``found``, or the ``problem``, which is why there is none.
    """

    name: str
    plugin: str
    type: str | None = None
    param: str = ""
    parameters: tuple[tuple[str, str], ...] = ()
    environment: str = ""
    depends: tuple[str, ...] = ()
    scope: Scope = Scope.SUITE
    restarts: int = 3
    backoff: float = 0.5
    check_period: float = 0.5
    timeouts: Timeouts = field(default_factory=Timeouts)
    on_lost: LostPolicy | None = None
    location: Location = _NOWHERE
    found: PluginRef | None = field(default=None, repr=False)  # not from the suite, and so not in the fingerprint
    problem: str = field(default="", repr=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class TestEntry:
    """One line of a suite: which plug-in runs, with what, and how its outcome is judged.

    ``id`` is unique in a run and made by :mod:`rtf.testing.suite.ids`. ``repetition`` counts the additional runs of the
    body, ``retries`` the additional attempts after a failure. ``parameters`` holds the suite's values first, so that
    the last of a name wins. ``requires`` entries that begin with ``test:`` name an earlier test by its id.
    Tests that ``occupies`` the same thing never run at the same time.
    ``fixtures`` None means all fixtures of the suite.
    ``cases`` are the only ones that are wanted of a program, each with its id and name; empty means all.
    In a plan it has the plug-in that was ``found`` with its description, or a ``problem`` and is not started.
    """

    __test__ = False  # keeps pytest from collecting a class by the look of its name

    id: str
    name: str
    plugin: str
    type: str | None = None
    param: str = ""
    parameters: tuple[tuple[str, str], ...] = ()
    environment: str = ""
    repetition: int = 0
    retries: int = 0
    timeouts: Timeouts = field(default_factory=Timeouts)
    tags: tuple[str, ...] = ()
    expected: Expected = Expected.PASS
    expected_reason: str = ""
    requires: tuple[str, ...] = ()
    occupies: tuple[str, ...] = ()
    isolation: Isolation = Isolation.TEST
    fixtures: tuple[str, ...] | None = None
    on_lost: LostPolicy = LostPolicy.RERUN
    description: str = ""
    cases: tuple[tuple[str, str], ...] = ()
    location: Location = _NOWHERE
    found: PluginRef | None = None
    spec: PluginSpec = UNKNOWN
    problem: str = ""

    @property
    def required_tests(self) -> tuple[str, ...]:
        """The ids of the tests that have to pass before this one."""
        return tuple(token[len(TEST_REQUIREMENT) :] for token in self.requires if token.startswith(TEST_REQUIREMENT))


@dataclass(frozen=True, slots=True, kw_only=True)
class TestSuite:
    """An ordered list of tests, and their fixtures.

    ``fixtures`` are in starting order: each comes after those it depends on. ``timeouts`` are the defaults of the
    tests, ``timeout`` (seconds) bounds the whole suite. ``environment`` is the last one of the file; each test carries
    the one that applies to it. With ``copies`` so many suite workers may run its tests at the same time, each with
    fixtures of its own, whose ``param`` contains ``${copy}``: in a plan ``fixtures`` are those of the ``copy`` of this
    number, and ``written`` are as the suite has them. Building an inconsistent suite raises SuiteError, so that a
    runner need not check.
    """

    __test__ = False

    id: str
    name: str
    file: str = ""
    description: str = ""
    environment: str = ""
    timeouts: Timeouts = field(default_factory=Timeouts)
    timeout: float | None = None
    tags: tuple[str, ...] = ()
    preload: tuple[str, ...] = ()
    copies: int = 1
    fixtures: tuple[FixtureEntry, ...] = ()
    tests: tuple[TestEntry, ...] = ()
    location: Location = _NOWHERE
    copy: int = 1
    written: tuple[FixtureEntry, ...] = ()

    def __post_init__(self) -> None:
        started: set[str] = set()
        for fixture in self.fixtures:
            if fixture.name in started:
                raise SuiteError(f"suite {self.name!r} has two fixtures named {fixture.name!r}; rename one")
            _require_known(f"fixture {fixture.name!r}", fixture.depends, started, self.name)
            started.add(fixture.name)
        ids: set[str] = set()
        for test in self.tests:
            if test.id in ids:
                raise SuiteError(f"suite {self.name!r} has two tests with the id {test.id!r}; give one another id")
            ids.add(test.id)
            _require_known(f"test {test.id!r}", test.fixtures or (), started, self.name)

    def timeouts_of(self, test: TestEntry) -> Timeouts:
        """Return the limits of a test with the suite's defaults filled in."""
        return test.timeouts.inherit(self.timeouts)

    def fixtures_of(self, test: TestEntry) -> tuple[FixtureEntry, ...]:
        """Return all fixtures of a test, also those its fixtures depend on, in starting order."""
        if test.fixtures is None:
            return self.fixtures
        needed = set(test.fixtures)
        for fixture in reversed(self.fixtures):
            if fixture.name in needed:
                needed.update(fixture.depends)
        return tuple(fixture for fixture in self.fixtures if fixture.name in needed)

    def with_tests(self, tests: Iterable[TestEntry]) -> TestSuite:
        """Return the same suite with other tests, or with the same ones in another order."""
        return replace(self, tests=tuple(tests))

    def with_id(self, suite_id: str) -> TestSuite:
        """Return the same suite under another id; its tests' ids and the requirements that name them follow."""
        if suite_id == self.id:
            return self
        renamed = {test.id: f"{suite_id}/{test.id.removeprefix(self.id + '/')}" for test in self.tests}
        tests = (
            replace(test, id=renamed[test.id], requires=tuple(_follow(token, renamed) for token in test.requires))
            for test in self.tests
        )
        return replace(self, id=suite_id, tests=tuple(tests))


def suite_id_of(name: str) -> str:
    """Return the id of a suite of this name when it is the first of its name in a run."""
    return slug(name, "suite")


def number_suites(suites: Iterable[TestSuite], names: NameBook | None = None) -> tuple[TestSuite, ...]:
    """Make the ids of the suites of one run unique; ``names`` holds those of its suites so far."""
    names = names or NameBook("+")
    return tuple(suite.with_id(suite_id(suite.name, suite.file, names)) for suite in suites)


def _require_known(what: str, names: Iterable[str], known: set[str], suite: str) -> None:
    for name in names:
        if name not in known:
            raise SuiteError(f"{what} of suite {suite!r} needs fixture {name!r}, which does not stand before it")


def _follow(token: str, renamed: dict[str, str]) -> str:
    if not token.startswith(TEST_REQUIREMENT):
        return token
    target = token[len(TEST_REQUIREMENT) :]
    return TEST_REQUIREMENT + renamed.get(target, target)
