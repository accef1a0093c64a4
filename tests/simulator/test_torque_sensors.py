"""The torque sensors of joints: late, with noise and an offset, and without knowledge of friction."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from icub import AXES, INDEX, build_icub
from rtf.robot.model.file import JointTorques
from rtf.simulator.plant import Options
from rtf.simulator.torque_sensors import SAMPLED, TorqueSensors

from .rig import Rig, with_sensors

pytestmark = pytest.mark.skipif(
    not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"
)

MOST = np.array([axis.max_torque for axis in AXES])
PLANT = build_icub(Options(collision="none"))
HEALTHY = JointTorques()


def sensors(exerted: np.ndarray, seed: int = 0, **settings: float) -> TorqueSensors:
    """Return the sensors of the iCub, which read an array."""
    return TorqueSensors(with_sensors(PLANT, joint_torques=replace(HEALTHY, **settings)), exerted, seed)


@given(delay=st.integers(0, 20), change=st.integers(1, 30))
def test_a_torque_is_shown_after_the_delay(delay: int, change: int):
    """Not before, and with the sample after it: sensors are read a hundred times a second."""
    exerted = np.zeros(len(AXES))
    found = sensors(exerted, noise=0.0, offset=0.0, delay=delay * 0.01)
    found.rest(exerted)
    for number in range(change + delay + 3):
        exerted[:] = 1.0 if number >= change else 0.0
        found.sample(number * SAMPLED)
        assert (found.torques() == (1.0 if number >= change + delay else 0.0)).all()


def test_noise_and_offset_are_those_of_the_robots_file():
    """Shares of the greatest torque of each joint: noise by its deviation, the offset within its bounds."""
    exerted = np.zeros(len(AXES))
    found = sensors(exerted, delay=0.0, noise=0.002, offset=0.01)
    rows = []
    for number in range(2000):
        found.sample(number * SAMPLED)
        rows.append(found.torques() / MOST)
    shown = np.array(rows)
    assert shown.std(axis=0) == pytest.approx(np.full(len(AXES), 0.002), rel=0.1)
    offsets = shown.mean(axis=0)
    assert np.abs(offsets).max() <= 0.0102
    assert np.abs(offsets).max() > 0.008
    assert offsets.min() < 0.0 < offsets.max()


def test_another_seed_has_other_offsets_and_noise():
    """And the same one the same: a run can be repeated."""
    exerted, rows = np.zeros(len(AXES)), []
    for seed in (1, 1, 2):
        found = sensors(exerted, seed, delay=0.0)
        found.sample(0)
        rows.append(found.torques())
    assert np.array_equal(rows[0], rows[1])
    assert not (rows[0] == rows[2]).any()


def test_a_sensor_does_not_know_the_friction_behind_it():
    """A joint that is pushed against its friction does not move, and its sensor shows the torque of the motor alone."""
    rig = Rig(collision="none")
    rig.run(0.5)
    before = rig.boards.measured_torques()[INDEX["l_knee"]]
    rig.push("l_knee", 0.5)  # its friction at rest is 0.96 Nm
    rig.run(0.01)
    held = rig.boards.measured_torques()[INDEX["l_knee"]]
    assert held == pytest.approx(before, abs=0.25)
