"""The books of supervision: what is known of a fixture over all of its generations, and how it is told to the run."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from msgspec.structs import replace

from rtf.testing.events import FixtureChanged, FixtureIncident, Message, OutputCaptured, StackDumped
from rtf.testing.isolation.messages import STOP_LIMIT
from rtf.testing.verdict import FixtureState, Phase, Severity

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.testing.events import Event
    from rtf.testing.plugins import PluginRef
    from rtf.testing.suite.model import FixtureEntry
    from rtf.testing.supervision.fixture_process import FixtureProcess


@dataclass(slots=True)
class Fixture:
    """One fixture of the plan, over all of its generations. ``problem`` says why there is no plug-in."""

    entry: FixtureEntry
    plugin: PluginRef | None
    problem: str = ""
    state: FixtureState = FixtureState.STOPPED
    generation: int = 0
    restarts_left: int = 0
    #: Whether the last generation failed by itself, so that the next one counts as a restart. One that came down only
    #: because something below it collapsed does not.
    owes_restart: bool = False
    #: Whether it said itself that trying again is no use.
    hopeless: bool = False
    #: Whether a test that stood on it was cut short, and no generation has put right since what that one left.
    owes_safe_state: bool = False
    #: Whether it puts back something of which there is only one, such as a robot; it says so when it is up.
    secures_robot: bool = False
    #: Seconds it may take to come down when the run has to end at once; it says so when it is up.
    stop_limit: float = STOP_LIMIT
    failure: str = ""
    last_cause: str = ""
    process: FixtureProcess | None = None
    #: Environment variables that this generation provides for those who stand on it.
    variables: dict[str, str] = field(default_factory=dict)
    #: Values that it hands to them, as JSON has them.
    values: dict[str, Any] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """The name under which the suite and its tests know it."""
        return self.entry.name

    @property
    def ready(self) -> bool:
        """Whether tests can stand on it."""
        return self.state is FixtureState.READY

    @property
    def active(self) -> bool:
        """Whether its end would be a collapse."""
        return self.state in (FixtureState.STARTING, FixtureState.READY)


@dataclass(frozen=True, slots=True, kw_only=True)
class Cause:
    """Why a fixture is no longer usable; ``exit_status`` or ``signal`` of what ended, ``output`` the last it said."""

    text: str
    phase: Phase
    exit_status: int | None = None
    signal: str = ""
    output: str = ""
    traceback: str = ""


class Notes:
    """Writes what happens to fixtures into the run's events, and keeps their records in step with it."""

    def __init__(self, emit: Callable[[Event], None], running_test: Callable[[], str]) -> None:
        self.suite = ""
        self._emit = emit
        self._running_test = running_test

    def change(self, fixture: Fixture, state: FixtureState, detail: str = "") -> None:
        """A fixture went over to another state."""
        fixture.state = state
        pid = fixture.process.pid if fixture.process else 0
        self._emit(
            FixtureChanged(
                fixture=fixture.name,
                suite=self.suite,
                generation=fixture.generation,
                state=state,
                detail=detail,
                pid=pid,
            ),
        )

    def collapse(self, fixture: Fixture, cause: Cause) -> None:
        """A fixture that was up or coming up is no longer usable. The first cause counts."""
        if not fixture.active:
            return
        fixture.last_cause = cause.text
        fixture.owes_restart = True
        self.incident(fixture, cause)
        self.change(fixture, FixtureState.COLLAPSED, cause.text)

    def incident(self, fixture: Fixture, cause: Cause) -> None:
        """Something went wrong with a fixture."""
        self._emit(
            FixtureIncident(
                fixture=fixture.name,
                suite=self.suite,
                generation=fixture.generation,
                phase=cause.phase,
                cause=cause.text,
                exit_status=cause.exit_status,
                signal=cause.signal,
                output=cause.output,
                test=self._running_test(),
                traceback=cause.traceback,
            ),
        )

    def say(self, fixture: Fixture, severity: Severity, title: str, detail: str, phase: Phase) -> None:
        """The supervision itself has something to say about a fixture."""
        self.forward(Message(severity=severity, title=title, detail=detail, fixture=fixture.name, phase=phase))

    def forward(self, message: Message) -> None:
        """Pass on what a fixture said, with the suite it said it in."""
        self._emit(replace(message, suite=self.suite))

    def output(self, fixture: Fixture, stream: str, text: str, omitted: int) -> None:
        """A fixture wrote something."""
        self._emit(OutputCaptured(stream=stream, text=text, fixture=fixture.name, suite=self.suite, omitted=omitted))

    def stacks(self, fixture: Fixture, text: str, cause: str) -> None:
        """A fixture's process dumped its stacks."""
        self._emit(StackDumped(text=text, cause=cause, fixture=fixture.name))
