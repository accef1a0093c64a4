"""The table of requests and its values: rows name existing methods, and values survive encoding and decoding."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtf.bottle import Bottle, Vocab
from rtf.bottle.binary import decode, encode
from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import CalibrationParameters, JointType, MotorTorqueParameters, Pid, PidType
from rtf.robot.network.streamed_commands import STREAMED
from rtf.robot.yarp3 import values as kinds
from rtf.robot.yarp3.table import COMMANDS, FAMILIES, TOPICS

NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
WHOLE = st.integers(-(2**31), 2**31 - 1)
#: Kinds, the values of a device, and the decoded values.
SAME = (
    (kinds.FLOAT, NUMBERS),
    (kinds.INT, WHOLE),
    (kinds.FLAG, st.booleans()),
    (kinds.TEXT, st.text(st.characters(codec="utf-8", exclude_characters="\0"))),
    (kinds.MODE, st.sampled_from(ControlMode)),
    (kinds.INTERACTION_MODE, st.sampled_from(InteractionMode)),
    (kinds.PID_TYPE, st.sampled_from(PidType)),
    (kinds.JOINT_TYPE, st.sampled_from(JointType)),
    (kinds.PID, st.builds(Pid, *[NUMBERS] * 10)),
    (kinds.PIDS, st.lists(st.builds(Pid, *[NUMBERS] * 10), max_size=3).map(tuple)),
    (kinds.MOTOR_TORQUE, st.builds(MotorTorqueParameters, *[NUMBERS] * 9)),
    (kinds.CALIBRATION, st.builds(CalibrationParameters, WHOLE, *[NUMBERS] * 6)),
    (kinds.IMPEDANCE_OFFSET, NUMBERS),
    (kinds.NAMES, st.lists(st.sampled_from(["a", "kinematic_mj"])).map(tuple)),
)
SEVERAL = (
    (kinds.RANGE, st.tuples(NUMBERS, NUMBERS)),
    (kinds.IMPEDANCE, st.tuples(NUMBERS, NUMBERS)),
    (kinds.IMPEDANCE_LIMITS, st.tuples(*[NUMBERS] * 4)),
    (kinds.FAULT, st.tuples(WHOLE, st.text(max_size=5, alphabet="abc "))),
)
KINDS = [(kind, values, False) for kind, values in SAME] + [(kind, values, True) for kind, values in SEVERAL]


@pytest.mark.parametrize(("kind", "values", "several"), KINDS)
@given(data=st.data())
def test_values_travel(kind: kinds.Kind, values: st.SearchStrategy, several: bool, data: st.DataObject):
    """A value is the same after encoding and decoding."""
    value = data.draw(values)
    elements = decode(encode(Bottle(kind.write(value))))
    assert kind.read(elements) == (value if several else (value,))


@settings(max_examples=200)
@given(elements=st.lists(st.one_of(st.floats(), WHOLE, st.text(max_size=4), WHOLE.map(Vocab)), max_size=12))
def test_anything_else_is_refused(elements: list[object]):
    """Decoding gives a value with finite numbers, or raises RefusedError."""
    for kind, _, _ in KINDS:
        try:
            read = kind.read(Bottle(elements))
        except RefusedError:
            continue
        assert not any(isinstance(value, float) and not math.isfinite(value) for value in read), kind


@pytest.mark.parametrize("value", ["1", Vocab("pos"), Bottle([1]), b"1", math.nan, math.inf, None])
def test_only_numbers_are_numbers(value: object):
    """A word is refused instead of being 0, as in YARP, because the values move robots."""
    with pytest.raises(RefusedError):
        kinds.number(value)
    with pytest.raises(RefusedError):
        kinds.whole(value)


def test_whole_numbers_may_be_typed_as_floats():
    """``3.0`` is a joint; ``3.5`` and numbers beyond 32 bits are refused."""
    assert kinds.whole(3.0) == 3
    for wrong in (3.5, 2**31, -(2**40), 1e300):
        with pytest.raises(RefusedError):
            kinds.whole(wrong)


def test_rows_name_methods_of_their_interfaces():
    """Each row names an existing method of its interface."""
    for topic in (*TOPICS.values(), *COMMANDS.values()):
        for method in (topic.get, topic.set):
            assert not method or callable(getattr(topic.interface, method)), topic.words
        assert topic.get or topic.set
    for command in STREAMED.values():
        assert callable(getattr(command.interface, command.method))


def test_every_family_has_topics():
    """Families and topics belong together: no family is missing or unused."""
    assert {topic.words[0] if len(topic.words) > 1 else "" for topic in TOPICS.values()} == set(FAMILIES)
