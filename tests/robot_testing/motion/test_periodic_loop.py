"""The ticks of loops that command joints."""

import pytest

from rtf.robot_testing.motion.periodic_loop import ticks


class Scripted:
    """A part without joints: a clock that is told how long the commands take, and a guard that counts."""

    def __init__(self):
        self.clock = self.guard = self
        self.time, self.watched = 100.0, 0

    def now(self):
        """Return the time, in s."""
        return self.time

    def sleep(self, seconds):
        """Advance the time; nothing else does."""
        assert seconds > 0
        self.time += seconds

    def watch(self):
        """Count the calls."""
        self.watched += 1


def test_ticks_come_at_multiples_of_the_period():
    """Whatever the commands take, up to a period; the guard watches at each tick."""
    part = Scripted()
    times = []
    for elapsed in ticks(part, 0.01, 0.1):
        times.append(elapsed)
        part.time += 0.003
    assert times == pytest.approx([0.01 * tick for tick in range(10)], abs=1e-9)
    assert part.now() == pytest.approx(100.1)
    assert part.watched == 10


def test_a_missed_tick_is_skipped():
    """The following ones keep their times."""
    part = Scripted()
    times = []
    for elapsed in ticks(part, 0.01, 0.1):
        times.append(elapsed)
        if len(times) == 3:
            part.time += 0.025
    assert times == pytest.approx([0.0, 0.01, 0.02, 0.05, 0.06, 0.07, 0.08, 0.09], abs=1e-9)


def test_there_is_at_least_one_tick():
    """Also within less than a period."""
    assert len(list(ticks(Scripted(), 0.01, 0.0))) == 1
