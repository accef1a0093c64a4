"""The state that all suites of a pytest session share: settings, run, journal and reports."""

from __future__ import annotations

import os
import threading
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from rtf.pytest_suites.conductor import Conductor
from rtf.pytest_suites.listener import Listener
from rtf.pytest_suites.locks import FixtureLocks, lock_file
from rtf.pytest_suites.settings import LIVE_PAGE, Settings
from rtf.testing.broadcast import Broadcast
from rtf.testing.journal import FILE_NAME, Journal, make_run_folder
from rtf.testing.plan import Plan, Planner, load_files
from rtf.testing.report.text import near_path
from rtf.testing.reporter_thread import bounded, let_linger
from rtf.testing.reporting import Reporter, ReportOptions, load_reporter
from rtf.testing.run_control import Control
from rtf.testing.run_state import RunOptions
from rtf.testing.runner import most_memory
from rtf.testing.suite.ids import NameBook
from rtf.testing.suite.model import Timeouts, number_suites

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.testing.events import Diagnosed
    from rtf.testing.suite.model import TestSuite

_KEY = pytest.StashKey["SuiteSession"]()


class SuiteSession:
    """The robot tests of one pytest session, or of one worker of it. It begins its run with the first test."""

    def __init__(self, config: pytest.Config) -> None:
        self._config = config
        self._settings = Settings.of(config)
        self._planner = Planner(self._settings.overrides)
        self._suite_ids = NameBook("+")
        self._diagnostics: list[Diagnosed] = []
        self._reporters: list[Reporter] = []
        self._left_behind: list[tuple[Reporter, Exception]] = []
        self._conductor: Conductor | None = None
        self._listener: Listener | None = None
        self._refused = ""
        self._closed = False
        self.run_folder: Path | None = None
        self.anything_red = False
        self.markers: set[str] = set()  # names of markers that pytest knows
        self._workerinput: dict[str, str] = getattr(config, "workerinput", {})  # pytest-xdist puts it there
        self.worker = self._workerinput.get("workerid", "")
        self._locks = FixtureLocks(lock_file(self._workerinput["testrunuid"])) if self.worker else None

    @classmethod
    def of(cls, config: pytest.Config) -> SuiteSession:
        """Return the object of a session; the first call makes it."""
        known = config.stash.get(_KEY, None)
        if known is None:
            known = config.stash[_KEY] = cls(config)
        return known

    # Collecting --------------------------------------------------------------------------------------------------

    def load(self, path: Path) -> tuple[TestSuite | None, Plan]:
        """Read a suite file. Returns None for a file with errors."""
        loaded = load_files([(path, True)], self._settings.variables, lenient=self._settings.lenient)
        if loaded.has_errors or not loaded.suites:
            return None, loaded
        self._diagnostics += loaded.diagnostics
        (suite,) = self._planner.plan(number_suites(loaded.suites, self._suite_ids))
        return suite, loaded

    # Running -----------------------------------------------------------------------------------------------------

    def conductor(self, planned: Callable[[], list[TestSuite]]) -> Conductor:
        """The conductor of the session; the first call begins the run of the ``planned`` suites."""
        if self._conductor is None and not self._refused:
            try:
                self._conductor = self._begin(planned())
            except OSError as error:
                self._refused = f"robot tests: {error}"
        if self._conductor is not None:
            return self._conductor
        if self.worker:  # which cannot end the session; each of its tests says why it was not run
            pytest.fail(self._refused, pytrace=False)
        pytest.exit(self._refused, returncode=pytest.ExitCode.USAGE_ERROR)

    @property
    def listener(self) -> Listener:
        """The reporter that collects the results for pytest."""
        assert self._listener is not None, "nothing has been run yet"
        return self._listener

    @property
    def locks(self) -> FixtureLocks | None:
        """The locks that keep other workers from using a fixture at the same time."""
        return self._locks

    def _begin(self, suites: list[TestSuite]) -> Conductor:
        settings = self._settings
        folder = make_run_folder(settings.runs.resolve(), settings.robot, "pytest", self.worker)
        self.run_folder = folder
        control = Control(answer=settings.answer)
        self._listener = Listener(ReportOptions(target=None, run_folder=folder))
        journal = Journal(folder / FILE_NAME, latest=True)
        try:
            self._open_reporters(folder, control)
        except OSError:
            journal.close()
            raise
        broadcast = Broadcast(journal, [*self._reporters], listener=self._listener)
        conductor = Conductor(suites, self._options(folder, control), broadcast, self._diagnostics)
        conductor.start()
        return conductor

    def _options(self, folder: Path, control: Control) -> RunOptions:
        settings = self._settings
        return RunOptions(
            run_folder=folder,
            limits=Timeouts(run=settings.timeout),
            memory=most_memory(),
            overrides=settings.overrides,
            features=settings.features,
            retries=settings.retries,
            robot=settings.robot,
            station=settings.station,
            command=("pytest", *map(str, self._config.invocation_params.args)),
            control=control,
            plan_ahead=not self.worker,  # a worker does not know which tests it will be given
            facts=self._facts(),
        )

    def _facts(self) -> dict[str, str]:
        facts = {"pytest": pytest.__version__}
        if self.worker:  # by which the records of one session's workers find together
            facts |= {"worker": self.worker, "session": self._workerinput["testrunuid"]}
        return facts

    def _open_reporters(self, folder: Path, control: Control) -> None:
        try:
            for name, target in self._settings.reports:
                self._reporters.append(self._open(name, target, folder, control))
        except OSError:
            self._let_reporters_go()
            raise

    def _let_reporters_go(self) -> None:
        self._left_behind += let_linger(self._reporters, threading.Event())

    def _open(self, name: str, target: str, folder: Path, control: Control) -> Reporter:
        kind = load_reporter(name)
        live = name == LIVE_PAGE
        options = ReportOptions(
            target=None if live else self._target(target, folder, kind.default_file),
            run_folder=folder,
            verbosity=-1,
            colour=False,
            extra={"port": target} if live and target else {},
            control=control,
        )
        reporter = kind(options)
        capture = self._config.pluginmanager.getplugin("capturemanager")
        try:
            with capture.global_and_fixture_disabled() if capture else nullcontext():  # it may say where to look
                bounded(reporter, "open")
        except (OSError, ValueError) as error:
            raise OSError(f"report {name} cannot be written: {error}") from None
        return reporter

    def _target(self, target: str, folder: Path, default: str) -> Path | None:
        if not target:
            return folder / default if default else None
        path = Path(target).absolute()
        return path.with_name(f"{path.stem}-{self.worker}{path.suffix}") if self.worker else path

    # The end -----------------------------------------------------------------------------------------------------

    def close(self, session: pytest.Session) -> None:
        """End the run and release all resources. May be called repeatedly."""
        if self._conductor is not None and not self._closed:
            self._conductor.close()
            self._closed = True
            self._let_reporters_go()
            if self.broken:
                session.exitstatus = pytest.ExitCode.INTERNAL_ERROR
        if self._locks is not None:
            self._locks.close()

    def farewell(self) -> dict[str, Any]:
        """Return the results that a worker of xdist sends to its controller."""
        return {"lines": self.summary(), "broken": self.broken}

    @property
    def broken(self) -> bool:
        """Whether the framework or a reporter has failed."""
        return bool(self._left_behind) or (self._listener is not None and bool(self._listener.broken))

    def summary(self) -> list[str]:
        """Return the lines with the paths of run folder and reports, and with errors of the framework."""
        if self.run_folder is None:
            return []
        lines = [f"robot tests: {near_path(str(self.run_folder))}"]
        for reporter in self._reporters:
            lines += [f"robot tests: {near_path(os.fspath(path))}" for path in bounded(reporter, "paths")]
        if self._listener is not None:
            lines += [f"robot tests: internal error: {event.text}\n{event.traceback}" for event in self.listener.broken]
        for reporter, error in self._left_behind:
            lines.append(f"robot tests: reporter {type(reporter).plugin_name} is left behind: {error}")
        return lines
