"""A suite worker, with which suites that share a fixture are run, one after the other.

It brings fixtures up and down, and decides what stops a test or a suite: a time-out, an interrupt, the end of the run.
It has a fork server, a reactor and a supervisor of its own, and is used by one thread.
"""

from __future__ import annotations

import json
from collections import Counter
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from rtf import clock
from rtf.testing.dispatch import copy_suffix
from rtf.testing.events import Diagnosed, SuiteEnded, SuiteStarted
from rtf.testing.isolation.attempt import Stop
from rtf.testing.isolation.messages import STOP_LIMIT, Job, Use
from rtf.testing.isolation.worker_pool import ForkServerClient
from rtf.testing.plugin_source import library_modules
from rtf.testing.run_control import KILL_STAGE, alarm
from rtf.testing.suite.model import Scope
from rtf.testing.supervision.supervisor import Fixture, Supervisor
from rtf.testing.verdict import Severity, Verdict

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from rtf.testing.isolation.child import Child
    from rtf.testing.run_state import RunState
    from rtf.testing.suite.model import FixtureEntry, TestSuite


class SuiteWorker:
    """What suites need that are run one after the other: one fork server and one set of fixtures.

    Tests run inside :meth:`at_work` and :meth:`suite`. A caller that learns their order one by one calls :meth:`wait`
    between them. All methods but :meth:`wake` and :meth:`abort` belong to one thread.
    """

    def __init__(self, run: RunState, suites: Sequence[TestSuite]) -> None:
        self.whole_run = run
        self._suites = suites
        self.emit = run.emit
        self._dispatcher = run.dispatcher
        self.running = ""  # the id of the test that runs
        self.current: TestSuite = suites[0] if suites else None  # type: ignore[assignment]  # no suite, no test
        self._suite_deadline = clock.Deadline()
        self._fixtures_deadline = clock.Deadline()  # of a run that has to end at once
        self._stops_before = 0  # what comes after these ends a fixture's teardown by force
        self._aborted = ""
        self._shared: Child | None = None
        self.fork_server = ForkServerClient(
            preload=_modules_to_preload(suites),
            uses=Counter(test.found.path for suite in suites for test in suite.tests if test.found is not None),
            launched=run.take_launched(),
            stop_now=lambda: run.control.stage > 0,
        )
        self.reactor = self.fork_server.reactor
        self.supervisor = Supervisor(
            self.fork_server,
            self.emit,
            self._fixture_job,
            running_test=lambda: self.running,
            stop_now=lambda: bool(self.stop_reason()),
            kill_now=self._use_force,
            stop_by=self._stop_by,
        )

    @contextmanager
    def at_work(self) -> Iterator[None]:
        """Provide a fork server in the block; afterwards all processes of this suite worker are gone."""
        self.whole_run.control.add_reactor(self.reactor)
        try:
            has_plugins = any(test.found is not None for suite in self._suites for test in suite.tests)
            if has_plugins and not self.whole_run.stop_reason():
                self.fork_server.start()
            yield
        finally:
            try:
                self._take_down(self.supervisor.names())
            finally:
                self.whole_run.control.remove_reactor(self.reactor)
                self.fork_server.close()
                for problem in self.fork_server.problems:
                    self.emit(Diagnosed(severity=Severity.WARNING, text=problem))

    def wait(self, until: Callable[[], bool]) -> None:
        """Watch the fixtures until the condition holds; the code that makes it hold must call :meth:`wake`."""
        while not until():
            self.supervisor.watch()
            self.reactor.run_once(self.supervisor.deadline())

    def wake(self) -> None:
        """Make :meth:`wait` check its condition. Any thread."""
        self.reactor.wake()

    def abort(self, reason: str) -> None:
        """Stop the running test, and start nothing until this is taken back with an empty reason. Any thread."""
        self._aborted = reason
        self.reactor.wake()

    # Suites ------------------------------------------------------------------------------------------------------

    @contextmanager
    def suite(self, suite: TestSuite, later: Sequence[TestSuite] = ()) -> Iterator[None]:
        """Run tests of a suite in the block; afterwards its fixtures are down, except those that a ``later`` suite has.

        Its fixtures come up with the first test that needs them.
        """
        self.current = suite
        self.supervisor.adopt(suite.id, map(Fixture, suite.fixtures))
        first, self._suite_deadline = self._dispatcher.enter(suite, self.reactor.wake)
        if self.whole_run.options.terminal:
            self._suite_deadline = clock.Deadline()
        if first:
            self.emit(SuiteStarted(suite=suite.id))
        try:
            with alarm(suite.timeout, self.reactor.wake):
                yield
        finally:
            self._suite_deadline = clock.Deadline()
            self.end_shared()
            kept = _kept_for(suite, later)
            mine = [entry.name for entry in suite.fixtures if entry.name not in kept]
            self._take_down(mine)
            self.supervisor.forget(mine)
            last, duration = self._dispatcher.leave(suite.id, self.reactor.wake)
            if last:
                self.end_suite(suite, duration)

    # Called after each event of a wait, so that an interrupt is reported at once.

    def _use_force(self) -> bool:
        control = self.whole_run.control
        control.announce(self.emit)
        forced = control.stage >= KILL_STAGE and control.count > self._stops_before
        return forced or self._stop_by().expired

    def _stop_by(self) -> clock.Deadline:
        """Return when fixtures have to be down if the run has to end at once; warn if that is later than usual."""
        control = self.whole_run.control
        if control.in_a_hurry and self._fixtures_deadline.at == clock.FOREVER:
            slow = self.supervisor.slow_to_stop()
            more = sum(slow.values()) - len(slow) * STOP_LIMIT
            self._fixtures_deadline = control.fixtures_deadline(more)
            for name, seconds in slow.items():
                text = f"fixture {name} needs up to {seconds:g} s to be brought down safely; the run waits for it"
                self.emit(Diagnosed(severity=Severity.WARNING, text=text, suite=self.current.id))
        return self._fixtures_deadline

    def _take_down(self, names: list[str]) -> None:
        """Tear fixtures down in order first: the force that ended the running test is not used on them."""
        self._stops_before = self.whole_run.control.count
        self.supervisor.take_down(names)

    def end_suite(self, suite: TestSuite, duration: float) -> None:
        """Emit the end of a suite whose tests have ended, after ``duration`` seconds in this part of the run."""
        result = self.whole_run.results.suites[suite.id]
        counts = result.counts()
        bad = any(not verdict.good for verdict in counts) or result.problems
        verdict = Verdict.FAILED if bad else Verdict.PASSED
        done = self.whole_run.options.done  # tests of earlier parts of this run, whose time is the suite's too
        earlier = sum(test.duration for test in result.tests.values() if test.id in done and not test.planned.parent)
        self.emit(
            SuiteEnded(
                suite=suite.id,
                verdict=verdict,
                duration=earlier + duration,
                counts={str(key): count for key, count in counts.items()},
            ),
        )

    # Tests -------------------------------------------------------------------------------------------------------

    def stop_reason(self) -> str:
        """Return why nothing more of this suite may be started, or an empty text."""
        reason = self.whole_run.stop_reason() or self._aborted
        if not reason and self._suite_deadline.expired:
            reason = self._suite_overdue()
        return reason

    def stop_of_test(self) -> Stop | None:
        """Return why the running test must be stopped, whatever the state of its fixtures; None if it need not."""
        control = self.whole_run.control
        reason = self.whole_run.stop_reason() if control.stage else ""
        if control.stage > 1:
            return Stop(Verdict.INTERRUPTED, "interrupted", reason)
        if self._suite_deadline.expired:
            return Stop(Verdict.ERROR, "timeout", self._suite_overdue())
        return Stop(Verdict.ERROR, "aborted", self._aborted) if self._aborted else None

    def _suite_overdue(self) -> str:
        return f"the suite did not end within {self._suite_deadline.limit:g} s"

    def next_tick(self) -> clock.Deadline:
        """Return the moment of the next deadline."""
        deadline = self.supervisor.deadline().earliest(self._suite_deadline)
        hurry = self.whole_run.control.test_deadline
        return deadline if hurry.expired else deadline.earliest(hurry)

    def kills_test(self) -> bool:
        """Return whether the running test is not to be waited for any more."""
        control = self.whole_run.control
        return control.stage >= KILL_STAGE or control.test_deadline.expired

    def shared_child(self) -> Child:
        """Return the process of the tests that share one."""
        if self._shared is None or self._shared.end is not None:
            self._shared = self.fork_server.take()
        return self._shared

    def end_shared(self) -> None:
        """End the shared process, and wait until it is gone."""
        if self._shared is not None:
            self._shared.dismiss()
            self._shared = None

    # Fixtures ----------------------------------------------------------------------------------------------------

    def _fixture_job(self, fixture: Fixture) -> Job:
        entry = fixture.entry
        options = self.whole_run.options
        assert entry.found is not None  # one without a plug-in is never started
        return Job(
            kind="fixture",
            id=entry.name,
            name=entry.name,
            plugin=entry.found,
            folder=str(options.run_folder / "files" / self.current.id / f"fixture-{entry.name}"),
            run_folder=str(options.run_folder),
            use=Use.of(replace(entry, environment=entry.environment or self.current.environment)),
            attempt=fixture.generation,
            check_period=entry.check_period,
            variables=self.supervisor.variables(entry.depends),
            values=self.fixture_values(entry.depends),
        )

    def fixture_values(self, names: Iterable[str]) -> str:
        """Return the values of the fixtures, by the names that the suite gives them, as a JSON text."""
        values = self.supervisor.values(names)
        suffix = copy_suffix(self.current.copy)
        return json.dumps({name.removesuffix(suffix): value for name, value in values.items()}) if values else ""


def _modules_to_preload(suites: Sequence[TestSuite]) -> tuple[str, ...]:
    """Return the modules that the fork server imports: those that suites name, and RTF's that plug-ins import."""
    asked = [name for suite in suites for name in suite.preload]
    found = [entry.found for suite in suites for entry in suite.tests]
    found += [entry.found for suite in suites for entry in suite.fixtures]
    paths = [plugin.path for plugin in found if plugin is not None and plugin.language == "python"]
    own = [name for path in dict.fromkeys(paths) for name in library_modules(Path(path))]
    return tuple(dict.fromkeys([*asked, *own]))


def _kept_for(suite: TestSuite, later: Sequence[TestSuite]) -> set[str]:
    """Return the fixtures of a suite that stay up for a later one: run-scoped, equal there, with all that they need."""
    kept: set[str] = set()
    for entry in suite.fixtures:
        others = (other for following in later for other in following.fixtures if other.name == entry.name)
        following = next(others, None)
        if following is not None and _same(entry, following) and kept.issuperset(entry.depends):
            kept.add(entry.name)
    return kept


def _same(one: FixtureEntry, other: FixtureEntry) -> bool:
    return one.scope is Scope.RUN and replace(one, location=other.location) == other
