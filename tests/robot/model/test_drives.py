"""The electrical side of motors: what robot.toml says, and what follows from a joint."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot.model import load_robot
from rtf.robot.model.drives import drive_of
from rtf.robot.model.file import Motor

PEAK = 4.0
SIZES = st.floats(0.01, 1000.0)


def motor(**values: object) -> Motor:
    """A type of motor."""
    return Motor(rotor_resolution=4096, nominal_current=2.0, peak_current=PEAK, overload_current=12.0, **values)


@given(torque=SIZES, speed=SIZES, gearbox=SIZES, prismatic=st.booleans())
def test_what_is_not_said_follows_from_the_joint(torque: float, speed: float, gearbox: float, *, prismatic: bool):
    """The peak current gives the torque, at rest the supply drives it, and without load it turns twice as fast."""
    drive = drive_of(motor(), torque=torque, speed=speed, gearbox=-gearbox, prismatic=prismatic)
    fastest = speed if prismatic else math.radians(speed)
    assert drive.output_constant * PEAK == pytest.approx(-torque)
    assert drive.supply / drive.resistance == pytest.approx(PEAK)
    assert drive.supply / abs(drive.output_constant) == pytest.approx(2.0 * fastest)
    assert drive.assumed


def test_what_a_data_sheet_says_counts():
    """Supply, torque constant and resistance, and the noise of the sensor as a share of the peak current."""
    given = motor(drive="voltage", supply=24.0, torque_constant=0.05, resistance=1.5, current_noise=0.01)
    drive = drive_of(given, torque=10.0, speed=90.0, gearbox=100.0, prismatic=False)
    assert (drive.kind, drive.supply, drive.resistance, drive.current_noise) == ("voltage", 24.0, 1.5, 0.04)
    assert drive.output_constant == pytest.approx(5.0)
    assert not drive.assumed


def test_a_slide_turns_its_motor_by_metres():
    """The gear has turns a metre, and a turn is 2 pi."""
    drive = drive_of(motor(), torque=200.0, speed=0.2, gearbox=500.0, prismatic=True)
    assert drive.turns == pytest.approx(2.0 * math.pi * 500.0)


def test_the_motors_of_the_icub():
    """Limbs control currents at 40 V; neck, wrists, eyes and hands get up to 12 V. The motors of the eyes are alike."""
    robot = load_robot("icub")
    kinds = {axis.name: (axis.drive.kind, axis.drive.supply) for axis in robot.axes}
    assert kinds["l_elbow"] == kinds["r_knee"] == kinds["torso_yaw"] == ("current", 40.0)
    assert kinds["neck_pitch"] == kinds["r_wrist_yaw"] == kinds["eyes_tilt"] == kinds["l_pinky"] == ("voltage", 12.0)
    right, left = robot.axis("eyes_version").drive, robot.axis("eyes_vergence").drive
    assert right.output_constant == pytest.approx(left.output_constant)
    assert robot.axis("r_elbow").drive.output_constant < 0 < robot.axis("l_elbow").drive.output_constant
