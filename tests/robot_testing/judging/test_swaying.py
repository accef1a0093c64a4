"""Which joint shakes its part."""

import numpy as np
import pytest

from rtf.robot_testing.judging.blame import Strength
from rtf.robot_testing.judging.drive_agreement import Drive
from rtf.robot_testing.judging.swaying import moved_farthest, swaying_evidence

NAMES = ("shoulder", "elbow", "wrist")
TIME = np.arange(0.0, 2.0, 0.01)
RATE = 8.0  # Hz


def evidence(ways, duties, speeds=(0.0, 0.0, 0.0)):
    """What is found for joints that sway by ``ways`` (deg, end to end) with duty cycles to ± ``duties`` (%)."""
    swing = np.sin(2 * np.pi * RATE * TIME)
    joints = np.outer(swing, ways) / 2.0 + np.outer(TIME, speeds)
    return swaying_evidence(Drive(TIME, -np.outer(swing, duties), joints, joints, np.eye(3)), NAMES)


def test_the_joint_that_sways_farthest_is_named():
    """The others work against it, with more duty cycle even, while they hold their places."""
    (found,) = evidence([4.0, 0.2, 1.1], [90.0, 10.0, 100.0])
    assert (found.joints, found.strength) == ({0}, Strength.LIKELY)
    assert found.text.startswith("shoulder sways by 4.")
    assert "with -90 to +90 %" in found.text
    assert "gains that are too large" in found.sentence


def test_a_joint_that_is_commanded_to_move_has_not_swayed_by_that():
    """Its straight motion is longer than the way of the one that shakes."""
    (found,) = evidence([0.2, 0.1, 2.0], [60.0, 0.0, 80.0], speeds=[20.0, 0.0, 0.0])
    assert found.joints == {2}


@pytest.mark.parametrize(
    ("ways", "duties"),
    [
        ([3.0, 0.1, 2.5], [80.0, 10.0, 80.0]),  # two of them: either may shake the other
        ([0.5, 0.0, 0.1], [80.0, 0.0, 80.0]),  # it hardly moves
        ([5.0, 0.1, 0.1], [20.0, 5.0, 5.0]),  # nothing drives it
    ],
)
def test_without_a_clear_case_nothing_is_said(ways, duties):
    """Another kind of evidence has to decide."""
    assert evidence(ways, duties) == []


def apart(differences, duty=50.0):
    """What is found for joints whose encoders are apart from those of their motors by so much, end to end (deg)."""
    swing = np.sin(2 * np.pi * RATE * TIME)
    joints = np.outer(swing, [2.0, 2.0, 2.0])
    turns = joints - np.outer(swing, differences) / 2.0
    return swaying_evidence(Drive(TIME, np.full((TIME.size, 3), duty), joints, turns, np.eye(3)), NAMES)


def test_the_joint_whose_encoders_are_apart_is_named():
    """Its gear yields or has play, or one of them is late; how far the joints sway does not matter then."""
    (found,) = apart([0.1, 2.0, 0.3])
    assert (found.joints, found.strength) == ({1}, Strength.LIKELY)
    assert found.text == "the encoders of elbow and of its motor were apart by up to 2.0 deg"
    assert "play in the gearbox" in found.sentence


@pytest.mark.parametrize(
    ("differences", "duty"),
    [
        ([0.1, 0.9, 0.1], 50.0),  # as gears yield
        ([0.1, 2.0, 0.6], 50.0),  # so are others
        ([0.1, 2.0, 0.1], 20.0),  # nothing drives them hard
        ([0.1, np.nan, 0.1], 50.0),  # it shows nothing
    ],
)
def test_encoders_that_are_not_clearly_apart_say_nothing(differences, duty):
    """Another kind of evidence has to decide."""
    assert apart(differences, duty) == []


def test_a_motion_that_starts_and_brakes_is_no_swaying():
    """Its duty cycle changes its sign once."""
    duties = np.zeros((TIME.size, 3))
    duties[150:175, 0], duties[175:, 0] = 80.0, -80.0
    joints = np.cumsum(np.cumsum(duties, axis=0), axis=0) * 1e-4
    assert swaying_evidence(Drive(TIME, duties, joints, joints, np.eye(3)), NAMES) == []


def farthest(ways, held=(0, 2), joint=1, **changed):
    """Which joint that is only held moved farther than the elbow, after a step; all go to and fro by ``ways`` (deg)."""
    positions = np.outer(np.sin(2 * np.pi * RATE * TIME), ways) / 2.0
    for column, values in changed.items():
        positions[:, int(column[1:])] += values
    return moved_farthest(TIME, positions, joint, held)


def test_a_joint_that_moves_while_it_is_held_disturbs_the_one_at_rest():
    """Where several do, the one that moves farthest."""
    assert farthest([0.4, 0.15, 0.2]) == (0, pytest.approx(0.4, rel=0.05))
    assert farthest([0.2, 0.15, 0.4]) == (2, pytest.approx(0.4, rel=0.05))


@pytest.mark.parametrize(
    ("ways", "held", "changed"),
    [
        ([0.08, 0.02, 0.0], (0, 2), {}),  # as any joint gives way
        ([0.4, 0.5, 0.3], (0, 2), {}),  # the one that should rest shakes them
        ([0.4, 0.15, 0.0], (2,), {}),  # it is moved by the test
        ([0.0, 0.15, 0.0], (0, 2), {"c0": TIME}),  # it sinks
        ([0.4, 0.15, 0.0], (0, 2), {"c0": np.nan}),  # nothing is known of it
    ],
)
def test_no_other_joint_disturbs(ways, held, changed):
    """A joint that is not held, or moves less, explains nothing."""
    assert farthest(ways, held, **changed) is None
