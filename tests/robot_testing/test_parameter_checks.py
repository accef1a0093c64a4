"""Parameters of robot tests that are looked at before there is a robot."""

import pytest

from rtf.robot_testing.joints_test import JointsTest
from rtf.testing import Parameter
from rtf.testing.parameters import ParameterError


class Swings(JointsTest):
    """A test with lists for its joints, and one that is something else."""

    not_per_joint = ("matrix",)

    low = Parameter(list[float], "lower ends", unit="deg", default=[], key="min")
    high = Parameter(list[float], "upper ends", unit="deg", default=[], key="max")
    speed = Parameter(list[float], "speeds", unit="deg/s", default=[20.0])
    matrix = Parameter(list[float], "anything", default=[])


def given(**values: str) -> Swings:
    """The test with some values."""
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
def test_one_value_or_one_for_each_joint_is_right(values):
    """So are none, other lists, and faults that there are."""
    assert given(**values).parameter_warnings == ()


def test_all_that_is_wrong_is_told_at_once():
    """A line for each list, and for each number of a fault; with the place."""
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
    ("text", "told"),
    [
        ("jamm l_elbow", "there is no fault 'jamm'"),
        ("jam", "no joint ''; its joints are neck_pitch, "),
        ("jam l_elbow torque", "'torque' is not of the form name=number"),
        ("jam l_elbow torque=nan", "torque is from 0"),
    ],
)
def test_a_fault_that_cannot_be_is_refused(text, told):
    """Its kind, its joint and its numbers are those that the simulator would take."""
    with pytest.raises(ParameterError, match=told):
        given(inject=text)


def test_ends_that_are_swapped_are_told_of():
    """They are taken, for files of old have such; a joint whose ends are the same does not move."""
    swapped, same = given(joints="(0 1 2)", min="(0 5 5)", max="(9 -5 5)").parameter_warnings
    assert swapped == "max: element 1 is -5, below that of min, 5: the joint moves to its lower end first (<parameter>)"
    assert same == "max: element 2 is 5, equal to that of min: the joint does not move (<parameter>)"
