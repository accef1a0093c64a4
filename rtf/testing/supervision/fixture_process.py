"""One generation of a fixture, seen from the runner: the conversation with its process, and how it is ended.

=========================================  =====================================================================
the runner sends                           the process sends (``isolation.messages``)
=========================================  =====================================================================
``Job``                                    ``Doing setup()``: from now on SIGTERM makes it leave what it is doing
.                                          ``Provided``; ``Ready``, or ``Lost``, after which it comes down by itself
.                                          ``Alive`` after each check, every check period, or ``Lost``
``check``, ``enter_safe_state``            ``Alive``, with ``answered``, or ``Lost``
``on_test_failure``, with the test         ``Attached``; ``Alive``, with ``answered``
``teardown``, with the reason if it is     ``Doing enter_safe_state()``, or ``Doing on_collapse()`` if it was lost
lost                                       ``Doing teardown()``; a ``FixtureIncident`` for what goes wrong here
.                                          ``Doing nothing``, and it ends
=========================================  =====================================================================

Its messages and its output come in between, as events. Each step has its time. A generation that is up and exceeds it
has collapsed; one that is coming down is interrupted (SIGTERM), or killed where that is no use.

The process (``fixture_host``) runs an author's code and is not to be trusted: it may be silent, say nonsense, say too
much, die or refuse to. Whatever it does ends here as an incident, an event or a kill, in the thread of the supervisor.
"""

from __future__ import annotations

import signal
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from msgspec.structs import replace

from rtf import clock
from rtf.testing.events import Attached, FixtureChanged, FixtureIncident, Message, OutputCaptured, StackDumped
from rtf.testing.isolation import messages, processes
from rtf.testing.isolation.capture import Capture, Tail
from rtf.testing.isolation.messages import SAFE_STATE_LIMIT, STOP_LIMIT, Alive, Command, Doing, Provided, Ready
from rtf.testing.permission import seconds_to_wait
from rtf.testing.session import bounded
from rtf.testing.verdict import FixtureState, Phase, Severity

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.testing.events import Event
    from rtf.testing.isolation.child import Child, End
    from rtf.testing.isolation.messages import FailedTest, Job
    from rtf.testing.suite.model import FixtureEntry

#: The default limits in seconds.
SETUP_LIMIT = 120.0
TEARDOWN_LIMIT = 30.0
#: A check that has not come back after this long is a collapse.
CHECK_LIMIT = 10.0
#: How long a fixture may take to leave what it is doing when it is to be torn down.
GRACE = 2.0
#: How much of its time to come down, when the run has to end at once, a fixture may spend on one step.
_PART_OF_STOP = 0.75

#: Bytes a second of a fixture's output that the journal takes in the long run: 29 MB an hour.
_OUTPUT_RATE = 8192.0
#: Beyond these, messages of a fixture are counted and left out.
_MESSAGE_BYTES = 16 << 20
_INCIDENTS = 100
_COMPLAINTS = 5
#: The steps on the way down, each of which begins once.
_LAST_STEPS = ("on_collapse()", "enter_safe_state()", "teardown()")
#: After so many messages that are nonsense the fixture counts as collapsed.
_NONSENSE_LIMIT = 1000


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
    #: Whether a test on it was cut short, and no generation has entered its safe state since.
    safe_state_due: bool = False
    #: Whether it puts back something of which there is only one, such as a robot; it says so when it is up.
    secures_robot: bool = False
    #: Whether it wants to hear of tests that did not pass; it says so when it is up.
    explains_failures: bool = False
    #: Seconds it may take to come down when the run has to end at once; it says so when it is up.
    stop_limit: float = STOP_LIMIT
    process: FixtureProcess | None = None
    #: Takes an event of the fixture; the supervisor adds the suite and the running test.
    emit: Callable[[Event], None] = lambda _: None

    @property
    def name(self) -> str:
        """The name of the fixture in the suite and its tests."""
        return self.entry.name

    @property
    def ready(self) -> bool:
        """Whether tests can run on the fixture."""
        return self.state is FixtureState.READY

    @property
    def active(self) -> bool:
        """Whether an end of the fixture would be a collapse."""
        return self.state in (FixtureState.STARTING, FixtureState.READY)

    @property
    def used_up(self) -> bool:
        """Whether the fixture may not have another generation."""
        return bool(self.last_cause) and (self.restarts >= self.entry.restarts or self.hopeless)

    @property
    def failure(self) -> str:
        """Why the fixture is not usable any more, with the restarts it took."""
        times = f" ({self.restarts} restart{'s' if self.restarts > 1 else ''} used up)" if self.restarts else ""
        return f"{self.last_cause}{times}"

    @property
    def robot_unsafe(self) -> bool:
        """Whether a robot that exists only once may still be as a test left it."""
        return self.safe_state_due and self.secures_robot

    def incident(self, cause: str, phase: Phase, end: End | None = None, output: str = "") -> FixtureIncident:
        """Return the incident of this generation; ``end`` is that of its process."""
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

    def change(self, state: FixtureState, detail: str = "") -> None:
        """Go over to another state, and emit it."""
        self.state = state
        pid = self.process.pid if self.process else 0
        self.emit(
            FixtureChanged(fixture=self.name, suite="", generation=self.generation, state=state, detail=detail, pid=pid)
        )

    def collapse(self, incident: FixtureIncident) -> None:
        """Record that the fixture is no longer usable, if it was up or coming up. The first cause counts."""
        if self.active:
            self.last_cause = incident.cause
            self.report(incident)
            self.change(FixtureState.COLLAPSED, incident.cause)

    def report(self, incident: FixtureIncident) -> None:
        """Emit an incident in the fixture's name, at the present time."""
        self.emit(replace(incident, time=clock.now(), fixture=self.name, generation=self.generation))

    def same_as(self, other: Fixture) -> bool:
        """Return whether two entries of suites are equal, so that a fixture kept up for the run serves both."""
        names = ("found", "problem", "param", "parameters", "environment", "depends")
        return all(getattr(self.entry, name) == getattr(other.entry, name) for name in names)


class FixtureProcess:
    """The process of one generation.

    ``wait(condition, limit)`` is the supervisor's: it returns at the limit, or when the condition holds, at which it
    looks after whatever happens.
    """

    def __init__(
        self,
        fixture: Fixture,
        child: Child,
        wait: Callable[[Callable[[], bool], clock.Deadline], None],
        kill_now: Callable[[], bool],
        stop_by: Callable[[], clock.Deadline] = clock.Deadline,
    ) -> None:
        self._fixture = fixture
        self._wait = wait
        self._kill_now = kill_now
        self._stop_by = stop_by
        self._child = child
        self.pid = child.pid
        self.answered = False
        self.deadline = clock.Deadline()
        #: What it provides for the tests and fixtures on it: variables of their environment, and values by key.
        self.variables: dict[str, str] = {}
        self.values: dict[str, Any] = {}
        self._step = ""  # the current step; none yet: SIGTERM would only kill it
        self._phase = Phase.SETUP
        self._last_steps: set[str] = set()  # those that have begun
        self._interrupted = False  # it has been sent a signal to leave this step
        self._done = False
        self._end_reported = False
        self._overdue = ""  # why its stacks were asked for
        self._tail = Tail()
        self._capture = Capture(self._captured, refill=_OUTPUT_RATE)
        self._bytes = 0
        self._left_out = 0
        self._incidents = 0
        self._nonsense = 0
        self._explained = ""  # the test to which it may attach files

    def begin(self, job: Job) -> None:
        """Make the process set the fixture up."""
        child = self._child
        child.mark_as_host()
        self.deadline = clock.Deadline.after(self._limit("setup()"))
        child.begin(job, self._take, self._written)

    def _limit(self, step: str) -> float:
        """Return the seconds that a step may take."""
        entry = self._fixture.entry
        if step == "setup()":
            return (entry.timeouts.setup or SETUP_LIMIT) + seconds_to_wait()
        if step in ("check()", "on_test_failure()"):
            return entry.check_period + CHECK_LIMIT
        limit = SAFE_STATE_LIMIT if step == "enter_safe_state()" else entry.timeouts.teardown or TEARDOWN_LIMIT
        stop_by = self._stop_by()
        if self._phase is not Phase.TEARDOWN or stop_by.at == clock.FOREVER:
            return limit
        # the run has to end at once: a part is left for what comes after this step
        return min(limit, _PART_OF_STOP * min(self._fixture.stop_limit, stop_by.remaining()))

    def _enter(self, step: str, phase: Phase) -> None:
        self._step, self._phase = step, phase
        self.deadline = clock.Deadline.after(self._limit(step))

    # While tests run ---------------------------------------------------------------------------------------------

    @property
    def up(self) -> bool:
        """Whether tests can run on this very generation."""
        return self._fixture.ready and self._fixture.process is self

    def ask(self, command: str, failed: FailedTest | None = None) -> None:
        """Request ``check``, ``enter_safe_state`` or, with the test, ``on_test_failure``.

        ``answered`` becomes true when the process has done it.
        """
        self.answered = False
        self._explained = failed.test if failed is not None else ""
        if command != "check":
            self._enter(f"{command}()", Phase.CHECK)
        self._child.send(Command(command, failed=failed))

    def look(self) -> None:
        """Handle a process that has ended, fallen silent or closed its channel. Called after each event."""
        if not self._fixture.active:
            return
        phase, end = self._phase, self._child.end
        if end is not None:
            self._end_reported = True
            self._collapse(f"the fixture's process ended: {_how(end)}", phase, end)
        elif self._child.cut_off:
            self._collapse("the fixture's process closed the channel to its runner", phase)
        elif self.deadline.expired and not self._child.channel_closed:
            self._collapse(self._dump_stacks(), phase)  # also if it comes to its end while they are written

    def _dump_stacks(self) -> str:
        """Dump the stacks of the process, and return what takes too long."""
        cause = f"{self._step or 'setup()'} did not come back within {self.deadline.limit:g} s"
        if "(stopped)" in self._child.dump_stacks():
            cause += "; the process had been stopped by a signal"
        self._overdue = cause
        return cause

    # Down --------------------------------------------------------------------------------------------------------

    def stop(self, reason: str) -> None:
        """Have the fixture torn down in time, and end the process in any case. ``reason`` is that of a collapse."""
        child = self._child
        try:
            if child.end is None:
                child.send(Command("teardown", reason))
            if not self._last_steps:  # else it comes down already, and has its time for that
                self.deadline = clock.Deadline.after(GRACE)
                if self._step == "setup()" or (self._step and self._overdue):
                    self._interrupt()
            while child.end is None and not self._end_reported:
                self._wait(lambda: child.end is not None or self._time_is_up(), clock.Deadline())
                if child.end is None:
                    self._press_on(self._phase if reason else Phase.TEARDOWN)
            if child.end is not None:
                self._conclude(child.end)
        finally:
            self._close()

    def _time_is_up(self) -> bool:
        return self.deadline.expired or self._kill_now()

    def _interrupt(self) -> None:
        """Interrupt the current step, so that the fixture gets to its teardown."""
        self._interrupted = True
        self._child.interrupt(signal.SIGTERM)
        self.deadline = clock.Deadline.after(GRACE)

    def _press_on(self, phase: Phase) -> None:
        """Interrupt a step that exceeds its time, or kill the process where that is no use."""
        if self._kill_now():
            self._kill()
            by = self._stop_by()
            why = f"the run had to end within {by.limit:g} s" if by.expired else "the run was ended by force"
            self._problem(f"killed before the end of teardown(), because {why}", Phase.TEARDOWN)
        elif self._step != "teardown()" and not self._interrupted:
            self._interrupt()
        else:
            step, cause = self._step, self._dump_stacks()
            if self._child.end is not None or not self._time_is_up():
                # meanwhile it has ended, or come to the next of the last steps, which has its own time
                if step == "teardown()":
                    self._problem(cause, Phase.TEARDOWN)
                return
            self._kill()
            if self._step == "teardown()":
                self._problem(f"{cause}; killed", Phase.TEARDOWN)
            else:
                self._problem(f"{self._step} could not be interrupted; killed without teardown()", phase)

    def _kill(self) -> None:
        self._end_reported = True
        child = self._child
        child.kill()
        self.deadline = clock.Deadline()
        self._wait(lambda: child.end is not None, clock.Deadline())

    def _conclude(self, end: End) -> None:
        """Report a process that did not live to the end of its teardown, or ended badly, unless that has been done."""
        if self._end_reported:
            return
        if not self._done and not (end.status == 0 and self._child.cut_off):
            where = "in" if self._step == "teardown()" else "before"
            self._problem(f"the fixture's process ended {where} teardown(): {_how(end)}", Phase.TEARDOWN, end)
        elif end.status != 0:
            self._problem(f"after teardown() the fixture's process ended badly: {_how(end)}", Phase.TEARDOWN, end)

    def _close(self) -> None:
        self._capture.close()
        stacks = self._child.new_stacks()
        if not stacks and self._overdue:
            stacks = "the process did not answer the request for its stacks\n"
        if stacks:
            self._fixture.emit(StackDumped(text=stacks, cause=self._overdue or "crash", fixture=self._fixture.name))
        for count, what in ((self._left_out, "messages"), (self._nonsense - _COMPLAINTS, "lines of nonsense")):
            if count > 0:
                self._say(Severity.WARNING, "journal", f"{count} {what} left out: the fixture said too much")

    # What it says ------------------------------------------------------------------------------------------------

    def _take(self, data: bytes) -> None:
        if self._nonsense >= _NONSENSE_LIMIT:
            return
        try:
            message = messages.from_fixture(data)
        except (ValueError, RecursionError) as error:
            self._complain(str(error))
            return
        if isinstance(message, OutputCaptured):
            self._written(message.stream, message.text.encode("utf-8", "backslashreplace"))
        elif isinstance(message, Attached) and not self._explained:
            self._complain(f"a file {message.name!r} for no test")
        elif isinstance(message, Attached | Message | FixtureIncident):
            self._take_event(message, len(data))
        elif isinstance(message, Alive):
            self._alive(answered=message.answered)
        elif isinstance(message, Doing):
            self._begins(message.step)
        elif isinstance(message, Provided):
            self.variables |= message.variables
            self.values |= message.values
        elif isinstance(message, Ready):
            self._ready(message)
        elif self._fixture.active:
            self._fixture.hopeless = message.hopeless
            self._fixture.collapse(self._completed(message.incident))

    def _take_event(self, event: Attached | Message | FixtureIncident, size: int) -> None:
        """Emit an event, unless the fixture has sent too much already."""
        self._bytes += size
        incident = isinstance(event, FixtureIncident)
        self._incidents += incident
        if self._incidents > _INCIDENTS if incident else self._bytes > _MESSAGE_BYTES:
            self._left_out += 1
        elif isinstance(event, FixtureIncident):
            self._fixture.report(self._completed(event))
        elif isinstance(event, Attached):
            self._fixture.emit(replace(event, test=self._explained, fixture=self._fixture.name))
        else:
            self._pass_on(event)

    def _complain(self, problem: str) -> None:
        self._nonsense += 1
        if self._nonsense <= _COMPLAINTS:
            self._say(Severity.ERROR, "protocol", f"the fixture's process said something unintelligible: {problem}")
        elif self._nonsense == _NONSENSE_LIMIT:
            self._collapse("the fixture's process says only nonsense", self._phase)

    def _pass_on(self, event: Message | OutputCaptured) -> None:
        self._fixture.emit(replace(event, fixture=self._fixture.name))

    def _ready(self, message: Ready) -> None:
        fixture = self._fixture
        fixture.secures_robot, fixture.stop_limit = message.secures_robot, message.stop_limit
        fixture.explains_failures = message.explains_failures
        if fixture.state is FixtureState.STARTING:
            self._enter("check()", Phase.CHECK)
            fixture.change(FixtureState.READY)

    def _alive(self, *, answered: bool) -> None:
        if self._fixture.ready:
            self.answered = self.answered or answered
            self._enter("check()" if answered else self._step, Phase.CHECK)

    def _begins(self, step: str) -> None:
        """Record a step that the process has begun; each step of the way down begins once."""
        if step == "nothing":
            self._done = True
        elif step == "setup()" and not self._step:
            self._step = step
            if self._fixture.state is FixtureState.STOPPING:
                self._interrupt()
        elif step in _LAST_STEPS and step not in self._last_steps and not self._fixture.active:
            self._last_steps.add(step)
            self._interrupted = False
            self._child.stop_nudging()
            self._enter(step, Phase.TEARDOWN)

    def _completed(self, incident: FixtureIncident) -> FixtureIncident:
        """Return the incident with the last lines of its output, and no longer than an event may be."""
        return replace(
            incident,
            cause=bounded(incident.cause) or "no reason was given",
            output=bounded(incident.output) or self._last_lines(),
            traceback=bounded(incident.traceback),
        )

    # Events --------------------------------------------------------------------------------------------------------

    def _collapse(self, cause: str, phase: Phase, end: End | None = None) -> None:
        self._fixture.collapse(self._fixture.incident(cause, phase, end, self._last_lines()))

    def _problem(self, cause: str, phase: Phase, end: End | None = None) -> None:
        self._fixture.report(self._fixture.incident(cause, phase, end, self._last_lines()))

    def _say(self, severity: Severity, title: str, text: str) -> None:
        self._pass_on(Message(severity=severity, title=title, detail=bounded(text), phase=self._phase))

    def _last_lines(self) -> str:
        self._child.drain()
        return self._tail.text()

    def _written(self, stream: str, data: bytes) -> None:
        self._tail.feed(stream, data)
        self._capture.feed(stream, data)

    def _captured(self, stream: str, text: str, omitted: int) -> None:
        self._pass_on(OutputCaptured(stream=stream, text=text, omitted=omitted))


def _how(end: End) -> str:
    if end.status is None:
        return "the process from which it was forked was lost"
    return processes.describe_end(end.exit_status, end.signal)
