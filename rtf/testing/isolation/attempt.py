"""One attempt at a test: a child gets the job, is read, held to its time limits, ended if need be, and judged.

An attempt always ends. When a limit is reached, the stacks of all threads are dumped and the test is asked to stop, so
that its teardown can run; if it does not stop, its whole process group is killed. The same happens, without the dump,
when a fixture is lost or an operator stops the run. The outcome follows from the messages, the verdict that the process
claims, how the process ended, and why it was stopped.
"""

from __future__ import annotations

import signal
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from rtf import clock
from rtf.testing.events import Asked, Event, StackDumped, TestStarted
from rtf.testing.isolation import messages, processes
from rtf.testing.isolation.messages import STOP_SIGNAL, Answer, Case
from rtf.testing.isolation.transcript import Transcript
from rtf.testing.isolation.worker_pool import ForkServerLostError, LoadTimeoutError
from rtf.testing.verdict import UNDOING_PHASES, Phase, Severity, Verdict

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.testing.isolation.child import Child
    from rtf.testing.isolation.messages import Job
    from rtf.testing.isolation.worker_pool import ForkServerClient

#: Seconds that a test may take to react to being asked to stop.
GRACE = 2.0
#: Seconds that a process may take to end when its test is over.
_LEAVING = 10.0
_NO_STACKS = "the process did not answer the request for its stacks"


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Seconds a phase may take; ``total`` is for the attempt as a whole. None means no limit.

    ``grace`` is how long a test may take to react to being asked to stop, before it is killed.
    """

    setup: float | None = 60.0
    run: float | None = 300.0
    teardown: float | None = 30.0
    total: float | None = None
    grace: float = GRACE

    def of(self, phase: Phase) -> float | None:
        """The limit of a phase. Loading counts as setting up, the clean-ups together as tearing down."""
        if phase in (Phase.LOAD, Phase.SETUP):
            return self.setup
        return self.run if phase is Phase.RUN else self.teardown


@dataclass(frozen=True, slots=True)
class Stop:
    """Why an attempt is ended from outside. ``failures`` is the number of those that were found before."""

    verdict: Verdict
    reason: str
    detail: str
    failures: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """The result of an attempt."""

    verdict: Verdict
    reason: str = ""
    detail: str = ""
    duration: float = 0.0
    exit_status: int | None = None
    signal: str = ""
    cpu_time: float = 0.0
    max_rss: int = 0
    #: Whether the state that it left is unknown: it was ended from outside, or something went wrong while it undid
    #: what it had done.
    cut_short: bool = False


@dataclass(slots=True)
class Attempt:
    """One attempt, in the thread of its suite.

    ``tick`` is called after each event of the reactor, and returns why the attempt must be ended from outside, if it
    must: the suite knows of lost fixtures, interrupts and its own limits. ``next_tick`` is the latest moment of the
    next call. ``take_case`` is called with each case of a program, and returns whether it is kept.
    """

    job: Job
    limits: Limits
    fork_server: ForkServerClient
    emit: Callable[[Event], None]
    tick: Callable[[], Stop | None]
    next_tick: Callable[[], clock.Deadline]
    kill_now: Callable[[], bool]
    take_case: Callable[[Case], bool]
    ask: Callable[[Asked, Callable[[str | None, str], None]], None] | None = None
    fixtures: dict[str, int] = field(default_factory=dict)
    #: Why it was ended from outside: a signal to its process may still be under way when the test is over.
    stop: Stop | None = None
    _child: Child = field(init=False)
    _said: Transcript = field(init=False)
    _deadline: clock.Deadline = field(default_factory=clock.Deadline)
    _total: clock.Deadline = field(default_factory=clock.Deadline)
    _killed: bool = False
    _kernel_state: str = ""
    _dumped: Phase | None = None

    def run(self, take: Callable[[], Child] | None = None) -> Outcome:
        """Carry out the attempt in a fresh process, or in the one that ``take`` gives, and return its outcome."""
        began = clock.monotonic()
        self._said = Transcript(self.job, self.emit, self._enter, self._finish, self._put, self.take_case)
        try:
            child = self._child = self._obtain(take or self._take_fresh)
        except LoadTimeoutError as error:  # of the file that it shares with other tests
            self._started(0)
            self._report_stacks(error.stacks or f"{_NO_STACKS}\n", str(error))
            outcome = self._error("timeout", str(error))
        except ForkServerLostError as error:
            return self._error("internal", str(error))
        else:
            self._said.earlier = child.done
            self._started(child.pid)
            loading = self.fork_server.loading_took if take is None else 0.0
            self._total = _remaining(self.limits.total, loading)
            self._deadline = _remaining(self.limits.setup, loading)
            child.begin(self.job, self._said.take, self._said.write)
            self._wait()
            child.drain()
            outcome = self._conclude()
            child.done.add(self.job.id)
        return replace(outcome, duration=clock.monotonic() - began)

    def _obtain(self, take: Callable[[], Child]) -> Child:
        try:
            return take()
        except ForkServerLostError:  # it was lost while nothing ran, which does not concern the test
            return take()

    def _take_fresh(self) -> Child:
        """Return a child of its own. The loading of a shared file counts as the loading of this test."""
        limits = [limit for limit in (self.limits.setup, self.limits.total) if limit is not None]
        return self.fork_server.take(self.job.plugin, self.fixtures, min(limits, default=None))

    def _started(self, pid: int) -> None:
        self.emit(TestStarted(test=self.job.id, attempt=self.job.attempt, pid=pid, fixtures=self.fixtures))

    def _put(self, question: Asked) -> None:
        """Put a question of the test to the operator."""
        if self.ask is not None:
            self.ask(question, lambda text, source: self._child.send(Answer(question.question, text, source)))

    # Waiting -----------------------------------------------------------------------------------------------------

    def _wait(self) -> None:
        while not self._over():
            deadline = self._deadline if self.stop else self._deadline.earliest(self._total)
            self.fork_server.reactor.run_once(deadline.earliest(self.next_tick()))
            if self._over():
                return
            if self.stop is None:
                stop = self._reason_to_stop()
                if stop is not None:
                    self._end_early(stop)
            elif not self._killed and self._time_is_up():
                self._press_on()

    def _over(self) -> bool:
        """Return whether the process is gone, or waits for its next job."""
        return self._child.end is not None or (self._said.finished is not None and not self.job.last)

    def _time_is_up(self) -> bool:
        return self._deadline.expired or self.kill_now()

    def _enter(self, phase: Phase) -> float | None:
        """Begin a phase and return its limit, which a phase that undoes the test's work also has after a stop."""
        limit = self.limits.of(phase)
        undoing = phase in UNDOING_PHASES
        if undoing:
            self._child.stop_nudging()
        if self.stop is None or (undoing and not self._killed):
            self._deadline = clock.Deadline.after(limit)
        return limit

    def _finish(self) -> None:
        self._deadline = clock.Deadline.after(_LEAVING)
        self._child.stop_nudging()

    def _reason_to_stop(self) -> Stop | None:
        stop = self.tick()
        if stop is not None:
            return stop
        if self._total.expired:
            return self._overdue("the test", self._total)
        if self._child.channel_closed and self._said.finished is None:
            self._deadline = clock.Deadline()  # either it ends now, or it is cut off
            return Stop(Verdict.ERROR, "channel", self._why_cut_off()) if self._child.cut_off else None
        return self._overdue(self._what(), self._deadline) if self._deadline.expired else None

    def _what(self) -> str:
        if self._said.finished is not None:
            return "the test was over, but its process"
        return "loading" if self._said.phase is Phase.LOAD else f"{self._said.phase}()"

    def _overdue(self, what: str, deadline: clock.Deadline) -> Stop:
        detail = f"{what} did not end within {deadline.limit:g} s"
        self._dump_stacks()
        if "(stopped)" in self._kernel_state:
            detail += "; the process had been stopped by a signal"
        return Stop(Verdict.ERROR, "timeout", detail)

    def _dump_stacks(self) -> None:
        self._dumped = self._said.phase
        state = self._child.dump_stacks()
        self._kernel_state = self._kernel_state or state

    # Stopping ----------------------------------------------------------------------------------------------------

    def _end_early(self, stop: Stop) -> None:
        self.stop = replace(stop, failures=self._said.failures)
        if self._over():
            return
        spared = self._said.phase in UNDOING_PHASES and not self._child.cut_off
        if spared and not self._time_is_up():
            self._child.signal(signal.SIGCONT)
            return  # it is undoing what it did, as after a stop; that has its own time
        self._child.interrupt(STOP_SIGNAL)
        self._deadline = clock.Deadline.after(self.limits.grace)
        if self.kill_now():
            self._press_on()

    def _press_on(self) -> None:
        """Kill a test that did not stop, unless its next phase has time left."""
        if self._dumped not in (None, self._said.phase) and not self.kill_now():  # the teardown hangs, too
            self._dump_stacks()
            if self._over() or not self._time_is_up():
                return  # meanwhile it has come to the next phase, which has its own time
        self._killed = True
        self._child.kill()
        self._deadline = clock.Deadline()

    # The verdict -------------------------------------------------------------------------------------------------

    def _conclude(self) -> Outcome:
        said, end, stop = self._said, self._child.end, self.stop
        stacks = self._child.new_stacks()
        if not stacks and stop is not None and stop.reason == "timeout":
            stacks = f"{_NO_STACKS}; the kernel says\n{self._kernel_state}\n"
        self._report_stacks(stacks, stop.detail if stop else "crash")
        said.close()
        if stop is not None:
            outcome = self._stopped(stop)
        elif said.finished is None or (end is not None and end.status is None):
            outcome = self._ended_before()
        elif end is not None and end.status != 0:
            how = processes.describe_end(end.exit_status, end.signal)
            outcome = self._error("crash", f"after the test was over its process ended badly: {how}")
        else:
            outcome = self._claimed()
        outcome = replace(outcome, cut_short=outcome.cut_short or stop is not None or said.undoing_failed)
        if end is None:
            return outcome
        return replace(
            outcome, exit_status=end.exit_status, signal=end.signal, cpu_time=end.cpu_time, max_rss=end.max_rss
        )

    def _report_stacks(self, stacks: str, cause: str) -> None:
        if stacks:
            self.emit(StackDumped(text=stacks, cause=cause, test=self.job.id))

    def _error(self, reason: str, detail: str) -> Outcome:
        """Return an error, or *failed* if a failure was found before: a failure is never hidden."""
        said = self._said
        said.note(Severity.ERROR, reason, detail)
        verdict = Verdict.FAILED if said.failures else Verdict.ERROR
        detail = f"{said.first}; then: {detail}" if said.failures else detail
        return Outcome(verdict=verdict, reason=reason, detail=detail, cut_short=True)

    def _why_cut_off(self) -> str:
        if self._child.garbled:
            return "the test wrote what is no message on the channel to its runner"
        return "the test closed the channel to its runner"

    def _claimed(self) -> Outcome:
        """Return the outcome of a process that ended in order, by its messages and then by its claim."""
        said, finished = self._said, self._said.finished
        assert finished is not None
        if said.failures or said.errors:  # received failures count, whatever the process claims in the end
            verdict, reason = (Verdict.FAILED, "failure") if said.failures else (Verdict.ERROR, "error")
            return Outcome(verdict=verdict, reason=reason, detail=finished.detail or said.first)
        if finished.stopped:
            return self._error("stopped", "it was told to stop, and not by the runner")
        try:
            verdict = Verdict(finished.outcome)
        except ValueError:
            return self._error("protocol", "the test's process did not say what the test came to")
        return Outcome(verdict=verdict, reason=finished.reason, detail=finished.detail)

    def _stopped(self, stop: Stop) -> Outcome:
        detail = f"{stop.detail}; it did not react to being stopped and was killed" if self._killed else stop.detail
        if stop.verdict is Verdict.ERROR:
            return self._error(stop.reason, detail)
        if stop.verdict is Verdict.INTERRUPTED and stop.failures:
            return Outcome(verdict=Verdict.FAILED, reason=stop.reason, detail=f"{self._said.first}; then: {detail}")
        return Outcome(verdict=stop.verdict, reason=stop.reason, detail=detail)

    def _ended_before(self) -> Outcome:
        """Return the outcome of a process that ended before its test was over."""
        end = self._child.end
        where = "while loading" if self._said.phase is Phase.LOAD else f"in {self._said.phase}()"
        if end is None or end.status is None:
            lost = f"the process from which tests are forked was lost, and the test with it, {where}"
            return self._error("internal", lost)
        if end.signal:
            hint = " (the machine may have run out of memory)" if end.signal == "SIGKILL" else ""
            return self._error("crash", f"killed by {end.signal} {where}{hint}")
        if end.exit_status == messages.CUT_OFF or self._child.garbled:
            return self._error("channel", self._why_cut_off())
        how = f"the process ended with exit status {end.exit_status} {where}, before the test was over"
        return self._error("exit", how)


def _remaining(limit: float | None, used: float) -> clock.Deadline:
    """Return the deadline for what remains of a time limit. The deadline names the limit as a whole."""
    if limit is None:
        return clock.Deadline()
    return clock.Deadline(clock.monotonic() + max(0.0, limit - used), limit)


def run_in_process(job: Job, emit: Callable[[Event], None], take_case: Callable[[Case], object]) -> Outcome:
    """Run one attempt inside the runner, for a debugger; a test that hangs cannot be ended.

    Limits, memory and questions do not apply.
    """
    from rtf.testing.isolation.worker import run_test
    from rtf.testing.session import Session

    began = clock.monotonic()
    emit(TestStarted(test=job.id, attempt=job.attempt))

    def send(said: Event | Case) -> None:
        if isinstance(said, Case):
            take_case(said)
        else:
            emit(said)

    session = Session(job.id, send, folder=job.folder, run_folder=job.run_folder)
    finished = run_test(job, session)
    return Outcome(
        verdict=Verdict(finished.outcome),
        reason=finished.reason,
        detail=finished.detail,
        duration=clock.monotonic() - began,
        cut_short=session.undoing_failed,
    )
