"""An attempt, with a scripted child process: phases, limits, and which of its messages count."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from rtf import clock
from rtf.testing.events import Event, Message, OutputCaptured, PhaseStarted, StackDumped, TestStarted
from rtf.testing.isolation.attempt import Attempt, Limits, Stop
from rtf.testing.isolation.child import End
from rtf.testing.isolation.messages import DUMP_SIGNAL, STOP_SIGNAL, Case, Finished, Frames, Job, pack
from rtf.testing.plugins import PluginRef
from rtf.testing.verdict import Phase, Severity, Verdict

if TYPE_CHECKING:
    from collections.abc import Callable

PLUGIN = PluginRef("test", "t", "t.py", "python")
FINISHED = pack(Finished("passed"))
GARBAGE = b"\x07\0\0\0garbage"


class Scripted:
    """A child and its fork server in one: each turn of the reactor plays one step.

    ``waits`` are the limits of the deadlines that were waited for. Writing stacks takes one turn.
    """

    def __init__(self, *steps: bytes | End | Callable[[Scripted], None]) -> None:
        self.steps = [*steps]
        self.pid = 0
        self.end: End | None = None
        self.channel_closed = self.cut_off = False
        self.garbled = False
        self.loading_took = 0.0
        self.done: set[str] = set()
        self.signals: list[tuple[int, bool]] = []
        self.waits: list[float] = []
        self.stacks = ""

    @property
    def reactor(self) -> Scripted:
        return self

    def take(self, *_: object) -> Scripted:
        return self

    def begin(self, job: Job, on_message: Callable[[bytes], None], on_output: Callable[[str, bytes], None]) -> None:
        self.on_message, self.on_output = on_message, on_output

    def run_once(self, deadline: clock.Deadline) -> None:
        assert self.steps, "the attempt should be over"
        self.waits.append(deadline.limit)
        step = self.steps.pop(0)
        if isinstance(step, bytes):
            for message in Frames().feed(step):
                self.on_message(message)
        elif isinstance(step, End):
            self.end = step
        else:
            step(self)

    def signal(self, signum: int, *, group: bool = False) -> None:
        self.signals.append((int(signum), group))

    def send(self, message: object) -> None:
        pass

    def drain(self) -> None:
        pass

    def interrupt(self, signum: int) -> None:
        self.signal(signum)

    def stop_nudging(self) -> None:
        pass

    def kill(self) -> None:
        self.signal(9, group=True)

    def dump_stacks(self) -> str:
        self.signal(DUMP_SIGNAL)
        if self.end is None:
            self.run_once(clock.Deadline.after(1.0))
            self.stacks += "stacks\n"
        return "State: S (sleeping)"

    def new_stacks(self) -> str:
        new, self.stacks = self.stacks, ""
        return new


def phase(name: Phase, repetition: int = 0) -> bytes:
    """Return the message that begins a phase."""
    return pack(PhaseStarted(test="s/t", phase=name, repetition=repetition))


def attempt(
    *steps: bytes | End | Callable[[Scripted], None],
    repetition: int = 0,
    limits: Limits | None = None,
    tick: Callable[[], Stop | None] = lambda: None,
    kill_now: Callable[[], bool] = lambda: False,
    take_case: Callable[[Case], bool] = lambda _: True,
    last: bool = True,
):
    """Run an attempt with a scripted child. Return the outcome, the events and the child."""
    child = Scripted(*steps)
    events: list[Event] = []
    made = Attempt(
        Job(
            kind="test",
            id="s/t",
            name="t",
            plugin=PLUGIN,
            folder="",
            run_folder="",
            repetition=repetition,
            last=last,
        ),
        limits or Limits(),
        child,  # type: ignore[arg-type]
        events.append,
        tick=tick,
        next_tick=clock.Deadline,
        kill_now=kill_now,
        take_case=take_case,
    )
    return made.run(), events, child


def nothing(child: Scripted) -> None:
    """A step without a message."""


@pytest.fixture
def later(monkeypatch: pytest.MonkeyPatch):
    """Return a function that makes a step of so many seconds; no other time passes."""
    now = [1000.0]
    monkeypatch.setattr(clock, "monotonic", lambda: now[0])

    def make(seconds: float) -> Callable[[Scripted], None]:
        def pass_by(_child: Scripted) -> None:
            now[0] += seconds

        return pass_by

    return make


def test_what_is_finished_and_ended_well_is_believed():
    """The outcome that a test reports counts if its process ends with 0."""
    outcome, events, _ = attempt(phase(Phase.RUN), FINISHED, End(0, cpu_time=0.5, max_rss=7))
    assert (outcome.verdict, outcome.exit_status, outcome.cpu_time, outcome.max_rss) == (Verdict.PASSED, 0, 0.5, 7)
    assert [type(event) for event in events] == [TestStarted, PhaseStarted]
    assert not outcome.cut_short


@pytest.mark.parametrize(
    ("lines", "verdict"),
    [
        pytest.param(pack(Message(severity=Severity.FAILURE, title="x", test="s/t")), Verdict.FAILED, id="failure"),
        pytest.param(pack(Message(severity=Severity.ERROR, title="x", test="s/t")), Verdict.ERROR, id="error"),
        pytest.param(pack(Message(severity=Severity.WARNING, title="x", test="s/t")), Verdict.PASSED, id="warning"),
        pytest.param(GARBAGE, Verdict.ERROR, id="garbage"),
    ],
)
def test_received_failures_count_whatever_the_process_claims(lines: bytes, verdict: Verdict):
    """A failure or error that was reported counts, also if the test then reports that it passed."""
    assert attempt(lines + FINISHED, End(0))[0].verdict is verdict


@pytest.mark.parametrize(
    ("where", "severity", "cut_short"),
    [
        (Phase.RUN, Severity.ERROR, False),
        (Phase.TEARDOWN, Severity.ERROR, True),
        (Phase.CLEANUP, Severity.FAILURE, True),
        (Phase.CLEANUP, Severity.WARNING, False),
    ],
)
def test_what_goes_wrong_while_it_undoes_things_cuts_it_short(where: Phase, severity: Severity, cut_short: bool):
    """An error in teardown or clean-up cuts the attempt short, because the state is unknown."""
    said = pack(Message(severity=severity, title="x", test="s/t"))
    assert attempt(phase(where) + said + FINISHED, End(0))[0].cut_short is cut_short


@pytest.mark.parametrize("last", [pack(Finished("")), pack(Finished("splendid")), GARBAGE])
def test_claim_that_is_none(last: bytes):
    """An invalid last message is an error."""
    outcome = attempt(last, End(0))[0]
    assert outcome.verdict is Verdict.ERROR
    assert outcome.reason in ("protocol", "exit")


@pytest.mark.parametrize(
    ("end", "reason", "detail"),
    [
        (End(11), "crash", "killed by SIGSEGV while loading"),
        (End(9), "crash", "killed by SIGKILL while loading (the machine may have run out of memory)"),
        (End(3 << 8), "exit", "the process ended with exit status 3 while loading, before the test was over"),
        (End(71 << 8), "channel", "the test closed the channel to its runner"),
        (
            End(None),
            "internal",
            "the process from which tests are forked was lost, and the test with it, while loading",
        ),
    ],
)
def test_process_that_ends_before_the_test_is_over(end: End, reason: str, detail: str):
    """The detail has how the process ended, and in which phase."""
    outcome = attempt(end)[0]
    assert (outcome.verdict, outcome.reason, outcome.detail) == (Verdict.ERROR, reason, detail)
    assert outcome.cut_short


@pytest.mark.parametrize(
    ("phases", "repetition", "accepted"),
    [
        ([(Phase.SETUP, 0), (Phase.RUN, 0), (Phase.TEARDOWN, 0), (Phase.CLEANUP, 0)], 0, 4),
        ([(Phase.RUN, 1), (Phase.RUN, 2), (Phase.RUN, 3)], 2, 3),
        ([(Phase.RUN, 1), (Phase.RUN, 2), (Phase.RUN, 3)], 1, 2),
        ([(Phase.RUN, 0), (Phase.RUN, 0)], 0, 1),
        ([(Phase.RUN, 2), (Phase.RUN, 1)], 3, 1),
        ([(Phase.TEARDOWN, 0), (Phase.RUN, 0), (Phase.TEARDOWN, 0)], 0, 1),
        ([(Phase.CHECK, 0)], 0, 0),
        ([(Phase.LOAD, 0)], 0, 0),
    ],
)
def test_phases_begin_once_and_in_order(phases: list[tuple[Phase, int]], repetition: int, accepted: int):
    """A phase that begins again, or out of order, is refused, so that it cannot renew its limit."""
    lines = b"".join(phase(name, count) for name, count in phases)
    _, events, _ = attempt(lines + FINISHED, End(0), repetition=repetition)
    assert sum(isinstance(event, PhaseStarted) for event in events) == accepted
    reported = [event for event in events if isinstance(event, Message) and event.title == "protocol"]
    assert len(reported) == len(phases) - accepted


def test_phases_are_reported_with_their_limits():
    """Loading has the limit of setup, and clean-ups have that of teardown."""
    limits = Limits(setup=1.0, run=2.0, teardown=3.0)
    assert [limits.of(name) for name in (Phase.LOAD, Phase.SETUP, Phase.RUN, Phase.TEARDOWN, Phase.CLEANUP)] == [
        1.0,
        1.0,
        2.0,
        3.0,
        3.0,
    ]


def test_stop_is_asked_for_then_pressed():
    """A test that does not react to a stop is signalled, then killed."""
    limits = Limits(grace=0.0)
    stop = Stop(Verdict.INTERRUPTED, "interrupted", "enough")
    kills = iter([False, False, True, True, True, True])
    outcome, _, child = attempt(
        phase(Phase.RUN), *[nothing] * 4, End(9), limits=limits, tick=lambda: stop, kill_now=lambda: next(kills, True)
    )
    assert (2, False) in child.signals
    assert (9, True) in child.signals
    assert (outcome.verdict, outcome.detail) == (
        Verdict.INTERRUPTED,
        "enough; it did not react to being stopped and was killed",
    )


@pytest.mark.parametrize("undoing", [Phase.TEARDOWN, Phase.CLEANUP])
@pytest.mark.parametrize(
    ("verdict", "reason"),
    [(Verdict.INTERRUPTED, "interrupted"), (Verdict.FIXTURE_LOST, "fixture"), (Verdict.ERROR, "timeout")],
)
def test_test_that_undoes_things_is_not_cut_short(undoing: Phase, verdict: Verdict, reason: str):
    """A test in its teardown or clean-up is not signalled by a stop."""
    stop = Stop(verdict, reason, "enough")
    outcome, _, child = attempt(phase(undoing), nothing, FINISHED, End(0), tick=lambda: stop)
    assert (2, False) not in child.signals
    assert outcome.verdict is verdict


class TestTimeOut:
    """Time-outs, with messages that arrive while stacks are written, which may take a second."""

    LIMITS = Limits(setup=60.0, run=300.0, teardown=30.0, grace=2.0)

    def test_stops_the_body_and_shows_its_stacks(self, later: Callable[[float], Callable[[Scripted], None]]):
        """A body that exceeds its limit is stopped, its stacks are reported, and teardown has its own limit."""
        outcome, events, child = attempt(
            phase(Phase.RUN), later(301.0), nothing, phase(Phase.TEARDOWN), FINISHED, End(0), limits=self.LIMITS
        )
        assert child.signals == [(DUMP_SIGNAL, False), (STOP_SIGNAL, False)]
        assert (outcome.verdict, outcome.reason) == (Verdict.ERROR, "timeout")
        assert outcome.detail == "run() did not end within 300 s"
        assert [event.text for event in events if isinstance(event, StackDumped)] == ["stacks\n"]

    @pytest.mark.parametrize("undoing", [Phase.TEARDOWN, Phase.CLEANUP])
    def test_leaves_an_undoing_alone_that_began_meanwhile(
        self, undoing: Phase, later: Callable[[float], Callable[[Scripted], None]]
    ):
        """A teardown or clean-up that begins meanwhile is not stopped, and has its whole limit."""
        outcome, _, child = attempt(
            phase(Phase.RUN), later(301.0), phase(undoing), later(29.0), FINISHED, End(0), limits=self.LIMITS
        )
        assert (int(STOP_SIGNAL), False) not in child.signals
        assert (9, True) not in child.signals
        assert child.waits[3:] == [30.0, 30.0, 10.0]
        assert (outcome.verdict, outcome.reason) == (Verdict.ERROR, "timeout")

    def test_of_an_undoing_that_began_meanwhile_kills(self, later: Callable[[float], Callable[[Scripted], None]]):
        """A teardown that began meanwhile is killed when it exceeds its own limit."""
        outcome, _, child = attempt(
            phase(Phase.RUN),
            later(301.0),
            phase(Phase.TEARDOWN),
            later(31.0),
            nothing,
            End(9),
            limits=self.LIMITS,
        )
        assert (9, True) in child.signals
        assert child.signals.count((int(DUMP_SIGNAL), False)) == 2
        assert outcome.detail.endswith("was killed")

    def test_stops_an_undoing_that_takes_too_long(self, later: Callable[[float], Callable[[Scripted], None]]):
        """A teardown that exceeds its limit is stopped."""
        outcome, _, child = attempt(phase(Phase.TEARDOWN), later(31.0), nothing, FINISHED, End(0), limits=self.LIMITS)
        assert (int(STOP_SIGNAL), False) in child.signals
        assert outcome.detail == "teardown() did not end within 30 s"

    def test_does_not_kill_clean_ups_that_began_meanwhile(self, later: Callable[[float], Callable[[Scripted], None]]):
        """Clean-ups after a teardown that hung have a limit of their own."""
        steps = (
            phase(Phase.RUN),
            later(301.0),
            nothing,  # the stacks of run(); then it is asked to stop
            phase(Phase.TEARDOWN),
            later(31.0),
            phase(Phase.CLEANUP),  # while those of teardown() are written
        )
        _, _, child = attempt(*steps, later(29.0), FINISHED, End(0), limits=self.LIMITS)
        assert (9, True) not in child.signals
        outcome, _, child = attempt(*steps, later(31.0), nothing, End(9), limits=self.LIMITS)
        assert child.signals.count((9, True)) == 1
        assert outcome.detail.endswith("was killed")

    def test_kills_by_force_whatever_began_meanwhile(self, later: Callable[[float], Callable[[Scripted], None]]):
        """A kill that is requested while stacks are written is executed."""
        forced = []

        def clean_up(child: Scripted) -> None:
            child.on_message(b"".join(Frames().feed(phase(Phase.CLEANUP))))
            forced.append(True)

        steps = (phase(Phase.RUN), later(301.0), nothing, phase(Phase.TEARDOWN), later(31.0), clean_up, End(9))
        _, _, child = attempt(*steps, limits=self.LIMITS, kill_now=lambda: bool(forced))
        assert (9, True) in child.signals

    def test_sends_nothing_after_the_end(self, later: Callable[[float], Callable[[Scripted], None]]):
        """A process that has ended its test gets no signal, which would reach its next test."""
        outcome, _, child = attempt(phase(Phase.RUN), later(301.0), FINISHED, limits=self.LIMITS, last=False)
        assert child.signals[-1] == (DUMP_SIGNAL, False)
        assert outcome.reason == "timeout"


@pytest.mark.parametrize(
    ("said", "verdict", "reason"),
    [
        (b"", Verdict.ERROR, "stopped"),
        (pack(Message(severity=Severity.FAILURE, title="x", test="s/t")), Verdict.FAILED, "failure"),
    ],
    ids=["nothing", "failure"],
)
def test_test_that_another_process_stopped_has_not_passed(said: bytes, verdict: Verdict, reason: str):
    """A test that was stopped from outside has not passed; a failure that it reported counts."""
    stopped = pack(Finished("passed", stopped="stopped by the runner"))
    outcome = attempt(phase(Phase.RUN) + said + stopped, End(0))[0]
    assert (outcome.verdict, outcome.reason) == (verdict, reason)


@pytest.mark.parametrize(
    ("early", "late", "verdict"),
    [(True, False, Verdict.FAILED), (False, True, Verdict.INTERRUPTED), (False, False, Verdict.INTERRUPTED)],
)
def test_failure_counts_when_it_was_found_before_the_stop(early: bool, late: bool, verdict: Verdict):
    """A failure before a stop counts; one after it may be caused by the stop."""
    failure = pack(Message(severity=Severity.FAILURE, title="checks", detail="wrong", test="s/t"))
    stop = Stop(Verdict.INTERRUPTED, "interrupted", "enough")
    asked: list[int] = []

    def tick() -> Stop | None:
        asked.append(1)
        return stop if len(asked) > 1 else None

    first = phase(Phase.RUN) + (failure if early else b"")
    outcome, _, _ = attempt(first, nothing, (failure if late else b"") or nothing, FINISHED, End(0), tick=tick)
    assert outcome.verdict is verdict


def test_fixture_lost_outweighs_what_the_test_had_found():
    """A lost fixture outweighs failures that the test reported."""
    failure = pack(Message(severity=Severity.FAILURE, title="checks", detail="wrong", test="s/t"))
    stop = Stop(Verdict.FIXTURE_LOST, "fixture", "rig: gone")
    outcome = attempt(phase(Phase.RUN) + failure, End(9), tick=lambda: stop)[0]
    assert outcome.verdict is Verdict.FIXTURE_LOST


def test_output_is_the_tests():
    """Output of the process is captured as that of the test."""

    def speak(child: Scripted) -> None:
        child.on_output("stderr", b"hear, hear\n")

    _, events, _ = attempt(speak, FINISHED, End(0))
    assert [event.text for event in events if isinstance(event, OutputCaptured)] == ["hear, hear\n"]


def test_quotes_of_garbage_are_short():
    """The report about an invalid message quotes only its beginning."""
    _, events, _ = attempt((1_000_000).to_bytes(4, "little") + b"x" * 1_000_000 + FINISHED, End(0))
    (message,) = [event for event in events if isinstance(event, Message)]
    assert len(message.detail) < 1000


# Cases ---------------------------------------------------------------------------------------------------------------


def said_case(verdict: Verdict, test: str = "s/t") -> bytes:
    """Return the message of a case."""
    return pack(Case(test=test, name="a", verdict=verdict, detail="why"))


def test_cases_are_handed_on_and_weigh_nothing():
    """Cases are handed to the suite worker, and do not change the outcome."""
    taken: list[str] = []
    outcome, events, _ = attempt(
        phase(Phase.RUN),
        said_case(Verdict.FAILED),
        pack(Finished(outcome="passed")),
        End(0),
        take_case=lambda case: taken.append(case.name) is None,
    )
    assert taken == ["a"]
    assert outcome.verdict is Verdict.PASSED
    assert not [event for event in events if isinstance(event, Message)]


@pytest.mark.parametrize(("verdict", "expected"), [(Verdict.FAILED, Verdict.FAILED), (Verdict.PASSED, Verdict.PASSED)])
def test_a_bad_case_that_cannot_be_kept_is_a_failure_of_the_program(verdict: Verdict, expected: Verdict):
    """A failed case that cannot be kept fails the program."""
    outcome, events, _ = attempt(
        phase(Phase.RUN), said_case(verdict), pack(Finished(outcome="passed")), End(0), take_case=lambda _: False
    )
    assert outcome.verdict is expected
    assert any(isinstance(event, Message) and "1 events left out" in event.detail for event in events)


def test_a_test_cannot_report_cases_of_another():
    """A process cannot report cases of another test."""
    taken: list[Case] = []
    outcome, *_ = attempt(
        phase(Phase.RUN),
        said_case(Verdict.PASSED, "s/other"),
        pack(Finished(outcome="passed")),
        End(0),
        take_case=lambda case: taken.append(case) is None,
    )
    assert not taken
    assert outcome.detail == "the test's process may not say case of 's/other'"


@pytest.mark.parametrize("duration", [float("nan"), float("inf"), -1.0])
def test_a_case_with_a_time_that_is_none_is_garbage(duration: float):
    """A case with an invalid duration is an invalid message."""
    taken: list[Case] = []
    outcome, *_ = attempt(
        phase(Phase.RUN),
        pack(Case(test="s/t", name="a", verdict=Verdict.PASSED, duration=duration)),
        pack(Finished(outcome="passed")),
        End(0),
        take_case=lambda case: taken.append(case) is None,
    )
    assert not taken
    assert "said something unintelligible" in outcome.detail
