"""What an attempt came to: made of what was heard, the process's own claim, how it ended, and why it was stopped."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from rtf.testing.isolation import messages, processes
from rtf.testing.verdict import Phase, Severity, Verdict

if TYPE_CHECKING:
    from rtf.testing.isolation.child import End
    from rtf.testing.isolation.messages import Finished
    from rtf.testing.isolation.transcript import Transcript


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


@dataclass(frozen=True, slots=True)
class Stop:
    """Why an attempt is being ended from outside. ``failures`` is the number of those that were found before."""

    verdict: Verdict
    reason: str
    detail: str
    failures: int = 0


def judge(said: Transcript, end: End | None, stop: Stop | None, *, killed: bool, garbled: bool) -> Outcome:
    """Return the outcome of an attempt whose process has ended, or waits for its next job (``end`` is None then).

    An error is told in the name of the test.
    """
    if stop is not None:
        outcome = _stopped(said, stop, killed=killed)
    elif said.finished is None or (end is not None and end.status is None):
        outcome = _ended_before(said, end, garbled=garbled)
    elif end is not None and end.status != 0:
        how = processes.describe_end(end.exit_status, end.signal)
        outcome = error(said, "crash", f"after the test was over its process ended badly: {how}")
    else:
        outcome = _claimed(said, said.finished)
    cut_short = outcome.cut_short or stop is not None or said.undoing_failed
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


def error(said: Transcript, reason: str, detail: str) -> Outcome:
    """An error, unless a failure was found before: that the thing under test is wrong is never hidden."""
    said.note(Severity.ERROR, reason, detail)
    verdict = Verdict.FAILED if said.failures else Verdict.ERROR
    if said.failures:
        detail = f"{said.first}; then: {detail}"
    return Outcome(verdict=verdict, reason=reason, detail=detail, cut_short=True)


def why_cut_off(*, garbled: bool) -> str:
    """Why a test cannot be heard any more."""
    if garbled:
        return "the test wrote what is no message on the channel to its runner"
    return "the test closed the channel to its runner"


def _claimed(said: Transcript, finished: Finished) -> Outcome:
    """What is made of the last word of a process that ended well."""
    if said.failures or said.errors:  # what was heard counts, whatever the process says at last
        verdict, reason = (Verdict.FAILED, "failure") if said.failures else (Verdict.ERROR, "error")
        return Outcome(verdict=verdict, reason=reason, detail=finished.detail or said.first)
    if finished.stopped:
        return error(said, "stopped", "it was told to stop, and not by the runner")
    try:
        verdict = Verdict(finished.outcome)
    except ValueError:
        return error(said, "protocol", "the test's process did not say what the test came to")
    return Outcome(verdict=verdict, reason=finished.reason, detail=finished.detail)


def _stopped(said: Transcript, stop: Stop, *, killed: bool) -> Outcome:
    detail = f"{stop.detail}; it did not react to being stopped and was killed" if killed else stop.detail
    if stop.verdict is Verdict.ERROR:
        return error(said, stop.reason, detail)
    if stop.verdict is Verdict.INTERRUPTED and stop.failures:
        return Outcome(verdict=Verdict.FAILED, reason=stop.reason, detail=f"{said.first}; then: {detail}")
    return Outcome(verdict=stop.verdict, reason=stop.reason, detail=detail)


def _ended_before(said: Transcript, end: End | None, *, garbled: bool) -> Outcome:
    """A process that ended before its test was over."""
    where = "while loading" if said.phase is Phase.LOAD else f"in {said.phase}()"
    if end is None or end.status is None:
        return error(
            said, "internal", f"the process from which tests are forked was lost, and the test with it, {where}"
        )
    if end.signal:
        hint = " (the machine may have run out of memory)" if end.signal == "SIGKILL" else ""
        return error(said, "crash", f"killed by {end.signal} {where}{hint}")
    if end.exit_status == messages.CUT_OFF or garbled:
        return error(said, "channel", why_cut_off(garbled=garbled))
    how = f"the process ended with exit status {end.exit_status} {where}, before the test was over"
    return error(said, "exit", how)
