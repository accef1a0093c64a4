"""Encoders of joints and motors that disagree: the simplest hypothesis names the culprit."""

import numpy as np
import pytest

from rtf.robot_testing.judging.blame import Strength
from rtf.robot_testing.judging.encoder_agreement import Motion, Tolerance, encoder_evidence

#: A joint of its own, two that share both motors, and two of which one is turned by the motor of the other, too.
COUPLING = np.array([
    [1.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, 0.5, -0.5, 0.0, 0.0],
    [0.0, 0.5, 0.5, 0.0, 0.0],
    [0.0, 0.0, 0.0, 1.0, 0.0],
    [0.0, 0.0, 0.0, -1.625, 1.625],
])  # fmt: skip
GEARBOX = np.array([100.0, -100.0, -100.0, 150.0, 100.0])
NAMES = ("elbow", "roll", "pitch", "shoulder", "arm")
TIME = np.linspace(0.0, 4.0, 400)
#: All joints move, each in its own way.
JOINTS = 10.0 * np.sin(np.outer(TIME, [1.0, 1.6, 2.3, 2.9, 3.7]) + np.arange(5))
MOTORS = GEARBOX * (JOINTS @ COUPLING.T)


def evidence(positions=JOINTS, motors=MOTORS, **options):
    """What is found."""
    return encoder_evidence(Motion.of(positions, motors, GEARBOX, COUPLING), NAMES, **options)


def changed(readings, axis, change):
    """The readings with another column."""
    wrong = readings.copy()
    wrong[:, axis] = change(wrong[:, axis])
    return wrong


@pytest.mark.parametrize("obeyed", [True, False])
def test_encoders_that_agree_are_no_evidence(obeyed):
    """Neither are offsets of their zeros, a little play, or a delay of one state."""
    late = np.roll(JOINTS, 1, axis=0)
    late[0] = late[1]
    assert evidence(obeyed=obeyed) == []
    assert evidence(JOINTS + 33.0, MOTORS - 1000.0, obeyed=obeyed) == []
    assert evidence(JOINTS + 0.5 * np.sign(np.gradient(JOINTS, axis=0)), obeyed=obeyed) == []
    assert evidence(late, obeyed=obeyed) == []


CHANGES = {
    "frozen": lambda column: np.full(column.size, column[0]),
    "opposite directions": lambda column: -column,
    "times the motion": lambda column: 2.0 * column,
    "disagree": lambda column: np.random.default_rng(1).normal(0.0, 10.0, column.size),
}


@pytest.mark.parametrize("joint", range(5))
@pytest.mark.parametrize("change", CHANGES)
def test_a_wrong_joint_encoder_is_found_through_all_of_its_motors(joint, change):
    """Also where it makes the motors of a coupled joint disagree; that one is not accused."""
    (found,) = evidence(changed(JOINTS, joint, CHANGES[change]))
    assert found.joints == {joint}
    assert found.strength is Strength.CERTAIN
    assert change in found.sentence or "shows 0.0" in found.text


@pytest.mark.parametrize("joint", [1, 2, 3, 4])
@pytest.mark.parametrize("way", [4.0, 6.0, 9.0])
def test_a_joint_encoder_that_drifts_a_little_is_told_from_its_neighbour(joint, way):
    """A drift of less than the tolerance of the other joint's own motor is not explained by that joint."""
    (found,) = evidence(changed(0.1 * JOINTS, joint, lambda column: column + way * TIME / TIME[-1]), 0.1 * MOTORS)
    assert found.joints == {joint}


@pytest.mark.parametrize("motor", [1, 2, 3, 4])
@pytest.mark.parametrize("way", [4.0, 6.0, 9.0])
def test_a_motor_encoder_that_drifts_a_little_is_told_from_those_of_its_joints(motor, way):
    """A joint with two motors would make the other one disagree, if only a little."""
    size = GEARBOX[motor] * np.abs(COUPLING[motor]).max()
    (found,) = evidence(0.1 * JOINTS, changed(0.1 * MOTORS, motor, lambda column: column + size * way * TIME / 4.0))
    assert found.joints == {motor}


@pytest.mark.parametrize("motor", range(5))
@pytest.mark.parametrize("change", CHANGES)
def test_a_wrong_motor_encoder_is_that_of_its_joint(motor, change):
    """One motor disagrees, and the joints went where they should."""
    (found,) = evidence(motors=changed(MOTORS, motor, CHANGES[change]), obeyed=True)
    assert found.joints == {motor}


@pytest.mark.parametrize("pair", [(0, 3), (1, 2), (2, 4), (3, 4)])
@pytest.mark.parametrize("signs", [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)])
def test_exchanged_joint_encoders_are_recognized(pair, signs):
    """With the signs with which they count."""
    wrong = JOINTS.copy()
    wrong[:, pair] = JOINTS[:, pair[::-1]] * signs
    (found,) = evidence(wrong)
    assert found.joints == {*pair}
    assert f"encoders of {NAMES[pair[0]]} and {NAMES[pair[1]]} are swapped" in found.text
    assert ("wrong way" in found.text) is (min(signs) < 0)


@pytest.mark.parametrize("pair", [(0, 3), (1, 2), (2, 4), (3, 4)])
def test_exchanged_motor_encoders_are_recognized(pair):
    """Whatever their ratios are; also of motors that share joints."""
    wrong = MOTORS.copy()
    wrong[:, pair] = MOTORS[:, pair[::-1]]
    (found,) = evidence(motors=wrong, obeyed=True)
    assert found.joints == {*pair}
    assert f"the motor encoders of {NAMES[pair[0]]} and {NAMES[pair[1]]} are swapped" in found.text


def test_two_wrong_encoders_are_two_pieces_of_evidence():
    """No single cause explains both."""
    wrong = changed(changed(MOTORS, 0, lambda column: 3.0 * column), 3, lambda column: 0.0 * column)
    assert [one.joints for one in evidence(motors=wrong)] == [{0}, {3}]


def test_the_tolerance_counts():
    """A tenth too much is nothing in a motion that went wrong, and something in a calm one."""
    wrong = changed(JOINTS, 0, lambda column: 1.1 * column)
    assert evidence(wrong) == []
    (found,) = evidence(wrong, tolerance=Tolerance(0.5, 0.02), obeyed=True)
    assert found.joints == {0}
    assert "1.10 times" in found.text


def test_readings_that_are_not_finite_are_no_evidence():
    """They are counted elsewhere."""
    assert evidence(changed(JOINTS, 0, lambda column: np.where(column > 0, np.nan, -column))) == []
