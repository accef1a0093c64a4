"""Motors that do not follow their duty cycles, after a motion that went wrong."""

import numpy as np
import pytest

from rtf.robot_testing.judging.blame import Strength
from rtf.robot_testing.judging.drive_agreement import Drive, drive_evidence

#: A joint of its own, two that share both motors, and another one of its own.
COUPLING = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.5, -0.5, 0.0], [0.0, 0.5, 0.5, 0.0], [0.0, 0.0, 0.0, 1.0]])
NAMES = ("yaw", "roll", "pitch", "knee")
TIME = np.arange(0.0, 1.0, 0.01)
STILL = np.zeros((TIME.size, 4))


def evidence(duties, turns, suspects=(0, 1, 2, 3)):
    """What is found for duty cycles (%) and speeds (deg/s) of motors, over time or from 0.3 s on."""
    duties, turns = (values if np.ndim(values) == 2 else np.outer(TIME > 0.3, values) for values in (duties, turns))
    turned = np.cumsum(turns, axis=0) * 0.01
    joints = turned @ np.linalg.inv(COUPLING).T
    return drive_evidence(Drive(TIME, duties, joints, turned, COUPLING), NAMES, suspects)


@pytest.mark.parametrize(
    ("duties", "turns"),
    [
        ([0, 0, 0, 0], [0, 0, 0, 0]),
        ([20, -20, 25, 10], [0, 0, 0, -50]),  # held, and let down by a small duty cycle
        ([80, -80, 60, 100], [30, -10, 20, 60]),
    ],
)
def test_motors_that_follow_are_no_evidence(duties, turns):
    """They rest with small duty cycles, and turn with large ones."""
    assert evidence(duties, turns) == []


def test_a_short_brake_is_no_evidence():
    """A fast joint is pushed back while it still moves on."""
    duties = STILL.copy()
    duties[-8:, 0] = -90.0
    assert evidence(duties, [100, 0, 0, 0]) == []


@pytest.mark.parametrize("motor", range(4))
def test_a_motor_that_stands_still_is_found(motor):
    """With a large duty cycle until the end; of two that share joints it is that one."""
    (found,) = evidence(60.0 * np.eye(4)[motor], [0, 0, 0, 0])
    assert found.joints == {motor}
    assert f"the motor of {NAMES[motor]}" in found.text
    assert "does not turn at a duty cycle of +60 %" in found.text
    assert ("which moves roll and pitch" in found.text) is (motor in (1, 2))


def test_a_motor_that_gives_way_turns_against_its_duty_cycle():
    """It falls, or its wires are exchanged."""
    (found,) = evidence([0, 70, 0, 0], [0, -40, 0, 0])
    assert found.joints == {1}
    assert "turns against its duty cycle: by -55.2 deg of the joint, at +70 %" in found.text
    assert "two wires of the motor exchanged" in found.sentence


def test_of_two_that_share_joints_the_first_to_turn_against_its_duty_cycle_is_found():
    """It drags the other one along."""
    duties, turns = STILL.copy(), STILL.copy()
    duties[30:, 1], turns[30:, 1] = 100.0, -125.0
    duties[50:, 2], turns[50:, 2] = -56.0, 125.0
    (found,) = evidence(duties, turns)
    assert (found.joints, found.strength) == ({1}, Strength.CERTAIN)
    assert "turns against its duty cycle" in found.text


@pytest.mark.parametrize(("duties", "joint"), [([0, 60, 60, 0], 1), ([0, -60, 60, 0], 2)])
def test_a_joint_that_is_blocked_is_found_and_not_its_motors(duties, joint):
    """Its controller drives both of them, and neither turns."""
    (found,) = evidence(duties, [0, 0, 0, 0])
    assert found.joints == {joint}
    assert found.text == f"{NAMES[joint]} does not move, although its motors drive it with +60 %"


@pytest.mark.parametrize("pair", [(0, 3), (1, 3), (1, 2)])
def test_exchanged_motors_are_recognized(pair):
    """Each turns by the duty cycle of the other, against its own."""
    one, other = pair
    duties, turns = np.zeros(4), np.zeros(4)
    duties[one], duties[other] = 70.0, -60.0
    turns[one], turns[other] = -30.0, 40.0
    (found,) = evidence(duties, turns)
    assert found.joints == {*pair}
    assert f"the motors of {NAMES[one]} and {NAMES[other]} are swapped" in found.text


@pytest.mark.parametrize("suspects", [(), (1, 3)])
def test_a_joint_that_only_stands_still_is_a_likely_cause_if_it_presses(suspects):
    """With less it carries a load; of what it shares motors with it is the cause."""
    assert evidence([40, 0, 0, 0], [0, 0, 0, 0], suspects) == []
    (pressing,) = evidence([60, 0, 0, 0], [0, 0, 0, 0], suspects)
    assert (pressing.joints, pressing.strength) == ({0}, Strength.LIKELY)
    (own,) = evidence([60, 0, 0, 0], [0, 0, 0, 0], (0,))
    assert (own.joints, own.strength) == ({0}, Strength.CERTAIN)
    (coupled,) = evidence([0, 60, 0, 0], [0, 0, 0, 0], (2,))
    assert coupled.joints == {1}


def test_who_gives_way_first_explains_the_stop_of_another_joint():
    """The other one was pushed later."""
    duties, turns = STILL.copy(), STILL.copy()
    duties[20:, 0], turns[20:, 0] = 60.0, -30.0
    duties[50:, 3], turns[50:, 3] = 90.0, -30.0
    (found,) = evidence(duties, turns, (1,))
    assert found.joints == {0}
    (own,) = evidence(duties, turns, (3,))
    assert own.joints == {3}


def test_a_motor_that_is_pressed_later_is_not_exchanged():
    """By chance it turned with the duty cycle of the first one, and that one with its own."""
    duties, turns = STILL.copy(), STILL.copy()
    duties[20:, 0], turns[20:60, 0] = 70.0, -30.0
    duties[40:, 3], turns[40:60, 3] = -60.0, 40.0
    (found,) = evidence(duties, turns, (0,))
    assert found.joints == {0}


def test_a_single_state_is_no_evidence():
    """It has no speed."""
    assert drive_evidence(Drive(TIME[:1], STILL[:1] + 90.0, STILL[:1], STILL[:1], COUPLING), NAMES) == []


def test_a_motor_that_a_stronger_one_turns_back_is_not_accused():
    """The second motor drives a blocked roll, and with it pitch, against its own motor: pitch goes as both drive it."""
    coupling = np.array([[1.0, 0.0], [-1.625, 1.625]])
    duties = np.outer(TIME > 0.3, [80.0, 100.0])
    joints = np.cumsum(np.outer(TIME > 0.3, [-20.0, 0.0]), axis=0) * 0.01
    drive = Drive(TIME, duties, joints, joints @ coupling.T, coupling)
    (found,) = drive_evidence(drive, ("pitch", "roll"), (0, 1))
    assert found.joints == {1}
    assert found.text == "roll does not move, although its motors drive it with +100 %"
