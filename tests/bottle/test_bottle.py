"""The bottle: a list of values, and looking up keys in it."""

from __future__ import annotations

import enum
import subprocess
import sys

import numpy as np
import pytest

from rtf.bottle import (
    FALSE,
    MAX_DEPTH,
    TRUE,
    Bottle,
    BottleError,
    BottleLimitError,
    BottleTypeError,
    Float32,
    Int8,
    Int16,
    Int64,
    Kind,
    Property,
    Value,
    Vocab,
    Vocab64,
    kind_of,
    same,
)


class Color(enum.IntEnum):
    """An enumeration of numbers."""

    RED = 3


@pytest.mark.parametrize(
    ("value", "kind"),
    [
        (5, Kind.INT32),
        (2**31 - 1, Kind.INT32),
        (-(2**31), Kind.INT32),
        (2**31, Kind.INT64),
        (Int64(5), Kind.INT64),
        (Int8(5), Kind.INT8),
        (Int16(5), Kind.INT16),
        (5.0, Kind.FLOAT64),
        (Float32(5), Kind.FLOAT32),
        ("5", Kind.STRING),
        (b"5", Kind.BLOB),
        (Vocab("5"), Kind.VOCAB32),
        (Vocab64("5"), Kind.VOCAB64),
        (Bottle(), Kind.LIST),
        (Property(), Kind.DICT),
    ],
)
def test_every_value_has_a_type(value: Value, kind: Kind):
    """The type on the wire follows from the class, and for plain integers from their size."""
    assert kind_of(value) is kind


@pytest.mark.parametrize(
    ("given", "held"),
    [
        (True, TRUE),
        (False, FALSE),
        (Color.RED, 3),
        ([1, (2, 3)], Bottle([1, Bottle([2, 3])])),
        (bytearray(b"a"), b"a"),
        (np.float64(0.5), 0.5),
        (np.int32(7), 7),
        (np.array([1.0, 2.0]), Bottle([1.0, 2.0])),
    ],
)
def test_python_objects_become_values(given: object, held: Value):
    """Python objects become plain values when they are put in."""
    assert same(Bottle([given])[0], held)


def test_what_is_no_value_is_refused_where_it_is_put_in():
    """An object of another type is refused when it is put in."""
    bottle = Bottle()
    for wrong in (None, 1j, object(), {"a": 1}):
        with pytest.raises(BottleTypeError):
            bottle.append(wrong)
    with pytest.raises(BottleError, match="64 bits"):
        bottle.append(2**63)
    with pytest.raises(BottleTypeError):
        bottle[0:0] = 5
    assert len(bottle) == 0


def test_a_bottle_is_a_list():
    """A bottle has all operations of a list."""
    bottle = Bottle([1, 2, 3])
    bottle.append(4)
    bottle.insert(0, "zero")
    bottle[1:3] = [True]
    bottle += [5.0]
    assert bottle == Bottle(["zero", TRUE, 3, 4, 5.0])
    bottle[0] = [7]
    del bottle[1]
    assert bottle[0] == Bottle([7])
    assert bottle[1:] == Bottle([3, 4, 5.0])
    assert bottle.tail() == Bottle([3, 4, 5.0])
    assert bottle.pop() == 5.0
    assert 4 in bottle
    assert list(reversed(Bottle([1, 2]))) == [2, 1]


def test_equality_compares_types():
    """Numbers of different types are different."""
    assert Bottle([1]) != Bottle([1.0])
    assert Bottle([Int8(1)]) != Bottle([1])
    assert Bottle([Float32(0.5)]) != Bottle([0.5])
    assert Bottle(["1"]) != Bottle([Vocab("1")])
    assert Bottle([[1]]) != Bottle([[1.0]])
    assert Bottle([1]) != Bottle([1, 1])
    assert Bottle([1]) != [1]
    assert Bottle([2**40]) == Bottle([Int64(2**40)])


def test_a_bottle_is_not_hashable():
    """A bottle cannot be hashed, because it can change."""
    with pytest.raises(TypeError):
        hash(Bottle())


def test_the_representation_makes_it_again():
    """The representation is an expression with the text form."""
    bottle = Bottle([1, "a b", [Vocab("set")]])
    assert repr(bottle) == "Bottle.parse('1 \"a b\" ([set])')"
    assert eval(repr(bottle)) == bottle


def test_bottles_too_deep_to_compare_raise_our_error():
    """Comparing bottles that contain themselves raises BottleLimitError."""
    one, other = Bottle(), Bottle()
    one.append(one)
    other.append(other)
    with pytest.raises(BottleLimitError, match=str(MAX_DEPTH)):
        assert one == other


def test_missing_elements_are_none():
    """``get`` returns None, or a default, for an index that does not exist."""
    bottle = Bottle([1])
    assert (bottle.get(0), bottle.get(1), bottle.get(-1), bottle.get(5, 7)) == (1, None, None, 7)


CONFIGURATION = Bottle.parse('robot icub (joints 0 1 2) (name "Motor Test") (5 five) ([set] 1) (empty) tail')


@pytest.mark.parametrize(
    ("key", "value", "group"),
    [
        ("robot", "icub", "robot icub"),
        ("joints", 0, "joints 0 1 2"),
        ("name", "Motor Test", 'name "Motor Test"'),
        ("5", "five", "5 five"),
        ("set", 1, "[set] 1"),
        ("empty", None, "empty"),
        ("tail", None, "tail"),
        ("icub", Bottle(["joints", 0, 1, 2]), "icub (joints 0 1 2)"),
    ],
)
def test_lookup(key: str, value: Value | None, group: str):
    """A list is found by its first element, a flat key by itself; the value follows the key."""
    assert CONFIGURATION.check(key)
    assert CONFIGURATION.find(key) == value
    assert str(CONFIGURATION.find_group(key)) == group


def test_lookup_of_what_is_not_there():
    """A missing key gives None."""
    assert not CONFIGURATION.check("none")
    assert CONFIGURATION.find("none") is None
    assert CONFIGURATION.find_group("none") is None
    assert not CONFIGURATION.check("Robot")


def test_the_first_match_wins():
    """Elements are searched in order, and a value equal to the key counts as a match."""
    assert Bottle.parse("(a 1) (a 2)").find("a") == 1
    assert Bottle.parse("x a 5 (a 2)").find("a") == 5
    assert Bottle.parse("(a) (a 2)").find("a") is None


def test_a_found_group_is_the_list_itself():
    """Changing a found list changes the bottle."""
    bottle = Bottle.parse("(a 1)")
    group = bottle.find_group("a")
    assert group is not None
    group.append(2)
    assert bottle.to_text() == "(a 1 2)"


def test_importing_values_is_light():
    """Importing values loads no heavy module."""
    heavy = ("lxml", "numpy", "asyncio", "inspect", "rich", "time")
    code = (
        f"import sys; before = set(sys.modules); import rtf.bottle; print(set({heavy}) & (set(sys.modules) - before))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() in {"set()", "{'inspect'}"}  # dataclasses need inspect
