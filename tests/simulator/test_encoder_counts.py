"""What boards compute from counts: speeds and accelerations of motions that are known."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from icub import AXES, INDEX
from rtf.robot.model.file import Encoders
from rtf.simulator.encoder_counts import EncoderCounts

from .rig import Rig

TICKS = np.array([1000.0, 10430.0])  # a radian
MILLISECOND = 0.001


def counted(settings: Encoders, angles: list[float]) -> EncoderCounts:
    """Return the counts after these angles of both encoders (rad), a millisecond each."""
    counts = EncoderCounts(TICKS, settings)
    counts.fill(np.rint(angles[0] * TICKS), np.full(2, angles[0]))
    for tick, angle in enumerate(angles):
        counts.put(tick, angle * TICKS, np.full(2, angle))
    return counts


@given(speed=st.floats(-5.0, 5.0), window=st.integers(1, 20), late=st.integers(0, 5), start=st.floats(-3.0, 3.0))
def test_a_steady_speed_is_shown_to_a_count(speed: float, window: int, late: int, start: float):
    """Its error is less than a count in the window; the position is as old as the latency says."""
    settings = Encoders(latency=late * MILLISECOND, speed_window=window * MILLISECOND)
    angles = [start + speed * tick * MILLISECOND for tick in range(60)]
    counts, speeds = counted(settings, angles).shown(59)
    assert np.array_equal(counts, np.rint(angles[59 - late] * TICKS))
    assert np.abs(speeds - speed).max() <= 1.0 / (TICKS.min() * window * MILLISECOND) + 1e-9
    assert speeds * TICKS * window * MILLISECOND == pytest.approx(
        np.rint(speeds * TICKS * window * MILLISECOND), abs=1e-6
    )


@given(acceleration=st.floats(-50.0, 50.0), steps=st.integers(5, 40))
def test_a_steady_acceleration_is_shown_to_some_counts(acceleration: float, steps: int):
    """Its error is at most two counts by the square of the window."""
    settings = Encoders(acceleration_window=steps * MILLISECOND)
    angles = [acceleration * (tick * MILLISECOND) ** 2 / 2 for tick in range(120)]
    counts = counted(settings, angles)
    error = np.abs(counts.accelerations(119) - acceleration)
    assert (error <= 2.0 / (TICKS * (steps * MILLISECOND) ** 2) + 1e-6).all()
    assert counts.rotor_accelerations(119) == pytest.approx([acceleration] * 2, abs=1e-6)


@pytest.mark.skipif(not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'")
def test_boards_show_what_their_counts_say():
    """A moving elbow: its speed comes in steps of a count, near the true one; at rest it is zero, without noise."""
    rig, elbow = Rig(collision="none"), INDEX["l_elbow"]
    rig.run(0.1)
    assert rig.boards.velocity[elbow] == 0.0
    rig.boards.speeds[elbow] = 60.0
    rig.say(rig.boards.move, "l_elbow", 80.0)
    step = 1.0 / (AXES[elbow].encoder_resolution * 0.008)
    for _ in range(20):
        rig.run(0.02)
        shown, true = rig.boards.velocity[elbow], float(np.degrees(rig.data.actuator_velocity[elbow]))
        assert shown / step == pytest.approx(round(shown / step), abs=1e-6)
        assert shown == pytest.approx(true, abs=step + 3.0)  # and 5 ms old, at up to 400 deg/s2
    motor = rig.boards.motor_motion()[1][elbow] / AXES[elbow].gearbox
    assert motor == pytest.approx(float(np.degrees(rig.data.actuator_velocity[elbow])), abs=3.0)
