"""The filter of minimum jerk in a loop with an integrator."""

from __future__ import annotations

import numpy as np
import pytest

from rtf.robot.controllers.minimum_jerk import MinimumJerkFilter
from rtf.robot.errors import RefusedError

PERIOD = 0.01


def step_response(duration: float, size: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Positions and speeds after a step to 1."""
    tested, position = MinimumJerkFilter(size, PERIOD, duration), np.zeros(size)
    positions, speeds = [], []
    for _ in range(round(4 * duration / PERIOD)):
        speeds.append(tested.step(1.0 - position))
        position = position + speeds[-1] * PERIOD
        positions.append(position)
    return np.array(positions), np.array(speeds)


@pytest.mark.parametrize("duration", [0.5, 1.0, 2.0])
def test_a_step_takes_its_time(duration: float):
    """90 % at the time, all at one and a half, a bell without overshoot."""
    positions, speeds = step_response(duration, size=2)
    assert (positions[:, 0] == positions[:, 1]).all()
    assert positions[round(duration / PERIOD), 0] == pytest.approx(0.9, abs=0.025)
    assert positions[round(1.5 * duration / PERIOD), 0] == pytest.approx(1.0, abs=0.015)
    assert positions.max() < 1.0002
    assert speeds.max() * duration == pytest.approx(1.46, abs=0.02)
    assert speeds.min() > -0.002 / duration


def test_a_time_is_at_least_ten_periods():
    """Also one that is changed in a motion; none is refused."""
    tested = MinimumJerkFilter(1, PERIOD, 0.001)
    assert tested.duration == pytest.approx(0.1)
    tested.duration = 2.0
    assert tested.duration == 2.0
    for wrong in (0.0, -1.0, float("nan")):
        with pytest.raises(RefusedError, match="a motion takes a time above 0 s"):
            tested.duration = wrong
    tested.step([1.0])
    tested.reset()
    assert tested.step([0.0]) == [0.0]
