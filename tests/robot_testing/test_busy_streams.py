"""The judgement of streams, and of boards, on a machine with too much load."""

from types import SimpleNamespace

import pytest

from rtf import clock
from rtf.clock import SystemClock
from rtf.middleware.clocks.network_clock import LockstepClock
from rtf.robot.errors import RefusedError, StaleStateError
from rtf.robot_testing import RobotTest
from rtf.robot_testing.judging import real_time_checks
from rtf.robot_testing.stream_test import RateTest
from rtf.robot_testing.streams.message import Message
from rtf.testing.measurement import MeasurementVerdict
from rtf.testing.session import Session
from rtf.testing.verdict import Inconclusive, Verdict


class Listening(RateTest):
    """A test of streams that has recorded; it keeps its measurements and their limits."""

    plugin_name = "listening"

    def measure(self, name, value, unit="", low=None, high=None, hint=""):
        """Keep the measurement."""
        self.limits_of[name] = (low, high)
        wrong = (high is not None and value > high) or (low is not None and value < low)
        if wrong:
            self.failures.append(f"{name}; {hint}")
        return SimpleNamespace(verdict=MeasurementVerdict.FAILED if wrong else MeasurementVerdict.PASSED)

    def record(self, name, **columns):
        """Discard the series."""


@pytest.fixture
def listening():
    """A test whose recording was in time."""
    test = Listening()
    test.listener = SimpleNamespace(late=[0.0, 0.001], stalled=0.0, factor=1.0, exact=False, cpu_pressure=0.1)
    test.clock = SystemClock()
    test.limits_of, test.failures = {}, []
    return test


def messages(every=1, copies=1):
    """Return two seconds of a hundred messages a second, with a given share of them, repeated as given."""
    return [
        Message(number, 0.01 * number, 0.01 * number + 0.002, 8, number, None)
        for number in range(0, 200, every)
        for _ in range(copies)
    ]


def test_missing_messages_fail_on_a_machine_without_load(listening):
    """The failures have likely causes."""
    listening.judge(messages(every=2), 100.0, 5.0)
    assert [text.split(";")[0] for text in listening.failures] == ["rate", "lost"]
    assert "messages are missing" in listening.failures[1]


def test_missing_messages_on_a_busy_machine_are_inconclusive(listening):
    """The sender may be on this machine. The measurements are recorded without limits."""
    listening.listener.cpu_pressure = 0.95
    with pytest.raises(Inconclusive, match=r"rate is 50 Hz, lost is .*; but this machine is too busy: for 95%"):
        listening.judge(messages(every=2), 100.0, 5.0)
    assert not listening.failures
    assert listening.limits_of["rate"] == (None, None)


def test_a_busy_machine_does_not_excuse_duplicates(listening):
    """And measurements within their limits count."""
    listening.listener.cpu_pressure = 0.95
    listening.judge(messages(), 100.0, 5.0)
    assert not listening.failures
    assert listening.limits_of["rate"] == (95.0, 105.0)
    listening.judge(messages(copies=2), 100.0, 5.0)
    assert [text.split(";")[0] for text in listening.failures] == ["duplicates"]


class Late:
    """A board whose first state arrives at the fifth request."""

    def __init__(self, looks):
        self.looks = looks

    def encoders(self):
        """See IEncoders."""
        self.looks -= 1
        if self.looks:
            raise StaleStateError("no state has come")


def test_a_first_state_may_be_late(listening):
    """A board without any state is an error."""
    slept = []
    listening.now, listening.sleep = lambda: sum(slept), slept.append
    listening._await_state(Late(1))
    assert len(slept) == 1
    listening._await_state(Late(5))
    assert len(slept) == 6
    with pytest.raises(StaleStateError):
        listening._await_state(Late(-1))
    assert sum(slept) < 3.0


class Looks(RobotTest):
    """A test whose states are late."""

    plugin_name = "looks"


@pytest.mark.parametrize(
    ("share", "time", "error", "verdict"),
    [
        pytest.param(0.9, SystemClock, StaleStateError, Verdict.INCONCLUSIVE, id="busy"),
        pytest.param(0.2, SystemClock, StaleStateError, Verdict.ERROR, id="idle"),
        pytest.param(0.9, LockstepClock, StaleStateError, Verdict.ERROR, id="lockstep"),
        pytest.param(0.9, SystemClock, RefusedError, Verdict.ERROR, id="another error"),
    ],
)
def test_stale_states_on_a_busy_machine_are_inconclusive(tmp_path, monkeypatch, share, time, error, verdict):
    """Not in lockstep; the message has the name of the stale data."""
    test, said = Looks(), []
    session = Session("s/looks", said.append, folder=tmp_path, run_folder=tmp_path)
    test.attach_to(session, "")
    test.clock = object.__new__(time)
    monkeypatch.setattr(real_time_checks, "stalled_seconds", lambda: 0.0)
    test._cpu_pressure = real_time_checks.CpuPressure()
    began = clock.monotonic()
    monkeypatch.setattr(real_time_checks, "stalled_seconds", lambda: 10.0 * share)
    monkeypatch.setattr(clock, "monotonic", lambda: began + 10.0)
    with session.part("joint"):
        raise error("the last state is 0.6 s old")
    assert said[-1].verdict is verdict
    assert said[-1].reason.startswith("the last state is 0.6 s old; but this machine is too busy") is (
        verdict is Verdict.INCONCLUSIVE
    )
