"""Cartesian motions of the arm on joints that do what they are told: straight, bell-shaped, within limits."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtf.robot.controllers.cartesian import CartesianMotion
from rtf.robot.errors import RefusedError
from rtf.robot.kinematics import InverseKinematics, robot_chains
from rtf.robot.model import load_robot

ICUB = load_robot("icub")
#: The left arm alone, on a torso that stands still.
ARM = (
    robot_chains(ICUB)
    .chain("left_arm", "2.5")
    .limited_by(ICUB.axes)
    .blocked({"torso_pitch": 0.0, "torso_roll": 0.0, "torso_yaw": 0.0})
)
START = np.array([-30.0, 30.0, 0.0, 45.0, 0.0, 0.0, 0.0])
INVERSE = InverseKinematics(ARM)
PERIOD = 0.01
#: Of the iCub's controller: metres and radians in one norm.
TOLERANCE = 0.01


def moved(posture: np.ndarray, seconds: float, **options: object) -> tuple[CartesianMotion, np.ndarray]:
    """A motion from the start to a posture, and all positions on the way."""
    motion = CartesianMotion(ARM, period=PERIOD, **options)
    motion.reset(START)
    motion.begin(posture)
    return motion, np.array([motion.step() for _ in range(round(seconds / PERIOD))])


def posture_near(shares: tuple[float, ...]) -> np.ndarray:
    """A posture of the arm that the solver gives for the pose of another one near the start."""
    aim = np.clip(START + 40.0 * np.array(shares), ARM.minima + 3.0, ARM.maxima - 3.0)
    return INVERSE.solve(ARM.pose(aim), START).positions


POSTURES = st.tuples(*[st.floats(-1.0, 1.0)] * len(ARM)).map(posture_near)


@settings(max_examples=15)
@given(POSTURES)
def test_a_pose_is_reached_within_limits(posture):
    """At the end within 2 mm and 1 deg, and on the way within the limits."""
    motion, ways = moved(posture, 2.5, duration=1.0)
    pose, wanted = ARM.pose(ways[-1]), ARM.pose(posture)
    assert np.linalg.norm(pose[:3, 3] - wanted[:3, 3]) < 0.002
    assert np.degrees(np.arccos(min(1.0, (np.trace(pose[:3, :3].T @ wanted[:3, :3]) - 1.0) / 2.0))) < 1.0
    assert (ways >= ARM.minima - 1e-9).all()
    assert (ways <= ARM.maxima + 1e-9).all()
    assert motion.done(ways[-1], TOLERANCE)
    assert motion.share(START) == pytest.approx(1.0, abs=0.02)


def test_the_speed_of_the_tip_is_a_bell():
    """Up and down once; its peak is that of the filter, 1.46 times the way by the duration."""
    posture = INVERSE.solve(ARM.pose(START)[:3, 3] + [-0.05, 0.1, 0.1], START).positions
    _, ways = moved(posture, 4.0, duration=2.0)
    places = ARM.pose(np.vstack([START, ways]))[:, :3, 3]
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) / PERIOD
    peak = int(np.argmax(speeds))
    assert (np.diff(speeds[:peak]) > -1e-3).all()
    assert (np.diff(speeds[peak:]) < 1e-3).all()
    assert speeds.max() == pytest.approx(1.46 * np.linalg.norm(places[-1] - places[0]) / 2.0, rel=0.05)


def test_the_tip_goes_straighter_than_joints_alone():
    """A straightness of 0 leaves the path to the joints."""
    posture = posture_near((0.9, 0.5, -0.8, 0.9, 0.6, -0.5, 0.3))
    bows = {}
    for straightness in (0.0, 0.05, 1.0):
        _, ways = moved(posture, 4.0, straightness=straightness)
        places = ARM.pose(np.vstack([START, ways]))[:, :3, 3]
        along = (places[-1] - places[0]) / np.linalg.norm(places[-1] - places[0])
        across = (places - places[0]) - np.outer((places - places[0]) @ along, along)
        bows[straightness] = np.linalg.norm(across, axis=1).max()
    assert bows[1.0] < bows[0.05] < bows[0.0]


def test_a_new_target_on_the_way_makes_no_jump():
    """The speeds go on where they were."""
    motion, _ = moved(posture_near((0.5,) * 7), 0.8)
    before = motion.speeds.copy()
    motion.begin(START)
    motion.step()
    assert np.abs(motion.speeds - before).max() < 3.0
    for _ in range(400):
        motion.step()
    assert motion.planned == pytest.approx(START, abs=0.2)


def test_a_position_leaves_the_orientation():
    """Of a position alone only metres count."""
    posture = posture_near((0.5,) * 7)
    motion = CartesianMotion(ARM)
    motion.reset(START)
    motion.begin(posture, has_orientation=False)
    wanted, present = ARM.pose(posture)[:3, 3], ARM.pose(START)[:3, 3]
    assert motion.error(START) == pytest.approx(np.linalg.norm(wanted - present))


def test_what_is_refused():
    """Chains without joints, and positions of another number."""
    with pytest.raises(RefusedError, match="has no joint to move"):
        CartesianMotion(ARM.blocked(dict.fromkeys(ARM.joints, 0.0)))
    motion = CartesianMotion(ARM)
    with pytest.raises(RefusedError, match="has 7 joints"):
        motion.reset([0.0] * 3)
    with pytest.raises(RefusedError, match="no position is given for l_shoulder_pitch"):
        motion.begin([float("nan"), *START[1:]])
