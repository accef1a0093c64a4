"""The rotation between two series of vectors, with its confidence."""

import math
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest

from rtf.robot_testing.judging.kinematics import rotation_of
from rtf.robot_testing.judging.orientations import sure_turn
from rtf.testing.verdict import TestFailure

from ..kept_test import kept_test

_RUNS = 300


def noisy(random, wanted, turn=0.0):
    """Return vectors of a sensor that is rotated about its z axis by these degrees."""
    return wanted @ rotation_of(0.0, 0.0, math.radians(turn)) + random.normal(0.0, 0.2, wanted.shape)


def test_a_rotation_is_within_its_interval():
    """Angle and axis are reported, with an interval of 99 %."""
    random = np.random.default_rng(3)
    wanted = random.normal(size=(30, 3)) * (3.0, 2.0, 1.0)
    turns = [sure_turn(noisy(random, wanted, 10.0), wanted) for _ in range(_RUNS)]
    assert np.mean([abs(turn.angle - 10.0) <= turn.interval for turn in turns]) > 0.98
    assert np.median([turn.interval for turn in turns]) < 7.0
    assert np.mean([turn.axis for turn in turns], axis=0) == pytest.approx([0.0, 0.0, 1.0], abs=0.05)


def test_vectors_of_one_direction_show_no_rotation_about_it():
    """Nor do too few vectors, or vectors without a common rotation."""
    random = np.random.default_rng(4)
    upright = np.tile([0.0, 0.0, 9.81], (30, 1))
    assert math.isinf(sure_turn(upright, upright).interval)
    assert math.isinf(sure_turn(np.eye(3), np.eye(3)).interval)
    wanted = random.normal(size=(30, 3))
    frozen = sure_turn(np.tile([0.01, 0.0, 0.0], (30, 1)), wanted - wanted.mean(axis=0))
    assert frozen.interval > 180.0


class Measured(NamedTuple):
    """The measurements of a unit without an accelerometer."""

    times: np.ndarray
    expected: np.ndarray
    orientations: np.ndarray
    speeds: np.ndarray
    accelerations: None = None


def test_measurements_that_are_not_finite_fail_their_unit():
    """They are counted, and the failure has likely causes."""
    felt = Measured(np.arange(30.0), *np.ones((2, 30, 3, 3)), np.ones((30, 3)))
    test, unit = kept_test("Imu"), SimpleNamespace(name="head_imu_0")
    test._require_numbers(unit, felt)
    felt.speeds[7:9, 1] = math.nan
    with pytest.raises(TestFailure, match=r"^2 of 30 measurements of head_imu_0 are not finite; likely: "):
        test._require_numbers(unit, felt)
