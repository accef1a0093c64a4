"""Supervision of fixtures: they are set up in dependency order, watched while tests run, restarted, and torn down.

A worked example. ``server`` stands alone, ``simulator`` depends on it, ``logger`` stands alone; a test needs all three.

====================================  ===========  ===========  ===========
what happens                          server       simulator    logger
====================================  ===========  ===========  ===========
set up, in dependency order           ready #1     ready #1     ready #1
the server's program dies             collapsed    ready #1     ready #1
the test is stopped: fixture lost
dependents come down first            collapsed    stopped      ready #1
then the collapsed one                stopped      stopped      ready #1
set up again, after the back-off      ready #2     ready #2     ready #1
the test is run again on #2, #2, #1
====================================  ===========  ===========  ===========

What is up parks as soon as the test was stopped: nobody knows what that left behind. ``server`` is asked to when it is
up again. The restart counts for ``server`` alone: ``simulator`` came down through no fault of its own. When ``server``
has used up its restarts it is *failed*, and every test that needs it, or something that depends on it, is blocked. Each
generation is a process (``generation``); nothing here runs an author's code.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rtf import clock
from rtf.testing.isolation.messages import STOP_LIMIT
from rtf.testing.isolation.worker_pool import ForkServerLostError
from rtf.testing.supervision.fixture_process import FixtureProcess
from rtf.testing.supervision.fixture_record import Cause, Fixture, Notes
from rtf.testing.verdict import FixtureState, Phase

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from rtf.testing.events import Event
    from rtf.testing.isolation.messages import Job
    from rtf.testing.isolation.worker_pool import ForkServerClient
    from rtf.testing.plugins import PluginRef

__all__ = ["Fixture", "Supervisor"]

_LONGEST_BACK_OFF = 60.0
_INTERRUPTED = "interrupted"


class Supervisor:
    """Keeps a set of fixtures up. One thread's, with the reactor that thread waits in; each suite worker has its own.

    ``stop_now`` says that nothing is to be started any more, ``kill_now`` that nothing is to be waited for either, and
    ``stop_by`` when everything has to be down, of a run that has to end at once.
    """

    def __init__(
        self,
        fork_server: ForkServerClient,
        emit: Callable[[Event], None],
        make_job: Callable[[Fixture], Job],
        *,
        running_test: Callable[[], str],
        stop_now: Callable[[], bool],
        kill_now: Callable[[], bool] = lambda: False,
        stop_by: Callable[[], clock.Deadline] = clock.Deadline,
    ) -> None:
        self._fork_server = fork_server
        self._notes = Notes(emit, running_test)
        self._make_job = make_job
        self._stop_now = stop_now
        self._kill_now = kill_now
        self._stop_by = stop_by
        self._fixtures: dict[str, Fixture] = {}
        self._settling = False  # what a test left is being put right, which only force keeps from being done
        self._unsettled: set[tuple[str, PluginRef | None]] = set()  # what was forgotten while it owed a park

    @property
    def suite(self) -> str:
        """The suite in whose name events are told."""
        return self._notes.suite

    @suite.setter
    def suite(self, suite: str) -> None:
        self._notes.suite = suite

    # What the suite's run asks for -------------------------------------------------------------------------------

    def adopt(self, fixtures: Iterable[Fixture]) -> None:
        """Take over fixtures, given in dependency order. One that is known, and the same, stays as it is.

        One by the name and plug-in of one that was forgotten while it owed a park owes it instead.
        """
        for fixture in fixtures:
            known = self._fixtures.get(fixture.name)
            if known is not None and _same(known, fixture):
                continue
            if known is not None:  # another fixture of that name, from an earlier suite of the run
                self.take_down([dependent.name for dependent in self._dependents(known)])
                self.forget([fixture.name])
            fixture.restarts_left = fixture.entry.restarts
            if (fixture.name, fixture.plugin) in self._unsettled:
                self._unsettled.remove((fixture.name, fixture.plugin))
                fixture.owes_safe_state = fixture.secures_robot = True
            self._fixtures[fixture.name] = fixture

    def names(self) -> list[str]:
        """The fixtures that are known, in dependency order."""
        return [*self._fixtures]

    def generations(self, names: Iterable[str]) -> dict[str, int]:
        """The generation of each of these fixtures."""
        return {name: self._fixtures[name].generation for name in names}

    def variables(self, names: Iterable[str]) -> tuple[tuple[str, str], ...]:
        """What these fixtures, and those they depend on, provide for who stands on them; the last one has its way."""
        found: dict[str, str] = {}
        for fixture in self._with_dependencies(names):
            found |= fixture.variables
        return tuple(found.items())

    def values(self, names: Iterable[str]) -> dict[str, dict[str, Any]]:
        """The values that these fixtures, and those they depend on, hand to those that stand on them."""
        return {fixture.name: fixture.values for fixture in self._with_dependencies(names)}

    def lost(self, names: Iterable[str]) -> str:
        """What happened to the first of these fixtures that is not up, or an empty text when all are."""
        for name in names:
            fixture = self._fixtures[name]
            if not fixture.ready:
                return f"{name}: {fixture.last_cause or fixture.state}"
        return ""

    def slow_to_stop(self) -> dict[str, float]:
        """The fixtures that declare that they need more time to come down than usual, with the seconds they need."""
        return {
            fixture.name: fixture.stop_limit
            for fixture in self._fixtures.values()
            if fixture.stop_limit > STOP_LIMIT and (fixture.process is not None or fixture.owes_safe_state)
        }

    def bring_up(self, names: Iterable[str]) -> str:
        """Have these fixtures and what they depend on up, restarting what collapsed; says what is not usable.

        Comes back with an empty text only when all of them are up at that moment: one that collapses while a later one
        comes up is restarted, as long as it has restarts left. Says ``interrupted`` when the run is to stop.
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
        """Have these fixtures look now, so that nothing that happened under a test goes unnoticed."""
        self.watch()
        asked = [process for name in names if (process := self._up(name)) is not None]
        for process in asked:
            process.ask("check")
        self._wait(lambda: all(process.answered or not process.up for process in asked))

    def enter_safe_state(self, names: Iterable[str]) -> None:
        """Have what a stopped or killed test left brought into a safe state, dependents first.

        A fixture that is not up, or is lost meanwhile, is asked as soon as it is up again. When the run has to end at
        once, all are asked when they come down, which is next.
        """
        self.watch()
        for name in reversed([*names]):
            self._fixtures[name].owes_safe_state = True
            if not self._in_a_hurry():
                self._enter_safe_state(name)

    def take_down(self, names: Iterable[str] | None = None) -> None:
        """Tear down these fixtures (default: all), dependents first; whatever goes wrong with one, all are done.

        One of a robot that is there, which collapsed under a test that was cut short, comes up once more to park it,
        whatever stops the run but force. Where it cannot, an incident says so.
        Raises an ExceptionGroup, after all of them, if the supervision itself failed somewhere.
        """
        chosen = {*self._fixtures} if names is None else {*names}
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
        """Drop fixtures that are down. What they still owe is remembered for those that :meth:`adopt` gets later."""
        for name in [*names]:
            fixture = self._fixtures.pop(name, None)
            if fixture is not None and _owes_safe_state(fixture):
                self._unsettled.add((name, fixture.plugin))

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
        """What stands on a fixture, directly or not, the fixture itself included; dependents last."""
        found = {fixture.name}
        for other in self._fixtures.values():
            if found.intersection(other.entry.depends):
                found.add(other.name)
        return [other for name, other in self._fixtures.items() if name in found]

    def _take_down_with_dependents(self, fixture: Fixture) -> None:
        for dependent in reversed(self._dependents(fixture)):
            self._stop(dependent)

    def _take_down_collapsed(self) -> None:
        for fixture in [*self._fixtures.values()]:
            if fixture.state is FixtureState.COLLAPSED:
                self._take_down_with_dependents(fixture)

    def _start(self, fixture: Fixture) -> None:
        """Start the next generation of a stopped fixture, if it may have one; what it depends on is up."""
        if _used_up(fixture):
            self._give_up(fixture)
        elif fixture.plugin is None:
            fixture.last_cause = fixture.problem
            self._notes.incident(fixture, Cause(text=fixture.problem, phase=Phase.LOAD))
            self._give_up(fixture)
        elif fixture.owes_restart and not self._backed_off(fixture):
            return
        else:
            if fixture.owes_restart:
                fixture.restarts_left -= 1
                fixture.owes_restart = False
            self._start_once(fixture)

    def _give_up(self, fixture: Fixture) -> None:
        fixture.failure = _why_given_up(fixture)
        self._notes.change(fixture, FixtureState.FAILED, fixture.failure)

    def _start_once(self, fixture: Fixture) -> None:
        fixture.generation += 1
        fixture.last_cause = ""
        fixture.variables.clear()
        fixture.values.clear()
        try:
            process = FixtureProcess(fixture, self._notes, self._fork_server, self._wait, self._kill_now, self._stop_by)
        except ForkServerLostError as error:
            fixture.state = FixtureState.STARTING
            self._notes.collapse(fixture, Cause(text=str(error), phase=Phase.SETUP))
            return
        fixture.process = process
        self._notes.change(fixture, FixtureState.STARTING)
        process.begin(self._make_job(fixture))
        self._wait(lambda: fixture.state is not FixtureState.STARTING or self._no_longer_startable(fixture))
        if fixture.owes_safe_state:
            self._enter_safe_state(fixture.name)
        if not fixture.ready:
            self._stop(fixture)

    def _enter_safe_state(self, name: str) -> None:
        process = self._up(name)
        if process is not None:
            process.ask("enter_safe_state")
            self._wait(lambda: process.answered or not process.up or self._stops_waiting())
            self._fixtures[name].owes_safe_state = not (process.answered and process.up)

    def _stops_waiting(self) -> bool:
        """Whether a fixture is not to be waited for that enters its safe state; it does so again when it comes down."""
        return self._kill_now() if self._settling else self._in_a_hurry()

    def _in_a_hurry(self) -> bool:
        return self._stop_by().at != clock.FOREVER

    def _backed_off(self, fixture: Fixture) -> bool:
        """Let the time before a restart pass. False when meanwhile the run is to stop, or what it needs collapsed."""
        used = fixture.entry.restarts - fixture.restarts_left
        pause = clock.Deadline.after(min(_LONGEST_BACK_OFF, fixture.entry.backoff * 2.0**used))
        self._wait(lambda: pause.expired or self._no_longer_startable(fixture), pause)
        return not self._no_longer_startable(fixture)

    def _no_longer_startable(self, fixture: Fixture) -> bool:
        return self._is_to_stop() or not all(self._fixtures[name].ready for name in fixture.entry.depends)

    def _is_to_stop(self) -> bool:
        return self._kill_now() if self._settling else self._stop_now()

    # While tests run ---------------------------------------------------------------------------------------------

    def deadline(self) -> clock.Deadline:
        """The moment at which :meth:`watch` has something to do, if nothing is heard before."""
        deadline = clock.Deadline()
        for fixture in self._fixtures.values():
            if fixture.process is not None and fixture.state is not FixtureState.COLLAPSED:
                deadline = deadline.earliest(fixture.process.deadline)
        return deadline

    def watch(self) -> None:
        """Notice fixtures whose process has ended, fallen silent or cut its channel; after whatever has happened."""
        for fixture in self._fixtures.values():
            if fixture.process is not None:
                fixture.process.look()

    def _wait(self, until: Callable[[], bool], limit: clock.Deadline | None = None) -> None:
        """Serve the reactor until something holds. Every active fixture is held to its deadline meanwhile."""
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
        """Have a fixture that owes a park come up once more for it, and tell of one that cannot.

        One that was only handed the debt of an earlier suite's, and that nobody needed, passes it on untold.
        """
        if not _owes_safe_state(fixture) or fixture.generation == 0 or fixture.ready:
            return  # one that is up enters its safe state when it is stopped
        problem = "" if _used_up(fixture) else self._bring_up_for_safe_state(fixture)
        if fixture.owes_safe_state:
            why = problem or _why_given_up(fixture)
            text = f"{fixture.name} did not put back what a test left: {why}"
            self._notes.incident(fixture, Cause(text=text, phase=Phase.TEARDOWN))

    def _bring_up_for_safe_state(self, fixture: Fixture) -> str:
        """Says why it did not park, if it did not."""
        self._settling = True
        try:
            problem = self.bring_up([fixture.name])
        finally:
            self._settling = False
        return problem if problem not in ("", _INTERRUPTED) else "the run was ended by force"

    def _stop(self, fixture: Fixture) -> None:
        process = fixture.process
        if process is None:
            if fixture.state is FixtureState.COLLAPSED:
                self._notes.change(fixture, FixtureState.STOPPED)
            return
        reason = fixture.last_cause if fixture.state is FixtureState.COLLAPSED else ""
        self._notes.change(fixture, FixtureState.STOPPING)
        try:
            process.stop(reason)
        finally:
            fixture.process = None
            self._notes.change(fixture, FixtureState.STOPPED)


def _owes_safe_state(fixture: Fixture) -> bool:
    """Whether it has to put right what a test left on a robot that is there."""
    return fixture.owes_safe_state and fixture.secures_robot


def _used_up(fixture: Fixture) -> bool:
    """Whether it may not have another generation."""
    return fixture.owes_restart and (fixture.restarts_left <= 0 or fixture.hopeless)


def _why_given_up(fixture: Fixture) -> str:
    used = fixture.entry.restarts - fixture.restarts_left
    times = f" ({used} restart{'s' if used != 1 else ''} used up)" if used else ""
    return f"{fixture.last_cause}{times}"


def _same(known: Fixture, other: Fixture) -> bool:
    """Whether two entries of suites mean the same thing, so that a fixture kept up for the run serves both."""
    mine, its = known.entry, other.entry
    return known.plugin == other.plugin and all(
        getattr(mine, name) == getattr(its, name) for name in ("param", "parameters", "environment", "depends")
    )
