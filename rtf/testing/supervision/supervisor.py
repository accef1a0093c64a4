"""Supervision of fixtures: they are set up in dependency order, watched while tests run, restarted, and torn down.

A worked example, as the suite worker calls it for a test on ``simulator`` and ``logger``. ``simulator`` depends on
``server``; both may be restarted once. Behind each step stands the state of each fixture, with its generation:

=====================================================  ============  ============  ============
step                                                   server        simulator     logger
=====================================================  ============  ============  ============
``adopt(...)``                                         stopped #0    stopped #0    stopped #0
``bring_up([simulator, logger])`` starts what is not
up, in dependency order, each when the last is ready   ready #1      ready #1      ready #1
the test runs; the server's program dies: ``watch()``
emits an incident, and ``lost()`` says so              collapsed #1  ready #1      ready #1
the test is stopped: *fixture lost*. The state is not
known: ``enter_safe_state()`` asks those that are
up, dependents first; it is still due at the server    collapsed #1  ready #1      ready #1
``bring_up(...)`` before the test is run again: what
depends on the collapsed one comes down, then itself   stopped #1    stopped #1    ready #1
after the back-off the server is started, which uses
up its restart; it enters its safe state at once       ready #2      stopped #1    ready #1
the simulator is started; it came down through no
fault of its own, and has its restart left             ready #2      ready #2      ready #1
``confirm()`` has all check once more: the verdict of
the test counts                                        ready #2      ready #2      ready #1
``take_down()``: dependents first, each enters its
safe state and is torn down                            stopped #2    stopped #2    stopped #1
=====================================================  ============  ============  ============

A server that collapses again has no restart left and is *failed*: each test on it, or on something that depends on it,
is blocked. A fixture of a robot whose safe state is due at the end is started once more by ``take_down()``, as long as
it has a restart left. Each generation is a process (``fixture_process``); nothing here runs an author's code.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from msgspec.structs import replace

from rtf import clock
from rtf.testing.events import FixtureChanged, FixtureIncident, Message, OutputCaptured
from rtf.testing.isolation.messages import STOP_LIMIT
from rtf.testing.isolation.worker_pool import ForkServerLostError
from rtf.testing.supervision.fixture_process import Fixture, FixtureProcess
from rtf.testing.verdict import FixtureState, Phase

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from rtf.testing.events import Event
    from rtf.testing.isolation.messages import FailedTest, Job
    from rtf.testing.isolation.worker_pool import ForkServerClient
    from rtf.testing.plugins import PluginRef

__all__ = ["Fixture", "Supervisor"]

_LONGEST_BACK_OFF = 60.0
_INTERRUPTED = "interrupted"


class Supervisor:
    """Keeps a set of fixtures up. For the one thread that waits in the reactor; each suite worker has its own.

    ``stop_now`` returns whether nothing may be started any more, ``kill_now`` whether nothing is waited for either, and
    ``stop_by`` when everything has to be down, if a run has to end at once.
    """

    def __init__(
        self,
        fork_server: ForkServerClient,
        emit: Callable[[Event], None],
        make_job: Callable[[Fixture], Job],
        *,
        running_test: Callable[[], str],
        stop_now: Callable[[], bool],
        kill_now: Callable[[], bool],
        stop_by: Callable[[], clock.Deadline],
    ) -> None:
        self._fork_server = fork_server
        self._emit = emit
        self._running_test = running_test
        self._suite = ""
        self._make_job = make_job
        self._stop_now = stop_now
        self._kill_now = kill_now
        self._stop_by = stop_by
        self._fixtures: dict[str, Fixture] = {}
        self._settling = False  # a safe state that is due is being entered, which only force prevents
        self._unsettled: set[tuple[str, PluginRef | None]] = set()  # forgotten while their safe state was due

    # What the suite's run asks for -------------------------------------------------------------------------------

    def adopt(self, suite: str, fixtures: Iterable[Fixture]) -> None:
        """Take over the fixtures of a suite, in dependency order. A fixture that is known, and equal, stays as it is.

        A fixture with the name and plug-in of one that was dropped while its safe state was due enters the safe state
        instead.
        """
        self._suite = suite
        for fixture in fixtures:
            known = self._fixtures.get(fixture.name)
            if known is not None and known.same_as(fixture):
                continue
            if known is not None:  # another fixture of that name, from an earlier suite of the run
                self.take_down([dependent.name for dependent in self._dependents(known)])
                self.forget([fixture.name])
            if (fixture.name, fixture.entry.found) in self._unsettled:
                self._unsettled.remove((fixture.name, fixture.entry.found))
                fixture.safe_state_due = fixture.secures_robot = True
            fixture.emit = self._complete_and_emit
            self._fixtures[fixture.name] = fixture

    def _complete_and_emit(self, event: Event) -> None:
        """Emit an event of a fixture, with the suite, and with the test that may feel what went wrong."""
        if isinstance(event, FixtureIncident):
            event = replace(event, suite=self._suite, test=self._running_test())
        elif isinstance(event, FixtureChanged | Message | OutputCaptured):
            event = replace(event, suite=self._suite)
        self._emit(event)

    def names(self) -> list[str]:
        """Return the fixtures that are known, in dependency order."""
        return [*self._fixtures]

    def generations(self, names: Iterable[str]) -> dict[str, int]:
        """Return the generation of each of these fixtures."""
        return {name: self._fixtures[name].generation for name in names}

    def variables(self, names: Iterable[str]) -> tuple[tuple[str, str], ...]:
        """Return the environment variables that these fixtures, and those they depend on, provide; the last wins."""
        found: dict[str, str] = {}
        for process in self._processes(names).values():
            found |= process.variables
        return tuple(found.items())

    def values(self, names: Iterable[str]) -> dict[str, dict[str, Any]]:
        """Return the values that these fixtures, and those they depend on, provide, by fixture."""
        return {name: process.values for name, process in self._processes(names).items()}

    def _processes(self, names: Iterable[str]) -> dict[str, FixtureProcess]:
        return {
            fixture.name: fixture.process for fixture in self._with_dependencies(names) if fixture.process is not None
        }

    def lost(self, names: Iterable[str]) -> str:
        """Return what happened to the first of these fixtures that is not up; empty when all are."""
        for name in names:
            fixture = self._fixtures[name]
            if not fixture.ready:
                return f"{name}: {fixture.last_cause or fixture.state}"
        return ""

    def slow_to_stop(self) -> dict[str, float]:
        """Return the fixtures that declare that they need longer to come down than usual, with their seconds."""
        return {
            fixture.name: fixture.stop_limit
            for fixture in self._fixtures.values()
            if fixture.stop_limit > STOP_LIMIT and (fixture.process is not None or fixture.safe_state_due)
        }

    def bring_up(self, names: Iterable[str]) -> str:
        """Bring up these fixtures and those they depend on, and restart collapsed ones; returns what is not usable.

        The text is empty only when all of them are up at that moment: one that collapses while a later one comes up is
        restarted, as long as it has restarts left. It is ``interrupted`` when the run is to stop.
        """
        wanted = self._with_dependencies(names)
        while True:
            self.watch()
            self._take_down_collapsed()
            missing = next((fixture for fixture in wanted if not fixture.ready), None)
            if missing is None:
                return ""
            if self._is_to_stop():
                return _INTERRUPTED
            if missing.state is FixtureState.FAILED:
                return f"fixture {missing.name} is not usable: {missing.failure}"
            self._start(missing)

    def confirm(self, names: Iterable[str]) -> None:
        """Check these fixtures now, so that a collapse under a test does not go unnoticed."""
        self.watch()
        asked = [process for name in names if (process := self._up(name)) is not None]
        for process in asked:
            process.ask("check")
        self._wait(lambda: all(process.answered or not process.up for process in asked))

    def enter_safe_state(self, names: Iterable[str]) -> None:
        """Bring what a stopped or killed test left into a safe state, dependents first.

        A fixture that is not up, or is lost meanwhile, is asked as soon as it is up again. When the run has to end at
        once, all are asked when they come down, which is next.
        """
        self.watch()
        for name in reversed([*names]):
            self._fixtures[name].safe_state_due = True
            if not self._in_a_hurry():
                self._enter_safe_state(name)

    def explain(self, names: Iterable[str], failed: FailedTest) -> None:
        """Have the fixtures that want to hear of it add what they know of a test that did not pass."""
        for fixture in self._with_dependencies(names):
            process = self._up(fixture.name)
            if process is not None and fixture.explains_failures and not self._in_a_hurry():
                process.ask("on_test_failure", failed)
                self._wait(lambda one=process: one.answered or not one.up or self._in_a_hurry())  # type: ignore[misc]

    def take_down(self, names: Iterable[str]) -> None:
        """Tear down these fixtures, dependents first; an error of one does not keep the others up.

        A fixture of a robot that collapsed under a test that was cut short comes up once more for the robot's safe
        state, whatever stops the run but force. If it cannot, an incident says so. Raises an ExceptionGroup, after all
        of them, if the supervision itself failed somewhere.
        """
        chosen = {*names}
        fixtures = [fixture for name, fixture in self._fixtures.items() if name in chosen]
        errors = []
        for step, order in ((self._settle, fixtures), (self._stop, reversed(fixtures))):
            for fixture in order:
                try:
                    step(fixture)
                except Exception as error:  # noqa: BLE001 - raised below, when the others are down
                    errors.append(error)
        if errors:
            raise ExceptionGroup("fixtures could not be taken down in order", errors)

    def forget(self, names: Iterable[str]) -> None:
        """Drop fixtures that are down. A safe state that is still due is kept until :meth:`adopt` gets them again."""
        for name in [*names]:
            fixture = self._fixtures.pop(name, None)
            if fixture is not None and fixture.robot_unsafe:
                self._unsettled.add((name, fixture.entry.found))

    # Up ----------------------------------------------------------------------------------------------------------

    def _up(self, name: str) -> FixtureProcess | None:
        fixture = self._fixtures[name]
        return fixture.process if fixture.ready else None

    def _with_dependencies(self, names: Iterable[str]) -> list[Fixture]:
        wanted: set[str] = set()
        queue = [*names]
        while queue:
            name = queue.pop()
            if name not in wanted:
                wanted.add(name)
                queue.extend(self._fixtures[name].entry.depends)
        return [fixture for name, fixture in self._fixtures.items() if name in wanted]

    def _dependents(self, fixture: Fixture) -> list[Fixture]:
        """Return the fixture and all that depend on it, directly or not; dependents last."""
        found = {fixture.name}
        for other in self._fixtures.values():
            if found.intersection(other.entry.depends):
                found.add(other.name)
        return [other for name, other in self._fixtures.items() if name in found]

    def _take_down_collapsed(self) -> None:
        for fixture in [*self._fixtures.values()]:
            if fixture.state is FixtureState.COLLAPSED:
                for dependent in reversed(self._dependents(fixture)):
                    self._stop(dependent)

    def _start(self, fixture: Fixture) -> None:
        """Start the next generation of a stopped fixture, if it may have one; what it depends on is up."""
        problem = fixture.entry.problem
        if problem:
            fixture.last_cause = problem
            fixture.report(fixture.incident(problem, Phase.LOAD))
        if problem or fixture.used_up:
            fixture.change(FixtureState.FAILED, fixture.failure)
        elif not fixture.last_cause:
            self._start_once(fixture)
        elif self._backed_off(fixture):
            fixture.restarts += 1
            self._start_once(fixture)

    def _start_once(self, fixture: Fixture) -> None:
        fixture.generation += 1
        fixture.last_cause = ""
        try:
            child = self._fork_server.take()
        except ForkServerLostError as error:
            fixture.state = FixtureState.STARTING
            fixture.collapse(fixture.incident(str(error), Phase.SETUP))
            return
        process = FixtureProcess(fixture, child, self._wait, self._kill_now, self._stop_by)
        fixture.process = process
        fixture.change(FixtureState.STARTING)
        process.begin(self._make_job(fixture))
        self._wait(lambda: fixture.state is not FixtureState.STARTING or self._no_longer_startable(fixture))
        if fixture.safe_state_due:
            self._enter_safe_state(fixture.name)
        if not fixture.ready:
            self._stop(fixture)

    def _enter_safe_state(self, name: str) -> None:
        process = self._up(name)
        if process is not None:
            process.ask("enter_safe_state")
            self._wait(lambda: process.answered or not process.up or self._stops_waiting())
            self._fixtures[name].safe_state_due = not (process.answered and process.up)

    def _stops_waiting(self) -> bool:
        """Return whether not to wait for a fixture that enters its safe state; it does so again when it comes down."""
        return self._kill_now() if self._settling else self._in_a_hurry()

    def _in_a_hurry(self) -> bool:
        return self._stop_by().at != clock.FOREVER

    def _backed_off(self, fixture: Fixture) -> bool:
        """Wait out the time before a restart. False when meanwhile the run is to stop, or a fixture below collapsed."""
        pause = clock.Deadline.after(min(_LONGEST_BACK_OFF, fixture.entry.backoff * 2.0**fixture.restarts))
        self._wait(lambda: pause.expired or self._no_longer_startable(fixture), pause)
        return not self._no_longer_startable(fixture)

    def _no_longer_startable(self, fixture: Fixture) -> bool:
        return self._is_to_stop() or not all(self._fixtures[name].ready for name in fixture.entry.depends)

    def _is_to_stop(self) -> bool:
        return self._kill_now() if self._settling else self._stop_now()

    # While tests run ---------------------------------------------------------------------------------------------

    def deadline(self) -> clock.Deadline:
        """Return the moment at which :meth:`watch` has something to do, if nothing is received before."""
        deadline = clock.Deadline()
        for fixture in self._fixtures.values():
            if fixture.process is not None and fixture.state is not FixtureState.COLLAPSED:
                deadline = deadline.earliest(fixture.process.deadline)
        return deadline

    def watch(self) -> None:
        """Handle fixtures whose process has ended, fallen silent or closed its channel; after each event."""
        for fixture in self._fixtures.values():
            if fixture.process is not None:
                fixture.process.look()

    def _wait(self, until: Callable[[], bool], limit: clock.Deadline | None = None) -> None:
        """Serve the reactor until the condition holds, and watch the deadlines of all active fixtures."""
        limit = limit or clock.Deadline()
        while True:
            self.watch()
            if until():
                return
            stop_by = self._stop_by()
            deadline = limit.earliest(self.deadline())
            self._fork_server.reactor.run_once(deadline if stop_by.expired else deadline.earliest(stop_by))

    # Down --------------------------------------------------------------------------------------------------------

    def _settle(self, fixture: Fixture) -> None:
        """Start a fixture once more whose safe state is due, and report one that cannot enter it.

        A fixture that took the due state over from an earlier suite's, and that no test needed, hands it on without a
        report.
        """
        if not fixture.robot_unsafe or fixture.generation == 0 or fixture.ready:
            return  # one that is up enters its safe state when it is stopped
        why = fixture.failure
        if not fixture.used_up:
            self._settling = True
            try:
                problem = self.bring_up([fixture.name])
            finally:
                self._settling = False
            why = problem if problem not in ("", _INTERRUPTED) else "the run was ended by force"
        if fixture.safe_state_due:
            text = f"{fixture.name} did not put back what a test left: {why}"
            fixture.report(fixture.incident(text, Phase.TEARDOWN))

    def _stop(self, fixture: Fixture) -> None:
        process = fixture.process
        if process is None:
            if fixture.state is FixtureState.COLLAPSED:
                fixture.change(FixtureState.STOPPED)
            return
        reason = fixture.last_cause if fixture.state is FixtureState.COLLAPSED else ""
        fixture.change(FixtureState.STOPPING)
        try:
            process.stop(reason)
        finally:
            fixture.process = None
            fixture.change(FixtureState.STOPPED)
