"""Suites as pytest files and their tests as items."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from rtf.pytest_suites import texts, verdicts
from rtf.pytest_suites.properties import properties
from rtf.pytest_suites.session import SuiteSession
from rtf.pytest_suites.warnings import SuiteFileWarning
from rtf.testing.dispatch import uses
from rtf.testing.report.text import place, shown

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from rtf.pytest_suites.conductor import Conductor
    from rtf.pytest_suites.listener import FinishedTest
    from rtf.testing.events import Diagnosed
    from rtf.testing.suite.model import TestEntry, TestSuite

_NOT_IN_A_MARKER = re.compile(r"[^\w.+-]")
#: Markers that pytest and common plug-ins act upon: a tag of that name is a word, and no order.
_ACTED_UPON = frozenset(
    {
        *("skip", "skipif", "xfail", "parametrize", "usefixtures", "filterwarnings", "tryfirst", "trylast"),
        *("timeout", "xdist_group", "forked", "flaky", "repeat", "order", "run", "dependency", "asyncio", "anyio"),
    }
)


class SuiteFile(pytest.File):
    """A suite file. Its fixtures are torn down before those of another suite are started."""

    _suite: TestSuite | None = None
    _begun = False

    def collect(self) -> Iterable[pytest.Item]:
        """Load the suite and collect its tests; nothing is collected of a file with errors."""
        suite, loaded = self.shared.load(self.path)
        if suite is None:
            raise self.CollectError("\n".join(_said(diagnosed) for diagnosed in loaded.diagnostics) or "not a suite")
        for diagnosed in loaded.diagnostics:
            self.warn(SuiteFileWarning(_said(diagnosed)))
        self._suite = suite
        prefix = f"{suite.id}/"
        return [SuiteItem.from_parent(self, name=test.id.removeprefix(prefix), test=test) for test in suite.tests]

    @property
    def shared(self) -> SuiteSession:
        """The session object, which all suites share."""
        return SuiteSession.of(self.config)

    @property
    def suite(self) -> TestSuite:
        """The suite with all its tests."""
        assert self._suite is not None, "the file has not been collected"
        return self._suite

    @property
    def conductor(self) -> Conductor:
        """The conductor of the session."""
        return self.shared.conductor(lambda: planned_suites(self.session.items))

    def setup(self) -> None:
        """Prepare the run for the suite. Fixtures are started by the first test that needs them."""
        if self.config.getoption("setupplan", False):
            return
        conductor = self.conductor
        if self.shared.locks is not None:
            self.shared.locks.acquire(uses(self.suite))
        self._begun = True
        conductor.begin_suite(self.suite)

    def teardown(self) -> None:
        """Tear down the fixtures, and report those problems that no test has reported."""
        if not self._begun:
            return
        self._begun = False
        try:
            self.conductor.end_suite()
        finally:
            if self.shared.locks is not None:
                self.shared.locks.release()
        problems = self.shared.listener.take_suite_problems()
        if problems and not self.conductor.interrupted:
            pytest.fail("\n\n".join(texts.suite_problem(event) for event in problems), pytrace=False)


class SuiteItem(pytest.Item):
    """A test of a suite."""

    def __init__(self, *, test: TestEntry, **others: Any) -> None:  # what pytest hands through
        super().__init__(**others)
        self.test = test
        self.raised: BaseException | None = None
        self.finished: FinishedTest | None = None
        self.extra_keyword_matches.add(test.id)
        for tag in dict.fromkeys((*self.suite_file.suite.tags, *test.tags)):
            self._mark(tag)

    @property
    def suite_file(self) -> SuiteFile:
        """The file of the suite."""
        assert isinstance(self.parent, SuiteFile)
        return self.parent

    def _mark(self, tag: str) -> None:
        name = marker_name(tag)
        known = self.suite_file.shared.markers
        if name not in known:
            known.add(name)
            self.config.addinivalue_line("markers", f"{name}: a tag of robot tests")
        self.add_marker(name)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """Return the place of the test in its suite or an included file, and the heading of its failure."""
        at = self.test.location
        heading = f"{self.suite_file.suite.name}: {self.name}"  # a mere name would be shown with dots as colons
        return Path(at.file) if at.file else self.path, max(0, at.line - 1), shown(heading)

    def setup(self) -> None:
        """Start the fixtures of the test. A test that cannot be started fails here."""
        self.finished = self.raised = None
        if self.config.getoption("setupplan", False):
            return
        if not self.suite_file.conductor.bring_up(self.suite_file.suite, self.test):
            self._run()

    def runtest(self) -> None:
        """Run the test."""
        self._run()

    def _run(self) -> None:
        conductor = self.suite_file.conductor
        shared = self.suite_file.shared
        try:
            conductor.run(self.test)
        finally:
            self.finished = shared.listener.take_test(self.test.id)
        if conductor.interrupted:
            self.session.shouldstop = "the run of the robot tests was stopped"
        finished = self.finished
        if finished is None:
            raise RuntimeError(f"the runner said nothing of {self.test.id}")
        self._conclude(finished, shared)

    def _conclude(self, finished: FinishedTest, shared: SuiteSession) -> None:
        assert shared.run_folder is not None
        when = "call" if finished.ended.attempt else "setup"
        for name, text in texts.sections(finished):
            self.add_report_section(when, name, text)
        self.user_properties.extend(properties(finished, shared.run_folder))
        self.raised = verdicts.exception_for(finished, self.config, anything_red=shared.anything_red)
        if self.raised is None:
            try:
                verdicts.warn_about(self, finished)
            except Warning as warning:  # where warnings are errors
                self.raised = warning
        if self.raised is not None:
            shared.anything_red |= not finished.verdict.good
            raise self.raised


def marker_name(tag: str) -> str:
    """Return the marker for a tag: a name that ``-m`` can read and that has no meaning for pytest."""
    name = _NOT_IN_A_MARKER.sub("_", tag)
    return f"tag_{name}" if name.startswith("_") or name in _ACTED_UPON else name


def _said(diagnosed: Diagnosed) -> str:
    hint = f" ({diagnosed.hint})" if diagnosed.hint else ""
    return f"{place(diagnosed.file, diagnosed.line, diagnosed.column)}: {diagnosed.severity}: {diagnosed.text}{hint}"


def planned_suites(items: Iterable[pytest.Item]) -> list[TestSuite]:
    """Return the suites of a session with their selected tests, in the order of their first tests."""
    selected: dict[SuiteFile, list[TestEntry]] = {}
    for item in suite_items(items):
        selected.setdefault(item.suite_file, []).append(item.test)
    return [replace(file.suite, tests=tuple(tests)) for file, tests in selected.items()]


def suite_items(items: Iterable[pytest.Item]) -> Iterator[SuiteItem]:
    """Return the items that are tests of suites."""
    return (item for item in items if isinstance(item, SuiteItem))
