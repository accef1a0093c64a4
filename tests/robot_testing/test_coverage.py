"""Which joints and sensors the tests of a plan judge, and what no test does."""

from __future__ import annotations

import pytest

from rtf.robot.model import load_robot
from rtf.robot_testing.coverage import coverage, untouched
from rtf.testing.plan import Planner, load_files
from rtf.testing.plugins import shipped_folder

ANY = shipped_folder("suites") / "any"


def checks(robot_name: str, *suites: str, overrides: tuple[tuple[str, str], ...] = ()) -> dict[str, frozenset[str]]:
    """The subjects of each test of some suites for any robot."""
    robot = load_robot(robot_name)
    variables = {"parts": " ".join(robot.parts), "torque_parts": " ".join(robot.parts)}
    loaded = load_files([(ANY / f"{name}.xml", True) for name in suites], variables)
    plan = type(loaded)(Planner(overrides).plan(loaded.suites))
    return {check.test: check.subjects for check in coverage(robot, plan, overrides)}


def test_all_of_the_bench_is_judged():
    """Joints by the tests of joints, its sensors by those of sensors."""
    found = checks("bench", "joints", "torque", "sensors", "battery")
    assert found["JointLimits"] == {"shoulder", "elbow"}
    assert found["BatteryTest"] == {"sensors.battery"}
    assert "PortsFrequency" not in found, "it judges ports"


@pytest.fixture(scope="module")
def icub() -> dict[str, frozenset[str]]:
    """The checks of the iCub."""
    return checks("icub", "joints", "torque", "sensors", "force-torque", "skin")


def test_what_no_test_judges_is_said(icub: dict[str, frozenset[str]]):
    """Joints without physics, and sensors for which the suites have no test."""
    from rtf.robot_testing.coverage import Check

    robot = load_robot("icub")
    missing = untouched(robot, [Check(name, subjects) for name, subjects in icub.items()])
    assert missing[0] == "eyelids"
    assert missing[-2:] == ["sensors.cameras.left", "sensors.cameras.right"]
    assert not set(missing) & set(robot.index)


def test_tests_of_torque_judge_the_joints_that_have_it(icub: dict[str, frozenset[str]]):
    """As robot.toml says."""
    robot = load_robot("icub")
    assert icub["TorqueControlAccuracy"] == {axis.name for axis in robot.axes if axis.torque_control}
    assert icub["JointLimits"] == set(robot.index)


def test_joints_that_are_chosen_by_hand_are_the_only_ones():
    """By their numbers in the part, as the test counts them."""
    assert checks("bench", "joints", overrides=(("joints", "1"),))["JointLimits"] == {"elbow"}
