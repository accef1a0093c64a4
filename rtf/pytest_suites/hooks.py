"""The hooks of pytest that are registered only in a session with suites."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from rtf.pytest_suites import verdicts
from rtf.pytest_suites.nodes import SuiteItem, planned_suites, suite_items
from rtf.pytest_suites.session import SuiteSession
from rtf.testing.dispatch import groups_sharing_fixtures

if TYPE_CHECKING:
    from collections.abc import Generator

    from rtf.testing.suite.model import TestSuite


_NAME = "rtf-suites"


def register_hooks(config: pytest.Config) -> None:
    """Register the hooks of a session, unless they are registered."""
    if not config.pluginmanager.has_plugin(_NAME):
        config.pluginmanager.register(SuiteHooks(SuiteSession.of(config)), _NAME)


class SuiteHooks:
    """Registered when the first suite file is collected."""

    def __init__(self, shared: SuiteSession) -> None:
        self._shared = shared

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection_modifyitems(self, config: pytest.Config, items: list[pytest.Item]) -> None:
        """Group the tests that pytest-xdist must run on one worker, as they share a fixture or need each other."""
        if config.getoption("forked", False) and any(suite_items(items)):
            raise pytest.UsageError("--forked: a robot test has a process of its own already; leave --forked out")
        if not config.pluginmanager.hasplugin("xdist"):
            return
        groups: dict[str, str] = {}
        for group in groups_sharing_fixtures(planned_suites(items)):
            if any(_needs_one_worker(suite) for suite in group):
                groups |= dict.fromkeys((suite.id for suite in group), group[0].id)
        for item in suite_items(items):
            group_name = groups.get(item.suite_file.suite.id)
            if group_name is not None:
                item.add_marker(pytest.mark.xdist_group(group_name))

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Replace the words of the report by those of the verdict."""
        report = yield
        if isinstance(item, SuiteItem) and item.finished is not None and call.when in ("setup", "call"):
            if call.when == "call":
                report.duration = item.finished.result.duration
            raised = item.raised
            if raised is not None and call.excinfo is not None and call.excinfo.value is raised and not report.skipped:
                report.longrepr = verdicts.longrepr(item.finished, raised)
        elif isinstance(item, SuiteItem):
            item.finished = item.raised = None  # ten thousand tests stay small
        return report

    @pytest.hookimpl(wrapper=True, trylast=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> Generator[None, object, object]:
        """End the run after pytest's teardown and before its summary."""
        result = yield
        self._shared.close(session)
        output = getattr(session.config, "workeroutput", None)
        if output is not None:
            output["rtf"] = self._shared.farewell()
        return result

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Print the paths of the run folder and the reports."""
        for line in self._shared.summary():
            terminalreporter.write_line(line)


def _needs_one_worker(suite: TestSuite) -> bool:
    return bool(suite.fixtures) or any(test.required_tests for test in suite.tests)
