"""The encoding: the bytes of cyclonedds' own encoder, in both byte orders; what is malformed is refused."""

# Types of fields are read at run time, so annotations are not postponed.

import struct
from dataclasses import dataclass, field

import pytest
from cyclonedds.idl import IdlStruct
from cyclonedds.idl._support import Endianness
from cyclonedds.idl.types import array, bounded_str, float64, int16, sequence, uint8, uint64
from hypothesis import given
from hypothesis import strategies as st

from rtf.ros2.cdr import Message
from rtf.ros2.errors import MalformedMessageError
from rtf.ros2.messages import Header, Image, JointState, String, Time

TEXTS = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=6)


@dataclass
class Inner(Message, typename="test.Inner"):
    """A field of a field."""

    small: int16 = 0
    text: str = ""


@dataclass
class All(Message, typename="test.All"):
    """Every kind of field, in an order that needs padding."""

    flag: bool = False
    large: uint64 = 0
    letters: bounded_str[8] = ""
    inner: Inner = field(default_factory=Inner)
    some: sequence[Inner] = field(default_factory=list)
    words: sequence[str] = field(default_factory=list)
    numbers: sequence[float64] = field(default_factory=list)
    flags: sequence[bool] = field(default_factory=list)
    three: array[float64, 3] = field(default_factory=lambda: [0.0] * 3)
    last: uint8 = 0


INNER = st.builds(Inner, st.integers(-(2**15), 2**15 - 1), TEXTS)
ALL = st.builds(
    All,
    st.booleans(),
    st.integers(0, 2**64 - 1),
    st.text("abc", max_size=8),
    INNER,
    st.lists(INNER, max_size=3),
    st.lists(TEXTS, max_size=3),
    st.lists(st.floats(allow_nan=False), max_size=4),
    st.lists(st.booleans(), max_size=3),
    st.lists(st.floats(allow_nan=False), min_size=3, max_size=3),
    st.integers(0, 255),
)


@given(message=ALL)
def test_bytes_are_those_of_cyclonedds(message: All):
    """What is written here is what its encoder writes, and what it writes is read, in both byte orders."""
    theirs = IdlStruct.serialize(message, use_version_2=False)
    assert message.serialize(use_version_2=False) == theirs
    assert All.deserialize(theirs) == message
    swapped = IdlStruct.serialize(message, endianness=Endianness.Big, use_version_2=False)
    assert swapped[:2] == b"\0\0"
    assert All.deserialize(swapped) == message


@given(data=st.binary(max_size=80), order=st.sampled_from([b"\0\0\0\0", b"\0\1\0\0"]))
def test_any_bytes_are_a_message_or_malformed(data: bytes, order: bytes):
    """Nothing else is raised, and nothing is longer than what was sent."""
    for kind in (All, JointState, Image, String):
        try:
            got = kind.deserialize(order + data)
        except MalformedMessageError:
            continue
        assert len(repr(got)) < 100 + 60 * len(data) + 400


@given(message=ALL, cut=st.integers(1, 40))
def test_half_messages_are_malformed(message: All, cut: int):
    """Every field is needed."""
    whole = message.serialize()
    with pytest.raises(MalformedMessageError):
        All.deserialize(whole[: max(4, len(whole) - cut)])


def test_a_length_is_bounded_by_the_message():
    """One of four billion elements takes no memory."""
    for kind, head in ((String, b""), (Image, bytes(12) + b"\1\0\0\0\0" + bytes(3))):
        with pytest.raises(MalformedMessageError, match="cannot be read"):
            kind.deserialize(b"\0\1\0\0" + head + struct.pack("<I", 2**32 - 1) + b"abcd")


def test_what_cannot_be_sent_is_reported():
    """With the class; the text is that of the field's error."""
    for message in (
        Time(2**40),
        Time("a"),
        String(5),
        JointState(position=["x"]),
        All(three=[1.0]),
        All(letters="x" * 9),
    ):  # type: ignore[arg-type]
        with pytest.raises(MalformedMessageError, match=f"{type(message).__name__} has a value that cannot be sent"):
            message.serialize()
    with pytest.raises(MalformedMessageError, match="the encoding 0006 is not CDR"):
        Header.deserialize(b"\0\6\0\0")


def test_pixels_are_bytes():
    """They may be given as a list, too."""
    for data in (b"abc", [97, 98, 99]):
        assert Image.deserialize(Image(data=data).serialize()).data == b"abc"
