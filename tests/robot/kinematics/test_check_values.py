"""The shipped tables agree with what the iCub's own library computes, and differ from the description as documented."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rtf.robot.kinematics import ChainTables, described_chain, pose_error, pose_of
from rtf.robot.model import RobotModel

VALUES = Path(__file__).parents[2] / "data" / "kinematics" / "icub_poses.txt"
_EYE = [
    (0, 0, 0, 0, 0, 0, 0, 0),
    (0, 0, 0, -20, 10, 30, 10, 20),
    (10, -5, 20, 15, -10, -40, -15, -5),
    (20, 10, -30, -30, 5, 50, 5, 35),
    (-10, 5, 15, 10, 15, -20, -30, 10),
]
_ARM = [
    (0, 0, 0, 0, 0, 0, 0, 0, 0, 0),
    (0, 0, 0, -30, 30, 0, 45, 0, 0, 0),
    (10, -5, 20, -40, 40, 20, 60, 30, -20, 10),
    (30, 10, -30, -60, 80, -20, 90, -45, 5, -15),
    (-10, 5, 15, -10, 25, 60, 20, 15, -40, 20),
]
_LEG = [
    (0, 0, 0, 0, 0, 0),
    (30, 10, -10, -40, 15, -5),
    (60, -20, 30, -80, -10, 10),
    (-20, 5, 40, -10, 20, -20),
    (90, 15, -40, -110, -30, 15),
]
POSTURES = {
    "arm": _ARM,
    "leg": _LEG,
    "eye": _EYE,
    "head": [posture[:6] for posture in _EYE],
    "imu": [posture[:6] for posture in _EYE],
    "torso": [(0, 0, 0), (5, -10, 15), *(posture[:3] for posture in _EYE[2:])],
}


def test_every_check_value(tables: ChainTables):
    """Each pose is that of the library to its last digit: half a micrometre, and 2e-5 rad."""
    rows = [row.split() for row in VALUES.read_text(encoding="utf-8").splitlines() if not row.startswith("#")]
    assert len(rows) == 170
    for name, version, number, *numbers in rows:
        posture = POSTURES[name.rsplit("_", 1)[-1]][int(number)]
        error = pose_error(pose_of(np.array(numbers, dtype=float)), tables.chain(name, version).pose(posture))
        assert np.abs(error[:3]).max() < 0.51e-6, (name, version, number)
        assert np.abs(error[3:]).max() < 2e-5, (name, version, number)


def test_the_sensor_of_the_waist(tables: ChainTables):
    """A chain without joints has the pose of its sensor."""
    waist = tables.chain("waist_imu", "2.7")
    assert waist.pose([])[:3, 3].tolist() == [0.0906529, -0.011, -0.112309]
    assert waist.frames([]).shape == (0, 4, 4)
    assert waist.jacobian([]).shape == (6, 0)


@pytest.mark.parametrize(
    ("name", "link", "rms", "greatest"),
    [
        ("left_arm", "l_hand_dh_frame", 7.1, 10.3),
        ("right_arm", "r_hand_dh_frame", 7.5, 10.6),
        ("left_leg", "l_foot_dh_frame", 7.5, 11.4),
        ("left_eye", "eyes_l_ball", 3.4, 5.9),
    ],
)
def test_tables_and_description(
    icub: RobotModel, tables: ChainTables, name: str, link: str, rms: float, greatest: float
):
    """Both have the same joints, signs and zeros; positions differ by millimetres, as docs/kinematics.md says."""
    described = described_chain(icub, link)
    chain = tables.chain(name, "2.5").limited_by(icub.axes)
    assert chain.joints == described.joints
    postures = np.random.default_rng(1).uniform(chain.minima, chain.maxima, (500, len(chain)))
    difference = np.linalg.inv(described.pose(postures)) @ chain.pose(postures)
    assert np.ptp(difference[:, :3, :3], axis=0).max() < 1e-6
    millimetres = np.linalg.norm(difference[:, :3, 3], axis=1) * 1e3
    assert np.sqrt((millimetres**2).mean()) < rms
    assert millimetres.max() < greatest
