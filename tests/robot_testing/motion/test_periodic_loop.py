"""The beats of loops that command joints."""

import pytest

from rtf.robot_testing.motion.periodic_loop import ticks


class MonitoredQuantity:
    """A part without joints: a clock that is told what the commands take, and a guard that counts."""

    def __init__(self):
        self.clock = self.guard = self
        self.time, self.watched = 100.0, 0

    def now(self):
        """Seconds."""
        return self.time

    def sleep(self, seconds):
        """No time but this passes."""
        assert seconds > 0
        self.time += seconds

    def watch(self):
        """Count."""
        self.watched += 1


def test_beats_come_at_multiples_of_the_period():
    """However long commands take, as long as that is less than a period; and the guard looks on at each."""
    part = MonitoredQuantity()
    beats = []
    for elapsed in ticks(part, 0.01, 0.1):
        beats.append(elapsed)
        part.time += 0.003
    assert beats == pytest.approx([0.01 * beat for beat in range(10)], abs=1e-9)
    assert part.now() == pytest.approx(100.1)
    assert part.watched == 10


def test_a_late_beat_is_left_out():
    """The ones after it are where they would have been."""
    part = MonitoredQuantity()
    beats = []
    for elapsed in ticks(part, 0.01, 0.1):
        beats.append(elapsed)
        if len(beats) == 3:
            part.time += 0.025
    assert beats == pytest.approx([0.0, 0.01, 0.02, 0.05, 0.06, 0.07, 0.08, 0.09], abs=1e-9)


def test_there_is_one_beat_at_least():
    """Even in less than a period."""
    assert len(list(ticks(MonitoredQuantity(), 0.01, 0.0))) == 1
