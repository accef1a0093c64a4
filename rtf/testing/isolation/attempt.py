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
from rtf.testing.events import (
    Answered,
    Asked,
    Attached,
    Event,
    Measured,
    Message,
    OutputCaptured,
    ParametersResolved,
    PhaseStarted,
    Progressed,
    SeriesRecorded,
    SeriesSampled,
    StackDumped,
    SubResultEnded,
    TestRenamed,
    TestStarted,
)
from rtf.testing.isolation import messages, processes
from rtf.testing.isolation.capture import Capture
from rtf.testing.isolation.messages import NUDGE_PERIOD, NUDGE_SIGNAL, STOP_SIGNAL, Answer, Case, Finished
from rtf.testing.isolation.worker_pool import ForkServerLostError, LoadTimeoutError
from rtf.testing.verdict import UNDOING_PHASES, MeasurementVerdict, Phase, Severity, Verdict

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.testing.isolation.messages import Job
    from rtf.testing.isolation.worker_pool import Child, ForkServerClient

#: How long a test may take to react to being asked to stop, and a killed one to vanish.
GRACE = 2.0
_VANISH = 5.0
#: How long a process may still take to end when its test is over.
_LEAVING = 10.0
#: Beyond this many bytes of events, what only informs is counted and not kept; beyond twice as many, failures too.
EVENT_BYTES = 64 << 20
#: So many unintelligible lines are told of, the rest are counted; and so much is quoted of what was said.
_PROTOCOL_ERRORS = 20
_QUOTED = 300
_ORDER = (Phase.LOAD, Phase.SETUP, Phase.RUN, Phase.TEARDOWN, Phase.CLEANUP)

#: What a test may say; anything else on its channel is an error of the test.
_ALLOWED = (
    Message,
    Measured,
    SeriesRecorded,
    SeriesSampled,
    SubResultEnded,
    Attached,
    Progressed,
    PhaseStarted,
    ParametersResolved,
    TestRenamed,
    Asked,
    Answered,
    Case,
)


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What an attempt came to."""

    verdict: Verdict
    reason: str = ""
    detail: str = ""
    duration: float = 0.0
    exit_status: int | None = None
    signal: str = ""
    cpu_time: float = 0.0
    max_rss: int = 0
    #: Whether nobody knows what it left behind: it was ended from outside, or something went wrong while it undid
    #: what it had done.
    cut_short: bool = False


@dataclass(slots=True)
class Stop:
    """Why an attempt is being ended from outside."""

    verdict: Verdict
    reason: str
    detail: str


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
        self._child: Child | None = None
        self._phase = Phase.LOAD
        self._deadline = clock.Deadline()
        self._total = clock.Deadline()
        self._silence = clock.Deadline()
        self._nudge = clock.Deadline()
        self._finished: Finished | None = None
        self._stop: Stop | None = None
        self._killed = False
        self._repetition = 0
        self._failures = 0
        self._failures_before_stop = 0
        self._errors = 0
        self._undoing_failed = False
        self._loading_took = 0.0
        self._garbled = 0
        self._late = 0
        self._first = ""
        self._bytes = 0
        self._left_out = 0
        self._kernel_state = ""
        self._dumped: Phase | None = None
        self._capture = Capture(self._captured)

    def run(self, take: Callable[[], Child] | None = None) -> Outcome:
        """Carry it out in a fresh process, or in the one that ``take`` gives, and say what it came to."""
        began = clock.monotonic()
        try:
            child = self._child = self._obtain(take or self._take_fresh)
        except LoadTimeoutError as error:
            return self._not_loaded(str(error), began)
        except ForkServerLostError as error:
            return self._error("internal", str(error))
        self._emit(
            TestStarted(test=self._job.id, attempt=self._job.attempt, pid=child.pid, fixtures=self._fixtures),
        )
        self._total = _left(self._limits.total, self._loading_took)
        self._deadline = _left(self._limits.setup, self._loading_took)
        child.begin(self._job, self._hear, self._capture.feed)
        self._wait()
        child.drain()
        child.done.add(self._job.id)
        self._capture.close()
        self._dump()
        if self._left_out:
            self._note(Severity.WARNING, "journal", f"{self._left_out} events left out: the test said too much")
        return replace(self._conclude(), duration=clock.monotonic() - began)

    def _obtain(self, take: Callable[[], Child]) -> Child:
        try:
            return take()
        except ForkServerLostError:  # it was lost while nothing ran, which is no concern of the test
            return take()

    def _take_fresh(self) -> Child:
        """A child of its own. The loading of a shared file counts as the loading of this test."""
        limits = [limit for limit in (self._limits.setup, self._limits.total) if limit is not None]
        child = self._fork_server.take(self._job.plugin, self._fixtures, min(limits, default=None))
        self._loading_took = self._fork_server.loading_took
        return child

    def _not_loaded(self, why: str, began: float) -> Outcome:
        """The file that it shares with other tests did not come to the end of its loading."""
        self._emit(TestStarted(test=self._job.id, attempt=self._job.attempt, fixtures=self._fixtures))
        self._stop = Stop(Verdict.ERROR, "timeout", why)
        self._dump()
        return replace(self._error("timeout", why), duration=clock.monotonic() - began)

    @property
    def stopped(self) -> bool:
        """Whether it was ended from outside: what its process was sent may still be under way when the test is over."""
        return self._stop is not None

    # Waiting -----------------------------------------------------------------------------------------------------

    def _wait(self) -> None:
        child = self._require_child()
        reactor = self._fork_server.reactor
        while not self._over(child):
            deadline = self._deadline if self._stop else self._deadline.earliest(self._total)
            reactor.run_once(deadline.earliest(self._next_tick()).earliest(self._nudge))
            if self._over(child):
                return
            if self._stop is None:
                self._look_for_reason_to_stop(child)
            elif self._deadline.expired or (self._kill_now() and not self._killed):
                self._press_on(child)
            elif self._nudge.expired:
                child.signal(NUDGE_SIGNAL)
                self._nudge = clock.Deadline.after(NUDGE_PERIOD)

    def _over(self, child: Child) -> bool:
        """Whether the process is gone, or waits for its next job."""
        return child.end is not None or (self._finished is not None and not self._job.last)

    def _look_for_reason_to_stop(self, child: Child) -> None:
        stop = self._tick()
        if stop is None and self._total.expired:
            stop = self._overdue(child, "the test", self._total)
        if stop is None and child.channel_closed and self._finished is None:
            stop = self._channel_closed()
        elif stop is None and self._deadline.expired:
            stop = self._overdue(child, self._what(), self._deadline)
        if stop is not None:
            self._end_early(child, stop)

    def _what(self) -> str:
        if self._finished is not None:
            return "the test was over, but its process"
        return "loading" if self._phase is Phase.LOAD else f"{self._phase}()"

    def _end_early(self, child: Child, stop: Stop) -> None:
        self._stop = stop
        self._failures_before_stop = self._failures
        if self._over(child):
            return
        child.signal(signal.SIGCONT)
        if self._phase in UNDOING_PHASES and not (self._deadline.expired or self._kill_now()):
            return  # it is undoing what it did, which is what it would be stopped for; that has its own time
        child.signal(STOP_SIGNAL)
        self._deadline = clock.Deadline.after(self._limits.grace)
        self._nudge = clock.Deadline.after(NUDGE_PERIOD)
        if self._kill_now():
            self._press_on(child)

    def _channel_closed(self) -> Stop | None:
        """A process that dies closes its channel a moment before its end is known; one that lives on is cut off."""
        if self._silence.at == clock.FOREVER:
            self._silence = self._deadline = clock.Deadline.after(self._limits.grace)
        return Stop(Verdict.ERROR, "channel", self._why_cut_off()) if self._silence.expired else None

    def _why_cut_off(self) -> str:
        if self._require_child().garbled:
            return "the test wrote what is no message on the channel to its runner"
        return "the test closed the channel to its runner"

    def _overdue(self, child: Child, what: str, deadline: clock.Deadline) -> Stop:
        detail = f"{what} did not end within {deadline.limit:g} s"
        self._kernel_state = processes.kernel_state(child.pid)
        if "(stopped)" in self._kernel_state:
            detail += "; the process had been stopped by a signal"
        self._fork_server.rouse()
        child.signal(signal.SIGCONT)
        self._ask_for_stacks(child)
        return Stop(Verdict.ERROR, "timeout", detail)

    def _ask_for_stacks(self, child: Child) -> None:
        self._dumped = self._phase
        self._fork_server.dump_stacks(child)

    def _press_on(self, child: Child) -> None:
        """It did not stop: kill it, and if even that shows no effect, the fork server with it."""
        if self._killed:
            self._fork_server.abandon()
            return
        self._fork_server.rouse()
        if self._dumped not in (None, self._phase) and not self._kill_now():  # it hangs in its teardown, too
            self._ask_for_stacks(child)
            if self._over(child) or not (self._deadline.expired or self._kill_now()):
                return  # meanwhile it has come to the next phase, which has its own time
        self._killed = True
        self._nudge = clock.Deadline()
        child.signal(signal.SIGKILL, group=True)
        self._deadline = clock.Deadline.after(_VANISH)

    # Hearing -----------------------------------------------------------------------------------------------------

    def _hear(self, data: bytes) -> None:
        try:
            message = messages.from_child(data)
        except (ValueError, RecursionError) as error:
            self._garble(f"said something unintelligible: {str(error)[:_QUOTED]}: {data[:_QUOTED]!r}")
            return
        if isinstance(message, Finished):
            self._finished = message
            self._deadline = clock.Deadline.after(_LEAVING)
            self._nudge = clock.Deadline()
        elif not isinstance(message, _ALLOWED):
            self._garble(f"may not say {message.kind if isinstance(message, Event) else 'that'}")
        elif message.test == self._job.id:
            if isinstance(message, Case):
                self._hear_case(message, len(data))
            else:
                self._take(message, len(data))
        elif message.test in self._require_child().done:
            self._say_late(message, message.test)
        else:
            self._garble(f"may not say {_kind(message)} of {message.test[:_QUOTED]!r}")

    def _hear_case(self, case: Case, size: int) -> None:
        """Have a case kept. One that is bad and cannot be kept makes the program fail."""
        self._bytes += size
        bad = not case.verdict.good
        if self._bytes > (2 * EVENT_BYTES if bad else EVENT_BYTES) or not self._take_case(case):
            self._left_out += 1
            self._failures += bad
            self._first = self._first or (f"{case.name}: {case.detail}" if bad else "")

    def _say_late(self, event: Event | Case, test: str) -> None:
        """A thread of an earlier test lives on in the process that this test shares with it."""
        if self._late >= _PROTOCOL_ERRORS:
            self._left_out += 1
            return
        self._late += 1
        text = f"{event.title}: {event.detail}" if isinstance(event, Message) else _kind(event)
        detail = f"said by a thread of the test after the test was over: {text}"[:_QUOTED]
        self._emit(Message(severity=Severity.WARNING, title="late", detail=detail, test=test))

    def _garble(self, what: str) -> None:
        self._garbled += 1
        if self._garbled <= _PROTOCOL_ERRORS:
            self._note(Severity.ERROR, "protocol", f"the test's process {what}")
        else:
            self._left_out += 1

    def _take(self, event: Event, size: int) -> None:
        self._bytes += size
        bad = self._weigh(event)
        if isinstance(event, PhaseStarted):
            if not self._comes_next(event):
                self._garble(f"may not enter {event.phase} (repetition {event.repetition}) now")
                return
            event = self._enter(event)
        elif self._bytes > (2 * EVENT_BYTES if bad else EVENT_BYTES):
            self._left_out += 1
            return
        elif isinstance(event, Asked):
            self._question(event)
        self._emit(event)

    def _weigh(self, event: Event) -> bool:
        """Count a failure or an error, whether it is kept or not; says whether it is one."""
        if isinstance(event, Message) and event.severity in (Severity.FAILURE, Severity.ERROR):
            if event.severity is Severity.FAILURE:
                self._failures += 1
            else:
                self._errors += 1
            self._first = self._first or event.detail or event.title
        elif isinstance(event, Measured) and event.verdict is MeasurementVerdict.FAILED:
            self._failures += 1
            self._first = self._first or event.name
        else:
            return False
        self._undoing_failed = self._undoing_failed or self._phase in UNDOING_PHASES
        return True

    def _comes_next(self, event: PhaseStarted) -> bool:
        """Whether this phase may begin now: each begins once and has one limit, so that no test outlives its limits."""
        if event.phase is Phase.RUN and self._phase is Phase.RUN:
            return self._repetition < event.repetition <= self._job.repetition + 1
        return _ORDER.index(event.phase) > _ORDER.index(self._phase) if event.phase in _ORDER else False

    def _enter(self, event: PhaseStarted) -> PhaseStarted:
        self._phase = event.phase
        self._repetition = event.repetition
        limit = self._limits.of(event.phase)
        if event.phase in UNDOING_PHASES:
            self._nudge = clock.Deadline()
        if self._stop is None or (event.phase in UNDOING_PHASES and not self._killed):
            self._deadline = clock.Deadline.after(limit)
        return PhaseStarted(
            time=event.time, test=event.test, phase=event.phase, repetition=event.repetition, limit=limit
        )

    def _question(self, question: Asked) -> None:
        child = self._require_child()

        def answer(text: str | None, source: str) -> None:
            child.send(Answer(question.question, text, source))

        if self._ask is not None:
            self._ask(question, answer)

    def _captured(self, stream: str, text: str, omitted: int) -> None:
        self._emit(OutputCaptured(stream=stream, text=text, test=self._job.id, omitted=omitted))

    def _note(self, severity: Severity, title: str, detail: str) -> None:
        if severity is Severity.ERROR:
            self._errors += 1
            self._first = self._first or detail
        self._emit(Message(severity=severity, title=title, detail=detail, test=self._job.id, phase=self._phase))

    def _dump(self) -> None:
        stacks = self._fork_server.new_stacks()
        if not stacks and self._stop is not None and self._stop.reason == "timeout":
            stacks = f"the process did not answer the request for its stacks; the kernel says\n{self._kernel_state}\n"
        if stacks:
            cause = self._stop.detail if self._stop else "crash"
            self._emit(StackDumped(text=stacks, cause=cause, test=self._job.id))

    # The verdict -------------------------------------------------------------------------------------------------

    def _conclude(self) -> Outcome:
        end = self._require_child().end
        outcome = self._verdict()
        cut_short = outcome.cut_short or self._stop is not None or self._undoing_failed
        if end is None:
            return replace(outcome, cut_short=cut_short)
        return replace(
            outcome,
            exit_status=end.exit_status,
            signal=end.signal,
            cpu_time=end.cpu_time,
            max_rss=end.max_rss,
            cut_short=cut_short,
        )

    def _verdict(self) -> Outcome:
        if self._stop is not None:
            return self._stopped_verdict(self._stop)
        end = self._require_child().end
        finished = self._finished
        if finished is None or (end is not None and end.status is None):
            return self._crash()
        if end is not None and end.status != 0:
            how = processes.describe_end(end.exit_status, end.signal)
            return self._error("crash", f"after the test was over its process ended badly: {how}")
        return self._claim(finished)

    def _claim(self, finished: Finished) -> Outcome:
        """What is made of the last word of a process that ended well."""
        if self._failures or self._errors:  # what was heard counts, whatever the process says at last
            verdict, reason = (Verdict.FAILED, "failure") if self._failures else (Verdict.ERROR, "error")
            return Outcome(verdict=verdict, reason=reason, detail=finished.detail or self._first)
        if finished.stopped:
            return self._error("stopped", "it was told to stop, and not by the runner")
        try:
            verdict = Verdict(finished.outcome)
        except ValueError:
            return self._error("protocol", "the test's process did not say what the test came to")
        return Outcome(verdict=verdict, reason=finished.reason, detail=finished.detail)

    def _stopped_verdict(self, stop: Stop) -> Outcome:
        detail = stop.detail
        if self._killed:
            detail += "; it did not react to being stopped and was killed"
        if stop.verdict is Verdict.ERROR:
            return self._error(stop.reason, detail)
        if stop.verdict is Verdict.INTERRUPTED and self._failures_before_stop:
            detail = f"{self._first}; then: {detail}"
            return Outcome(verdict=Verdict.FAILED, reason=stop.reason, detail=detail, cut_short=True)
        return Outcome(verdict=stop.verdict, reason=stop.reason, detail=detail, cut_short=True)

    def _crash(self) -> Outcome:
        end = self._require_child().end
        where = "while loading" if self._phase is Phase.LOAD else f"in {self._phase}()"
        if end is None or end.status is None:
            return self._error(
                "internal", f"the process from which tests are forked was lost, and the test with it, {where}"
            )
        if end.signal:
            hint = " (the machine may have run out of memory)" if end.signal == "SIGKILL" else ""
            return self._error("crash", f"killed by {end.signal} {where}{hint}")
        if end.exit_status == messages.CUT_OFF or self._require_child().garbled:
            return self._error("channel", self._why_cut_off())
        return self._error(
            "exit", f"the process ended with exit status {end.exit_status} {where}, before the test was over"
        )

    def _error(self, reason: str, detail: str) -> Outcome:
        """An error, unless a failure was found before: that the thing under test is wrong is never hidden."""
        self._note(Severity.ERROR, reason, detail)
        if self._failures:
            return Outcome(
                verdict=Verdict.FAILED, reason=reason, detail=f"{self._first}; then: {detail}", cut_short=True
            )
        return Outcome(verdict=Verdict.ERROR, reason=reason, detail=detail, cut_short=True)

    def _require_child(self) -> Child:
        if self._child is None:
            raise RuntimeError("the attempt has no process yet")
        return self._child


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
