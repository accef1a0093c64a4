"""Checks of the parameters of robot tests before a robot is used."""

from pathlib import Path

import pytest

from rtf.robot_testing.joints_test import JointsTest
from rtf.testing import Parameter
from rtf.testing.parameters import ParameterError


class Swings(JointsTest):
    """A test with lists for its joints, and one other list."""

    not_per_joint = ("matrix",)

    low = Parameter(list[float], "lower ends", unit="deg", default=[], key="min")
    high = Parameter(list[float], "upper ends", unit="deg", default=[], key="max")
    speed = Parameter(list[float], "speeds", unit="deg/s", default=[20.0])
    matrix = Parameter(list[float], "anything", default=[])


def given(**values: str) -> Swings:
    """Return the test with these values."""
    test = Swings()
    test.resolve_parameters(param="", parameters=[*values.items()])
    return test


@pytest.mark.parametrize(
    "values",
    [
        {},
        {"speed": "5"},
        {"speed": "(1 2 3)"},
        {"joints": "(0 4)", "speed": "5", "home": "(1 2)"},
        {"joints": "(0 4)", "matrix": "(1 2 3 4)"},
        {"min": "(1 1)", "max": "5", "speed": "(2 3)"},
        {"inject": "jam l_elbow torque=400 delay=0.5"},
        {"inject": "fault_left neck_yaw duration=2"},
        {"inject": "latency /icubSim/head/state:o"},
    ],
)
def test_one_value_or_one_for_each_joint_is_accepted(values):
    """So are empty lists, other lists, and existing faults."""
    assert given(**values).parameter_warnings == ()


def test_all_errors_are_reported_at_once():
    """One line for each list and each number of a fault, with its place."""
    with pytest.raises(ParameterError) as caught:
        given(joints="(0 1 2)", speed="(1 2)", home="(1 2 3 4)", inject="jam l_elbow torque=-1 force=3")
    assert len(caught.value.problems) == 4
    for problem, part in zip(
        caught.value.problems,
        ["home has 4", "speed has 2", "torque is from 0 to 100000 Nm, not -1", "no parameter force"],
        strict=True,
    ):
        assert part in problem
        assert problem.endswith("(<parameter>)")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("jamm l_elbow", "there is no fault 'jamm'"),
        ("jam", "no joint ''; its joints are neck_pitch, "),
        ("jam l_elbow torque", "'torque' is not of the form name=number"),
        ("jam l_elbow torque=nan", "torque is from 0"),
    ],
)
def test_an_invalid_fault_is_refused(text, message):
    """Its kind, its joint and its numbers have to be those of the simulator."""
    with pytest.raises(ParameterError, match=message):
        given(inject=text)


def test_swapped_ends_are_reported():
    """They are accepted, as old files have them; with equal ends the joint does not move."""
    swapped, same = given(joints="(0 1 2)", min="(0 5 5)", max="(9 -5 5)").parameter_warnings
    assert swapped == "max: element 1 is -5, below that of min, 5: the joint moves to its lower end first (<parameter>)"
    assert same == "max: element 2 is 5, equal to that of min: the joint does not move (<parameter>)"


def test_surplus_values_of_a_file_are_ignored(tmp_path: Path):
    """Files of the C++ tests have them; a warning says so, and too few values are an error all the same."""
    (tmp_path / "arm.ini").write_text("joints (0 1)\nhome (1 2 3)\nspeed (5)\nmatrix (1 2 3 4)\n", encoding="utf-8")
    test = Swings()
    test.resolve_parameters(param="--from arm.ini", folder=str(tmp_path))
    assert test.home == [1.0, 2.0]
    assert test.matrix == [1.0, 2.0, 3.0, 4.0]
    (warning,) = test.parameter_warnings
    assert warning.startswith("home has 3 values for 2 joints; those at its end are ignored (")
    assert warning.endswith("arm.ini:2)")
    (tmp_path / "arm.ini").write_text("joints (0 1 2)\nhome (1 2)\n", encoding="utf-8")
    with pytest.raises(ParameterError, match="home has 2 values"):
        Swings().resolve_parameters(param="--from arm.ini", folder=str(tmp_path))
