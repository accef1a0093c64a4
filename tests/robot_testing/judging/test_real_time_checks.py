"""Whether the loop of a test kept its period, and whether states and commands were in time."""

import numpy as np
import pytest

from rtf import clock
from rtf.robot_testing.judging import real_time_checks as machine
from rtf.robot_testing.judging.real_time_checks import (
    RecentCpuPressure,
    command_delay,
    loop_delay,
    overload,
    state_delay,
)
from rtf.robot_testing.judging.real_time_checks import stalled_seconds as stalled_really


def test_a_loop_that_keeps_its_period_is_not_late():
    """Nor is one with small deviations, or one that has just begun."""
    assert loop_delay(np.arange(100) * 0.01, 0.01) == ""
    assert loop_delay([0.0, 0.014, 0.02, 0.036, 0.04, 0.05], 0.01) == ""
    assert loop_delay([], 0.01) == loop_delay([1.0], 0.01) == ""


@pytest.mark.parametrize(
    ("ticks", "words"),
    [([0.0, 0.01, 0.049, 0.06, 0.07], "was suspended for 39 ms"), (np.arange(20) * 0.016, "takes 16 ms a tick")],
)
def test_a_stalled_or_slow_loop_is_late(ticks, words):
    """The message has the delay and the period."""
    said = loop_delay(ticks, 0.01)
    assert words in said
    assert "its period is 10 ms" in said


def test_states_are_late_compared_with_their_usual_age():
    """So the two clocks may differ by a day."""
    ages = 86400.0 + np.tile([0.001, 0.006, 0.011], 30)
    assert state_delay(ages, 0.01) == state_delay([], 0.01) == ""
    assert "a state came 30 ms later than usual" in state_delay([*ages, 86400.036], 0.01)


COMMANDS = [(0.01 * tick, 5.0 + tick) for tick in range(20)]
STAMPS = np.arange(0.0, 0.2, 0.005)


def driven(delays):
    """Return the outputs of a board at each stamp, with this delay of the commands."""
    heard = np.array([time for time, _ in COMMANDS]) + delays
    return [5.0 + np.flatnonzero(heard <= stamp + 1e-9)[-1] for stamp in STAMPS]


def test_commands_that_arrive_in_time_are_not_late():
    """With small delays, as on any network; the output of another controller shows nothing."""
    assert command_delay(COMMANDS, STAMPS, driven(np.r_[0.0, np.full(19, 0.003)]), 0.01) == ""
    assert command_delay(COMMANDS, STAMPS, np.full(STAMPS.size, 77.0), 0.01) == ""
    assert command_delay(COMMANDS[:1], STAMPS, np.full(STAMPS.size, 5.0), 0.01) == ""


def test_a_board_with_an_old_command_got_the_next_one_late():
    """The message has the time for which the old command was executed."""
    delays = np.zeros(20)
    delays[8:12] = [0.04, 0.03, 0.02, 0.01]
    assert "a command took 35 ms to its board" in command_delay(COMMANDS, STAMPS, driven(delays), 0.01)


def test_a_machine_with_waiting_processes_is_busy():
    """The machine counts the waiting time, which only grows; the share is reported in per cent."""
    assert overload(0.0) == overload(0.4) == ""
    assert "for 93% of the time a task waited for a CPU" in overload(0.93)
    assert "for 100%" in overload(1.02)
    before = stalled_really()
    assert stalled_really() >= before >= 0.0


def test_only_recent_load_counts(monkeypatch):
    """Load that ended long ago is forgotten, and load that has just begun is not yet known."""
    now, waited = 100.0, 0.0
    monkeypatch.setattr(clock, "monotonic", lambda: now)
    monkeypatch.setattr(machine, "stalled_seconds", lambda: waited)
    moments = RecentCpuPressure()
    assert moments.overload() == ""
    for second, share in enumerate([0.0, 0.0, 0.9, 0.9, 0.0, 0.0, 0.0]):
        for _ in range(100):
            now, waited = now + 0.01, waited + 0.01 * share
            moments.update()
        said = moments.overload()
        assert ("too busy" in said) == (second in {2, 3}), (second, said)
