"""Which of several motors that joints share gives another torque than its current says."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot_testing.judging.torque_agreement import Group, torque_evidence

NAMES = ("elbow", "pitch", "roll", "yaw")
#: The motors of a shoulder: the first moves its joint only, the second two joints, the third one all.
SHOULDER = np.array([[1.0, 0.0, 0.0], [-1.6, 1.6, 0.0], [-1.6, 1.6, 1.6]])
FRICTION = np.full(3, 0.5)


def evidence(given_torques, measured, friction=FRICTION):
    """What is found for the shoulder, whose joints are 1 to 3 of the part."""
    return torque_evidence(Group((1, 2, 3), np.asarray(given_torques), measured, friction, SHOULDER), NAMES)


torques = st.lists(st.floats(-20.0, 20.0), min_size=3, max_size=3).map(np.array)
share = st.floats(-1.0, 0.5)


@given(torques, share, st.sampled_from([1, 2]))
def test_a_weak_motor_is_found_by_its_joints(by_current, share, motor):
    """Whatever it gives, with a wrong sign, too; not while it is hardly loaded."""
    real = by_current.copy()
    real[motor] *= share
    found = evidence(by_current, real @ SHOULDER)
    assert all(one.joints == {motor + 1} for one in found)
    assert bool(found) or abs(by_current[motor]) * (1.0 - share - 0.3) <= 1.0


def test_the_message_has_both_torques():
    """By its current, and by the sensors of the joints."""
    (found,) = evidence([0.0, 0.0, 10.0], np.array([0.0, 0.0, 2.0]) @ SHOULDER)
    assert found.text == "the motor of yaw gives +2.00 Nm, and +10.00 Nm by its current"


@given(torques, share, st.sampled_from([0, 1, 2]))
def test_a_wrong_sensor_is_no_motor(by_current, share, joint):
    """One joint measures another torque: no motor causes that alone."""
    measured = by_current @ SHOULDER
    measured[joint] *= share
    assert not evidence(by_current, measured)


@given(torques, st.lists(st.floats(-0.5, 0.5), min_size=3, max_size=3).map(np.array))
def test_friction_is_no_motor(by_current, hidden):
    """What friction hides is not told from a motor."""
    assert not evidence(by_current, by_current @ SHOULDER + hidden)


@given(torques, st.lists(st.floats(0.92, 1.08), min_size=3, max_size=3).map(np.array))
def test_motors_of_a_population_are_healthy(by_current, constants):
    """Torque constants differ by 8 %."""
    assert not evidence(by_current, (constants * by_current) @ SHOULDER)


@pytest.mark.parametrize("broken", [np.nan, np.inf])
def test_what_is_not_known_is_no_evidence(broken):
    """A torque that is not measured, or a joint whose greatest torque its board does not say."""
    measured = np.array([0.0, 2.0, 0.0]) @ SHOULDER
    assert evidence([0.0, 10.0, 0.0], measured)
    assert not evidence([0.0, 10.0, 0.0], np.array([broken, *measured[1:]]))
    assert not evidence([0.0, 10.0, 0.0], measured, np.full(3, np.inf))


def test_two_weak_motors_are_not_reported_as_one():
    """Neither explains the other's share."""
    assert not evidence([0.0, 10.0, 10.0], np.array([0.0, 2.0, 2.0]) @ SHOULDER)
