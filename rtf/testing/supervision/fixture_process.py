"""One generation of a fixture, seen from the runner: the conversation with its process, and the ending of it.

The process is the host (``fixture_host``), which runs an author's code and is not to be trusted: it may
be silent, say nonsense, say too much, die or refuse to. Whatever it does ends here as a cause, an event or a kill. All
of it happens in the thread of the supervisor.
"""

from __future__ import annotations

import signal
from typing import TYPE_CHECKING, Any

from rtf import clock
from rtf.testing.events import Message, OutputCaptured
from rtf.testing.isolation import messages, processes
from rtf.testing.isolation.capture import Capture, Tail
from rtf.testing.isolation.messages import SAFE_STATE_LIMIT, Command, Said
from rtf.testing.permission import seconds_to_wait
from rtf.testing.session import bounded
from rtf.testing.supervision.fixture_record import Cause
from rtf.testing.verdict import FixtureState, Phase, Severity

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.testing.isolation.child import Child, End
    from rtf.testing.isolation.messages import Job
    from rtf.testing.isolation.worker_pool import ForkServerClient
    from rtf.testing.supervision.fixture_record import Fixture, Notes

#: Seconds that are allowed where the suite says nothing.
SETUP_LIMIT = 120.0
TEARDOWN_LIMIT = 30.0
#: A check that has not come back after this long is a collapse.
CHECK_LIMIT = 10.0
#: How long a fixture may take to leave what it is doing when it is to be torn down.
GRACE = 2.0
#: How much of its time to come down, when the run has to end at once, a fixture may spend on one thing.
_PART_OF_STOP = 0.75

#: Bytes a second of a fixture's output that the journal takes in the long run: 29 MB an hour.
_OUTPUT_RATE = 8192.0
#: Beyond these, what a fixture says is counted and left out.
_MESSAGE_BYTES = 16 << 20
_PROBLEMS = 100
_COMPLAINTS = 5
#: What a host may be doing on its way down, each once.
_LAST_THINGS = ("on_collapse()", "enter_safe_state()", "teardown()")
#: A process that says this much nonsense is not the one we started.
_NONSENSE_LIMIT = 1000


class FixtureProcess:
    """The process of one generation.

    ``wait(condition, limit)`` is the supervisor's: it returns at the limit, or when the condition holds, at which it
    looks after whatever happens.
    """

    def __init__(
        self,
        fixture: Fixture,
        notes: Notes,
        fork_server: ForkServerClient,
        wait: Callable[[Callable[[], bool], clock.Deadline], None],
        kill_now: Callable[[], bool],
        stop_by: Callable[[], clock.Deadline] = clock.Deadline,
    ) -> None:
        self._fixture = fixture
        self._notes = notes
        self._fork_server = fork_server
        self._wait = wait
        self._kill_now = kill_now
        self._stop_by = stop_by
        self._child: Child = fork_server.take()
        self.pid = self._child.pid
        self.answered = False
        self.deadline = clock.Deadline()
        self._period = fixture.entry.check_period
        self._doing = "setup()"
        self._phase = Phase.SETUP
        self._dump_cause = ""  # why its stacks were asked for
        self._to_come = {*_LAST_THINGS}
        self._listening = False  # before that SIGTERM would only kill it
        self._pressed = False  # it has been sent a signal to leave what it is doing
        self._killed = False
        self._done = False
        self._end_told = False
        self._tail = Tail()
        self._capture = Capture(
            lambda stream, text, omitted: notes.output(fixture, stream, text, omitted), refill=_OUTPUT_RATE
        )
        self._bytes = 0
        self._left_out = 0
        self._problems = 0
        self._nonsense = 0

    def begin(self, job: Job) -> None:
        """Have the process set the fixture up."""
        child = self._child
        child.mark_as_host()
        limit = self._fixture.entry.timeouts.setup or SETUP_LIMIT
        self.deadline = clock.Deadline.after(limit + seconds_to_wait())
        child.begin(job, self._hear, self._written)

    # While tests run ---------------------------------------------------------------------------------------------

    def ask(self, what: str) -> None:
        """Have it ``check`` or ``enter_safe_state`` now; ``answered`` becomes true when it has."""
        self.answered = False
        if what == "enter_safe_state":
            self._doing = "enter_safe_state()"
            self.deadline = clock.Deadline.after(SAFE_STATE_LIMIT)
        self._child.send(Command(what))

    def look(self) -> None:
        """Notice that it has ended, fallen silent or cut its channel. Called after whatever happened."""
        if not self._fixture.active:
            return
        if self._child.end is not None:
            self._ended(self._child.end)
        elif self._child.channel_closed:
            if self._child.cut_off:
                self._collapse("the fixture's process closed the channel to its runner")
        elif self.deadline.expired:
            self._too_late()

    def _ended(self, end: End) -> None:
        self._end_told = True
        self._collapse(f"the fixture's process ended: {_how(end)}", exit_status=end.exit_status, signal_name=end.signal)

    def _too_late(self) -> None:
        phase = self._phase
        cause = self._did_not_come_back()
        self._phase = phase  # a setup that comes to its end while its stacks are written was too late all the same
        self._collapse(cause)

    @property
    def up(self) -> bool:
        """Whether tests can stand on this very generation."""
        return self._fixture.ready and self._fixture.process is self

    def _did_not_come_back(self) -> str:
        """Have the stacks dumped, and say what takes too long."""
        cause = f"{self._doing} did not come back within {self.deadline.limit:g} s"
        self._dump_cause = cause  # what it says meanwhile is said too late
        if "(stopped)" in self._child.dump_stacks():
            cause = self._dump_cause = f"{cause}; the process had been stopped by a signal"
        return cause

    def _patience(self) -> clock.Deadline:
        return clock.Deadline.after(
            SAFE_STATE_LIMIT if self._doing == "enter_safe_state()" else self._period + CHECK_LIMIT
        )

    # Down --------------------------------------------------------------------------------------------------------

    def stop(self, reason: str) -> None:
        """Have it torn down, within its time, and end it in any case. ``reason`` is why it collapsed, if it did."""
        child = self._child
        try:
            if child.end is None:
                child.send(Command("teardown", reason))
                self.deadline = clock.Deadline.after(GRACE)
                if self._listening and (self._doing == "setup()" or self._dump_cause):
                    self._interrupt()
            while child.end is None and not self._killed:
                self._wait(self._is_to_press_on, clock.Deadline())
                if child.end is None:
                    self._press_on(self._phase if reason else Phase.TEARDOWN)
            if child.end is not None:
                self._conclude(child.end)
        finally:
            self._close()

    def _is_to_press_on(self) -> bool:
        return self._child.end is not None or self.deadline.expired or self._kill_now()

    def _interrupt(self) -> None:
        """Have it leave what it is doing, so that it gets to its teardown."""
        self._pressed = True
        self._child.interrupt(signal.SIGTERM)
        self.deadline = clock.Deadline.after(GRACE)

    def _press_on(self, phase: Phase) -> None:
        """It does not come to its end: interrupt it, or kill it where that is no use."""
        if self._kill_now():
            self._kill()
            by = self._stop_by()
            why = f"the run had to end within {by.limit:g} s" if by.expired else "the run was ended by force"
            self._problem(f"killed before the end of teardown(), because {why}", Phase.TEARDOWN)
        elif self._doing != "teardown()" and not self._pressed:
            self._interrupt()
        else:
            overdue, cause = self._doing, self._did_not_come_back()
            if self._child.end is not None or not (self.deadline.expired or self._kill_now()):
                # meanwhile it has ended, or come to the next of the last things, which has its own time
                if overdue == "teardown()":
                    self._problem(cause, Phase.TEARDOWN)
                return
            self._kill()
            if self._doing == "teardown()":
                self._problem(f"{cause}; killed", Phase.TEARDOWN)
            else:
                self._problem(f"{self._doing} could not be interrupted; killed without teardown()", phase)

    def _kill(self) -> None:
        self._killed = True
        child = self._child
        child.kill()
        self.deadline = clock.Deadline()
        self._wait(lambda: child.end is not None, clock.Deadline())

    def _conclude(self, end: End) -> None:
        """Tell of a process that did not live to the end of its teardown, unless that is known."""
        if self._killed or self._end_told:
            return
        if not self._done and not (end.status == 0 and self._child.cut_off):
            where = "in" if self._doing == "teardown()" else "before"
            cause = f"the fixture's process ended {where} teardown(): {_how(end)}"
        elif end.status != 0:
            cause = f"after teardown() the fixture's process ended badly: {_how(end)}"
        else:
            return
        self._problem(cause, Phase.TEARDOWN, exit_status=end.exit_status, signal_name=end.signal)

    def _close(self) -> None:
        self._capture.close()
        fixture = self._fixture
        stacks = self._child.new_stacks()
        if not stacks and self._dump_cause:
            stacks = "the process did not answer the request for its stacks\n"
        if stacks:
            self._notes.stacks(fixture, stacks, self._dump_cause or "crash")
        for count, what in ((self._left_out, "messages"), (max(0, self._nonsense - _COMPLAINTS), "lines of nonsense")):
            if count:
                text = f"{count} {what} left out: the fixture said too much"
                self._notes.say(fixture, Severity.WARNING, "journal", text, self._phase)

    # What it says ------------------------------------------------------------------------------------------------

    def _hear(self, data: bytes) -> None:
        if self._nonsense >= _NONSENSE_LIMIT:
            return
        try:
            message = messages.from_child(data)
            if isinstance(message, Said):
                self._hear_host(message.word, message.members)
            elif isinstance(message, OutputCaptured):
                self._written(message.stream, message.text.encode("utf-8", "backslashreplace"))
            elif isinstance(message, Message) and message.fixture == self._fixture.name:
                self._take(message, len(data))
            else:
                self._complain(f"it may not say {type(message).__name__}")
        except (ValueError, TypeError, KeyError, RecursionError) as error:
            self._complain(str(error))

    def _complain(self, problem: str) -> None:
        self._nonsense += 1
        if self._nonsense <= _COMPLAINTS:
            text = bounded(f"the fixture's process said something unintelligible: {problem}")
            self._notes.say(self._fixture, Severity.ERROR, "protocol", text, self._phase)
        elif self._nonsense == _NONSENSE_LIMIT:
            self._collapse("the fixture's process says only nonsense")

    def _take(self, event: Message, size: int) -> None:
        self._bytes += size
        if self._bytes > _MESSAGE_BYTES:
            self._left_out += 1
        else:
            self._notes.forward(event)

    def _hear_host(self, kind: str, message: dict[str, Any]) -> None:
        if kind in ("collapsed", "failed", "problem"):
            self._hear_of_problem(kind, message)
        elif kind == "listening":
            if not self._listening and self._fixture.state is FixtureState.STOPPING:
                self._interrupt()
            self._listening = True
        elif kind == "doing" and self._fixture.state is FixtureState.STOPPING:
            self._going_down(str(message["what"]))
        elif kind == "done":
            self._done = True
        elif kind == "provides":
            self._provides(message["variables"])
        elif kind == "value":
            self._fixture.values[str(message["key"])] = message["value"]
        else:
            if kind == "ready":
                self._fixture.secures_robot = message["of_robot"] is True
                self._fixture.stop_limit = float(message["stop_limit"])
            self._hear_of_life(kind)

    def _provides(self, variables: dict[str, str]) -> None:
        if all(type(name) is str and type(value) is str for name, value in variables.items()):
            self._fixture.variables |= variables

    def _hear_of_life(self, kind: object) -> None:
        fixture = self._fixture
        if kind == "ready" and fixture.state is FixtureState.STARTING:
            self._doing = "check()"
            self._phase = Phase.CHECK
            self.deadline = self._patience()
            self._notes.change(fixture, FixtureState.READY)
        elif kind in ("alive", "answered") and fixture.ready:
            if kind == "answered":
                self.answered = True
                self._doing = "check()"
            self.deadline = self._patience()

    def _hear_of_problem(self, kind: str, message: dict[str, Any]) -> None:
        cause = self._cause_from(message)
        fixture = self._fixture
        if kind != "problem":
            if fixture.active:
                fixture.hopeless = message.get("hopeless") is True
                self._notes.collapse(fixture, cause)
            return
        self._problems += 1
        if self._problems <= _PROBLEMS:
            self._notes.incident(fixture, cause)

    def _going_down(self, what: str) -> None:
        """It has come to the next of the last things, each of which has its own time and begins once."""
        if what not in self._to_come:
            return
        self._to_come.remove(what)
        self._doing = what
        self._phase = Phase.TEARDOWN
        self._pressed = False
        self._child.stop_nudging()
        limit = self._fixture.entry.timeouts.teardown or TEARDOWN_LIMIT
        limit = SAFE_STATE_LIMIT if what == "enter_safe_state()" else limit
        if self._stop_by().at != clock.FOREVER:  # a part is left for what comes after it
            limit = min(limit, _PART_OF_STOP * min(self._fixture.stop_limit, self._stop_by().remaining()))
        self.deadline = clock.Deadline.after(limit)

    def _cause_from(self, message: dict[str, Any]) -> Cause:
        status = message.get("exit_status")
        return Cause(
            text=bounded(str(message["cause"])),
            phase=Phase(message["phase"]),
            exit_status=status if isinstance(status, int) else None,
            signal=str(message.get("signal", "")),
            output=bounded(str(message.get("output", ""))) or self._last_lines(),
            traceback=bounded(str(message.get("traceback", ""))),
        )

    def _collapse(self, text: str, *, exit_status: int | None = None, signal_name: str = "") -> None:
        cause = Cause(
            text=text, phase=self._phase, exit_status=exit_status, signal=signal_name, output=self._last_lines()
        )
        self._notes.collapse(self._fixture, cause)

    def _problem(self, text: str, phase: Phase, *, exit_status: int | None = None, signal_name: str = "") -> None:
        cause = Cause(text=text, phase=phase, exit_status=exit_status, signal=signal_name, output=self._last_lines())
        self._notes.incident(self._fixture, cause)

    def _last_lines(self) -> str:
        self._child.drain()
        return self._tail.text()

    def _written(self, stream: str, data: bytes) -> None:
        self._tail.feed(stream, data)
        self._capture.feed(stream, data)


def _how(end: End) -> str:
    if end.status is None:
        return "the process from which it was forked was lost"
    return processes.describe_end(end.exit_status, end.signal)
