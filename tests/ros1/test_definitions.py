"""Definitions: what is read, where an error is, and what a hostile text cannot do."""

from __future__ import annotations

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.ros1.definitions import ANY_LENGTH, Constant, read_full_text, read_message, read_service
from rtf.ros1.errors import DefinitionError


def test_fields_and_constants_are_read_as_ros_does():
    """Comments end at the line, except in a string; types without a package are of the same, and Header is known."""
    text = """\
# A thing.
Header header   # when
uint8 MODE = 3  # a mode
string GREETING=  hello # this too
float32 RATE=1.50
bool ON=True
int32[] list
Other[2] others
geometry_msgs/Point point
"""
    found = read_message(text, "lab/Thing")
    assert [(one.written, one.name) for one in found.fields] == [
        ("std_msgs/Header", "header"),
        ("int32[]", "list"),
        ("lab/Other[2]", "others"),
        ("geometry_msgs/Point", "point"),
    ]
    assert found.fields[1].length == ANY_LENGTH
    assert found.constants == [
        Constant("uint8", "MODE", "3", 3),
        Constant("string", "GREETING", "hello # this too", "hello # this too"),
        Constant("float32", "RATE", "1.50", 1.5),
        Constant("bool", "ON", "True", True),
    ]
    assert found.needs == ["std_msgs/Header", "lab/Other", "geometry_msgs/Point"]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("int32 a\n  int32[3]x\n", r"thing.msg:2:3: 'int32\[3\]x' is neither"),
        ("float64 2x", "thing.msg:1:1: 'float64 2x' is neither"),
        ("int32 a\n\nint32 a", "thing.msg:3: a is there twice"),
        ("uint8 A=256", "thing.msg:1:1: '256' is no uint8"),
        ("int32 A=0x10", "'0x10' is no int32"),
        ("bool A=yes", "'yes' is no bool"),
        ("time A=3", "a constant is a number or a string, not time"),
        ("string 1A=3", "'1A' is no name"),
        ("a/b/c d", "'a/b/c' is no type"),
        ("int8[9999999] a", "an array of 9999999; at most 1000000"),
        ("int8[" + "9" * 5000 + "] a", "an array of 99999999999999999999; at most"),
        ("# " + "x" * (1 << 20), "characters; at most"),
        ("\n" * 20_000, "20001 lines; at most"),
    ],
)
def test_what_is_wrong_has_a_place(text: str, complaint: str):
    """File, line and column, as a compiler says it."""
    with pytest.raises(DefinitionError, match=complaint):
        read_message(text, "lab/Thing", "thing.msg")


def test_a_service_has_two_parts():
    """Its lines are counted through the file."""
    request, response = read_service("int32 a\n---\nint32 b\n", "lab/Add")
    assert (request.name, response.name) == ("lab/AddRequest", "lab/AddResponse")
    assert [one.name for one in (*request.fields, *response.fields)] == ["a", "b"]
    with pytest.raises(DefinitionError, match=r"add\.srv:3:1: 'nonsense' is neither"):
        read_service("int32 a\n---\nnonsense\n", "lab/Add", "add.srv")
    for wrong in ("int32 a\n", "---\n---\n"):
        with pytest.raises(DefinitionError, match="one line '---'"):
            read_service(wrong, "lab/Add")


def test_a_full_text_has_all_types():
    """As nodes send it."""
    rule = "=" * 80
    found = read_full_text(f"Inner a\n{rule}\nMSG: lab/Inner\nint8 b\n", "lab/Outer")
    assert [(one.name, one.fields[0].name) for one in found] == [("lab/Outer", "a"), ("lab/Inner", "b")]


@given(st.text(max_size=200) | st.text("int8 []=#/\n3aB_-.", max_size=80))
@pytest.mark.fuzz
def test_any_text_is_a_definition_or_an_error(text: str):
    """It raises nothing else."""
    for read in (read_message, read_service, read_full_text):
        with suppress(DefinitionError):
            read(text, "lab/Thing")
