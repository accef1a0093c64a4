"""Properties: groups of values by key."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtf.bottle import Bottle, Property
from rtf.errors import Location


def test_a_property_maps_keys_to_groups():
    """The value of a key is the second element of its group."""
    properties = Property.parse("(joints 0 1 2) (name x) (flag)")
    assert properties.find("joints") == 0
    assert properties.find_group("joints") == Bottle(["joints", 0, 1, 2])
    assert properties.check("flag")
    assert properties.find("flag") is None
    assert properties.get("flag", 7) == 7
    assert properties.get("none", 7) == 7
    assert properties.find_group("none") is None
    assert "name" in properties
    assert len(properties) == 3
    assert list(properties) == ["joints", "name", "flag"]


def test_text_is_in_the_order_of_bytes():
    """Keys are written in ascending byte order, whatever order they came in."""
    properties = Property({"b": 1, "a": [1, 2], "B": "x y", "\u00e9": 2})
    properties.put("c")
    assert properties.to_text() == '(B "x y") (a (1 2)) (b 1) (c) ("\u00e9" 2)'
    assert str(properties) == properties.to_text()
    assert eval(repr(properties)) == properties


def test_the_last_of_two_equal_keys_wins():
    """A key that is given again replaces what was there."""
    assert Property.parse("(a 1) (a 2)").find("a") == 2


def test_what_stands_outside_lists_is_ignored():
    """Elements outside of lists are ignored."""
    assert Property.parse("a 1 (b 2) c") == Property({"b": 2})


def test_equality_ignores_order_and_places():
    """Two properties are equal when their groups are."""
    one, other = Property({"a": 1, "b": 2}), Property({"b": 2, "a": 1})
    one.locate(Location("f", 1), "a")
    assert one == other
    assert one != Property({"a": 1, "b": 2.0})
    assert one != Property({"a": 1})
    assert one != 5
    with pytest.raises(TypeError):
        hash(one)


def test_places_stand_beside_the_keys():
    """A key keeps the place where it was read, until it is set anew."""
    properties = Property()
    properties.put("a", 1, location=Location("x.ini", 3))
    properties.locate(Location("x.ini", 5), "section", "b")
    assert str(properties.location("a")) == "x.ini:3"
    assert str(properties.location("section", "b")) == "x.ini:5"
    properties.put("a", 2)
    assert properties.location("a") is None


def test_update_and_remove():
    """Groups and places of another property replace existing ones; removing a key removes both."""
    properties, other = Property({"a": 1, "b": 2}), Property()
    other.put("a", 5, location=Location("y.ini", 1))
    properties.update(other)
    assert properties.to_text() == "(a 5) (b 2)"
    assert str(properties.location("a")) == "y.ini:1"
    properties.remove("a")
    properties.remove("none")
    assert properties.to_text() == "(b 2)"
    assert properties.location("a") is None


def test_a_copy_changes_alone():
    """Changing a group of a copy does not change the original."""
    properties = Property({"a": 1})
    copy = properties.copy()
    group = copy.find_group("a")
    assert group is not None
    group.append(2)
    assert properties.to_text() == "(a 1)"
    assert dict(copy.items()) == {"a": Bottle(["a", 1, 2])}


KEYS = st.text("abcxyz_.-/:", min_size=1).filter(lambda key: not key.startswith(("-", ".")))


@settings(deadline=None)
@given(st.dictionaries(KEYS, st.one_of(st.integers(-5, 5), st.text("ab "), st.lists(st.integers(0, 3)))))
def test_text_reads_back(values: dict[str, object]):
    """A property is the same after it is written as text and read again."""
    properties = Property(values)
    assert Property.parse(properties.to_text()) == properties
