"""Descriptions of robots: what is read of a URDF, and what is refused; and times of robots."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot.interfaces import JointType
from rtf.ros2.description import DescribedJoint, make_description, read_joints
from rtf.ros2.errors import DescriptionError
from rtf.ros2.stamps import StampMapping

URDF = """<robot name="r"><link name="a"/>
<joint name="elbow" type="revolute"><limit lower="-1" upper="2" velocity="3" effort="4"/></joint>
<joint name="wheel" type="continuous"/>
<joint name="lift" type="prismatic"><limit lower="0" upper="0.5" effort="0" velocity="0.1"/></joint>
<joint name="finger" type="revolute"><mimic joint="elbow"/><limit lower="0" upper="1"/></joint>
<joint name="bolt" type="fixed"/></robot>"""


def test_joints_that_move_by_themselves_are_read():
    """With what the description says of them."""
    assert read_joints(URDF) == {
        "elbow": DescribedJoint("elbow", JointType.REVOLUTE, (-1.0, 2.0), 3.0, 4.0),
        "wheel": DescribedJoint("wheel", JointType.REVOLUTE, None, None, None),
        "lift": DescribedJoint("lift", JointType.PRISMATIC, (0.0, 0.5), 0.1, None),
    }


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "is no XML"),
        ("<robot>", "is no XML"),
        ("<mujoco/>", "is no URDF: its root is <mujoco>"),
        ('<robot><joint name="a" type="revolute"/></robot>', "line 1: a has no range"),
        ('<robot><joint name="a" type="revolute"><limit lower="x"/></joint></robot>', "line 1: lower='x' is no number"),
        ('<robot>\n<joint name="a" type="revolute"><limit lower="nan"/></joint></robot>', "line 2: lower='nan'"),
        ('<!DOCTYPE r [<!ENTITY e SYSTEM "file:///etc/passwd">]><robot name="&e;"/>', "is no XML"),
    ],
)
def test_what_is_no_description_is_reported(text: str, complaint: str):
    """With its line; files of this machine are not read."""
    with pytest.raises(DescriptionError, match=complaint):
        read_joints(text)


@given(st.text(max_size=60))
def test_any_text_is_a_description_or_none(text: str):
    """Nothing else is raised."""
    for whole in (text, f"<robot>{text}</robot>", f'<robot><joint type="revolute" name="{text}"/></robot>'):
        try:
            read_joints(whole)
        except DescriptionError:
            continue


NUMBERS = st.floats(0.001, 1e3)
JOINTS = st.builds(
    DescribedJoint,
    st.text("abc_", min_size=1, max_size=5),
    st.sampled_from([JointType.REVOLUTE, JointType.PRISMATIC]),
    st.tuples(st.floats(-1e3, 0.0), NUMBERS),
    NUMBERS | st.none(),
    NUMBERS | st.none(),
)


@given(st.lists(JOINTS, max_size=4, unique_by=lambda joint: joint.name))
def test_what_is_described_is_read(joints: list[DescribedJoint]):
    """To the last digit."""
    assert read_joints(make_description("robot", joints)) == {joint.name: joint for joint in joints}


DELAYS = st.lists(st.floats(0.0, 0.2), min_size=2, max_size=100)


@given(DELAYS, st.floats(0.5, 1e6).flatmap(lambda offset: st.sampled_from([-offset, offset])))
def test_intervals_are_those_of_the_robot(delays: list[float], offset: float):
    """A robot with another clock: no time is later than the arrival, nor more than its delay earlier."""
    mapping, times = StampMapping(), []
    begin = 1e6
    for number, delay in enumerate(delays):
        sent = begin + 0.01 * number
        got = mapping.time_of(sent + offset, sent + delay)
        assert sent - 1e-6 <= got <= sent + delay
        times.append(got - sent)
    assert times[-1] == pytest.approx(min(delays), abs=1e-6)


def test_the_times_of_a_shared_clock_are_kept():
    """Delays are seen."""
    mapping = StampMapping()
    assert [mapping.time_of(stamp, stamp + 0.02) for stamp in (5.0, 5.01)] == [5.0, 5.01]


def test_a_new_simulation_begins_anew():
    """Its stamps jump back."""
    mapping = StampMapping()
    mapping.time_of(500.0, 1000.0)
    assert mapping.time_of(0.5, 1010.0) == 1010.0
    assert mapping.time_of(1.5, 1011.1) == pytest.approx(1011.0)


def test_clocks_may_drift():
    """An old difference is forgotten after two windows."""
    mapping = StampMapping()
    found = math.nan
    for number in range(6000):
        sent = 100.0 + 0.01 * number
        found = mapping.time_of(sent * (1 - 1e-3), sent + 50.0) - (sent + 50.0)
    assert -0.025 < found <= 0.0
