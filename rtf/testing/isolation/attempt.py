"""One attempt at a test: a child is given the job, heard, held to its time limits, and ended if it must be.

An attempt always ends. When a limit is reached the stacks of all threads are dumped, the test is asked to stop, which
gives its teardown a chance, and when that does not help its whole process group is killed. The same happens, without
the dump, when a fixture is lost or an operator stops the run.
"""

from __future__ import annotations

import signal
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from rtf import clock
from rtf.testing.events import Asked, Event, StackDumped, TestStarted
from rtf.testing.isolation import judge
from rtf.testing.isolation.judge import Outcome, Stop
from rtf.testing.isolation.messages import STOP_SIGNAL, Answer, Case
from rtf.testing.isolation.transcript import Transcript
from rtf.testing.isolation.worker_pool import ForkServerLostError, LoadTimeoutError
from rtf.testing.verdict import UNDOING_PHASES, Phase, Verdict

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.testing.isolation.child import Child
    from rtf.testing.isolation.messages import Job
    from rtf.testing.isolation.worker_pool import ForkServerClient

#: How long a test may take to react to being asked to stop.
GRACE = 2.0
#: How long a process may still take to end when its test is over.
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


class Attempt:
    """Runs one attempt in the thread of its suite.

    ``tick`` is called after whatever happened, and says whether and why the attempt must be ended from outside: the
    suite knows of lost fixtures, interrupts and its own limits. ``next_tick`` is the moment it wants to be asked at
    the latest. ``take_case`` is called with each case of a program, and says whether it is kept.
    """

    def __init__(
        self,
        job: Job,
        limits: Limits,
        fork_server: ForkServerClient,
        emit: Callable[[Event], None],
        *,
        tick: Callable[[], Stop | None],
        next_tick: Callable[[], clock.Deadline],
        kill_now: Callable[[], bool],
        take_case: Callable[[Case], bool],
        ask: Callable[[Asked, Callable[[str | None, str], None]], None] | None = None,
        fixtures: dict[str, int] | None = None,
    ) -> None:
        self._job = job
        self._limits = limits
        self._fork_server = fork_server
        self._emit = emit
        self._tick = tick
        self._next_tick = next_tick
        self._kill_now = kill_now
        self._take_case = take_case
        self._ask = ask
        self._fixtures = fixtures or {}
        self._child: Child
        self._said: Transcript
        self._deadline = clock.Deadline()
        self._total = clock.Deadline()
        self._stop: Stop | None = None
        self._killed = False
        self._kernel_state = ""
        self._dumped: Phase | None = None

    @property
    def stopped(self) -> bool:
        """Whether it was ended from outside: what its process was sent may still be under way when the test is over."""
        return self._stop is not None

    def run(self, take: Callable[[], Child] | None = None) -> Outcome:
        """Carry it out in a fresh process, or in the one that ``take`` gives, and say what it came to."""
        began = clock.monotonic()
        earlier: set[str] = set()
        self._said = Transcript(
            self._job,
            self._emit,
            enter=self._enter,
            finish=self._finish,
            ask=self._put,
            take_case=self._take_case,
            earlier=earlier,
        )
        try:
            child = self._child = self._obtain(take or self._take_fresh)
        except LoadTimeoutError as error:
            outcome = self._not_loaded(error)
        except ForkServerLostError as error:
            return judge.error(self._said, "internal", str(error))
        else:
            earlier |= child.done
            self._started(child.pid)
            loading = self._fork_server.loading_took if take is None else 0.0
            self._total = _left(self._limits.total, loading)
            self._deadline = _left(self._limits.setup, loading)
            child.begin(self._job, self._said.hear, self._said.write)
            self._wait()
            child.drain()
            child.done.add(self._job.id)
            outcome = self._conclude()
        return replace(outcome, duration=clock.monotonic() - began)

    def _obtain(self, take: Callable[[], Child]) -> Child:
        try:
            return take()
        except ForkServerLostError:  # it was lost while nothing ran, which is no concern of the test
            return take()

    def _take_fresh(self) -> Child:
        """A child of its own. The loading of a shared file counts as the loading of this test."""
        limits = [limit for limit in (self._limits.setup, self._limits.total) if limit is not None]
        return self._fork_server.take(self._job.plugin, self._fixtures, min(limits, default=None))

    def _started(self, pid: int) -> None:
        self._emit(TestStarted(test=self._job.id, attempt=self._job.attempt, pid=pid, fixtures=self._fixtures))

    def _not_loaded(self, error: LoadTimeoutError) -> Outcome:
        """The file that it shares with other tests did not come to the end of its loading."""
        self._started(0)
        self._tell_stacks(error.stacks or f"{_NO_STACKS}\n", str(error))
        return judge.error(self._said, "timeout", str(error))

    def _put(self, question: Asked) -> None:
        """Put a question of the test to the operator."""
        if self._ask is not None:
            self._ask(question, lambda text, source: self._child.send(Answer(question.question, text, source)))

    # Waiting -----------------------------------------------------------------------------------------------------

    def _wait(self) -> None:
        while not self._over():
            deadline = self._deadline if self._stop else self._deadline.earliest(self._total)
            self._fork_server.reactor.run_once(deadline.earliest(self._next_tick()))
            if self._over():
                return
            if self._stop is None:
                stop = self._reason_to_stop()
                if stop is not None:
                    self._end_early(stop)
            elif not self._killed and (self._deadline.expired or self._kill_now()):
                self._press_on()

    def _over(self) -> bool:
        """Whether the process is gone, or waits for its next job."""
        return self._child.end is not None or (self._said.finished is not None and not self._job.last)

    def _enter(self, phase: Phase) -> float | None:
        """A phase begins, with its limit; one that undoes what the test did has it also when the test is stopped."""
        limit = self._limits.of(phase)
        undoing = phase in UNDOING_PHASES
        if undoing:
            self._child.stop_nudging()
        if self._stop is None or (undoing and not self._killed):
            self._deadline = clock.Deadline.after(limit)
        return limit

    def _finish(self) -> None:
        self._deadline = clock.Deadline.after(_LEAVING)
        self._child.stop_nudging()

    def _reason_to_stop(self) -> Stop | None:
        stop = self._tick()
        if stop is not None:
            return stop
        if self._total.expired:
            return self._overdue("the test", self._total)
        if self._child.channel_closed and self._said.finished is None:
            self._deadline = clock.Deadline()  # either it ends now, or it is cut off
            why = judge.why_cut_off(garbled=self._child.garbled)
            return Stop(Verdict.ERROR, "channel", why) if self._child.cut_off else None
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
        self._stop = replace(stop, failures=self._said.failures)
        if self._over():
            return
        spared = self._said.phase in UNDOING_PHASES and not self._child.cut_off
        if spared and not (self._deadline.expired or self._kill_now()):
            self._child.signal(signal.SIGCONT)
            return  # it is undoing what it did, which is what it would be stopped for; that has its own time
        self._child.interrupt(STOP_SIGNAL)
        self._deadline = clock.Deadline.after(self._limits.grace)
        if self._kill_now():
            self._press_on()

    def _press_on(self) -> None:
        """It did not stop: kill it."""
        if self._dumped not in (None, self._said.phase) and not self._kill_now():  # it hangs in its teardown, too
            self._dump_stacks()
            if self._over() or not (self._deadline.expired or self._kill_now()):
                return  # meanwhile it has come to the next phase, which has its own time
        self._killed = True
        self._child.kill()
        self._deadline = clock.Deadline()

    # The end -----------------------------------------------------------------------------------------------------

    def _conclude(self) -> Outcome:
        child, stop = self._child, self._stop
        stacks = child.new_stacks()
        if not stacks and stop is not None and stop.reason == "timeout":
            stacks = f"{_NO_STACKS}; the kernel says\n{self._kernel_state}\n"
        self._tell_stacks(stacks, stop.detail if stop else "crash")
        self._said.close()
        return judge.judge(self._said, child.end, stop, killed=self._killed, garbled=child.garbled)

    def _tell_stacks(self, stacks: str, cause: str) -> None:
        if stacks:
            self._emit(StackDumped(text=stacks, cause=cause, test=self._job.id))


def _kind(message: Event | Case) -> str:
    return message.kind if isinstance(message, Event) else "case"


def _left(limit: float | None, used: float) -> clock.Deadline:
    """What is left of a time limit. The deadline names the limit as a whole."""
    if limit is None:
        return clock.Deadline()
    return clock.Deadline(clock.monotonic() + max(0.0, limit - used), limit)


def run_in_process(job: Job, emit: Callable[[Event], None], take_case: Callable[[Case], object]) -> Outcome:
    """Run one attempt inside the runner, for a debugger's sake; nothing can end a test that hangs.

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
