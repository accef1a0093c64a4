"""The record of a fixture over all of its generations, and the events that it gives rise to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from msgspec.structs import replace

from rtf import clock
from rtf.testing.events import FixtureChanged, FixtureIncident
from rtf.testing.isolation.messages import STOP_LIMIT
from rtf.testing.verdict import FixtureState

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.testing.events import Event, Message, OutputCaptured
    from rtf.testing.isolation.child import End
    from rtf.testing.suite.model import FixtureEntry
    from rtf.testing.supervision.fixture_process import FixtureProcess
    from rtf.testing.verdict import Phase


@dataclass(slots=True)
class Fixture:
    """One fixture of the plan, over all of its generations, with its plug-in or the reason why there is none."""

    entry: FixtureEntry
    state: FixtureState = FixtureState.STOPPED
    generation: int = 0
    restarts: int = 0
    #: Why the last generation was lost, so that the next one counts as a restart. One that came down only because
    #: something below it collapsed has no cause of its own.
    last_cause: str = ""
    #: Whether it said itself that trying again is no use.
    hopeless: bool = False
    #: Whether a test on it was cut short, and no generation has put right since what that one left.
    owes_safe_state: bool = False
    #: Whether it puts back something of which there is only one, such as a robot; it says so when it is up.
    secures_robot: bool = False
    #: Seconds it may take to come down when the run has to end at once; it says so when it is up.
    stop_limit: float = STOP_LIMIT
    process: FixtureProcess | None = None

    @property
    def name(self) -> str:
        """The name under which the suite and its tests know it."""
        return self.entry.name

    @property
    def ready(self) -> bool:
        """Whether tests can run on it."""
        return self.state is FixtureState.READY

    @property
    def active(self) -> bool:
        """Whether its end would be a collapse."""
        return self.state in (FixtureState.STARTING, FixtureState.READY)

    @property
    def used_up(self) -> bool:
        """Whether it may not have another generation."""
        return bool(self.last_cause) and (self.restarts >= self.entry.restarts or self.hopeless)

    @property
    def failure(self) -> str:
        """Why it is not usable any more, with the restarts it took."""
        times = f" ({self.restarts} restart{'s' if self.restarts > 1 else ''} used up)" if self.restarts else ""
        return f"{self.last_cause}{times}"

    @property
    def robot_unsafe(self) -> bool:
        """Whether it has to put right what a test left on a robot that is there."""
        return self.owes_safe_state and self.secures_robot

    def incident(self, cause: str, phase: Phase, end: End | None = None, output: str = "") -> FixtureIncident:
        """Return what went wrong with this generation; ``end`` is that of its process."""
        return FixtureIncident(
            fixture=self.name,
            suite="",
            generation=self.generation,
            phase=phase,
            cause=cause,
            exit_status=None if end is None else end.exit_status,
            signal="" if end is None else end.signal,
            output=output,
        )

    def same_as(self, other: Fixture) -> bool:
        """Whether two entries of suites mean the same thing, so that a fixture kept up for the run serves both."""
        names = ("found", "problem", "param", "parameters", "environment", "depends")
        return all(getattr(self.entry, name) == getattr(other.entry, name) for name in names)


class Notes:
    """Writes what happens to fixtures into the run's events, and keeps their records in step with it."""

    def __init__(self, emit: Callable[[Event], None], running_test: Callable[[], str]) -> None:
        self.suite = ""
        self.emit = emit
        self._running_test = running_test

    def change(self, fixture: Fixture, state: FixtureState, detail: str = "") -> None:
        """A fixture went over to another state."""
        fixture.state = state
        self.emit(
            FixtureChanged(
                fixture=fixture.name,
                suite=self.suite,
                generation=fixture.generation,
                state=state,
                detail=detail,
                pid=fixture.process.pid if fixture.process else 0,
            )
        )

    def collapse(self, fixture: Fixture, incident: FixtureIncident) -> None:
        """A fixture that was up or coming up is no longer usable. The first cause counts."""
        if fixture.active:
            fixture.last_cause = incident.cause
            self.incident(fixture, incident)
            self.change(fixture, FixtureState.COLLAPSED, incident.cause)

    def incident(self, fixture: Fixture, incident: FixtureIncident) -> None:
        """Something went wrong with a fixture, which the running test may feel."""
        self.emit(
            replace(
                incident,
                time=clock.now(),
                fixture=fixture.name,
                suite=self.suite,
                generation=fixture.generation,
                test=self._running_test(),
            )
        )

    def pass_on(self, fixture: Fixture, event: Message | OutputCaptured) -> None:
        """Pass on what a fixture said or wrote, in its name and that of the suite."""
        self.emit(replace(event, fixture=fixture.name, suite=self.suite))
