"""Parameters of configurations: valid values are read, others are refused with their place."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.bottle import Bottle, Property
from rtf.errors import Location
from rtf.robot import parameters
from rtf.robot.errors import ConfigurationError

READERS: dict[str, Callable[[Property], Any]] = {
    "port_name": lambda given_: parameters.port_name(given_, "key"),
    "positive": lambda given_: parameters.positive(given_, "key"),
    "count": lambda given_: parameters.count(given_, "key", 1, 10),
    "flag": lambda given_: parameters.flag(given_, "key"),
    "names": lambda given_: parameters.names(given_, "key"),
}


@pytest.mark.parametrize(
    ("reader", "text", "value"),
    [
        ("port_name", "/icub/imu", "/icub/imu"),
        ("port_name", "/icub/imu/", "/icub/imu"),
        ("positive", "10", 10.0),
        ("positive", "0.5", 0.5),
        ("count", "10", 10),
        ("flag", "1", True),
        ("flag", "0", False),
        ("flag", "true", True),
        ("flag", "false", False),
        ("flag", "on", True),
        ("flag", "Off", False),
        ("flag", "", True),
        ("names", "(a b)", ("a", "b")),
        ("names", "a", ("a",)),
        ("names", "", ()),
    ],
)
def test_what_is_taken(reader: str, text: str, value: object):
    """The reader of each kind of parameter accepts its valid values."""
    assert READERS[reader](Property.parse(f"(key {text})")) == value


@pytest.mark.parametrize(
    ("reader", "text"),
    [
        ("port_name", "imu"),
        ("port_name", "5"),
        ("positive", "0"),
        ("positive", "-1"),
        ("positive", "fast"),
        ("positive", "inf"),
        ("count", "0"),
        ("count", "11"),
        ("count", "2.5"),
        ("flag", "perhaps"),
        ("flag", "(1)"),
        ("names", "(a 1)"),
    ],
)
def test_what_is_not(reader: str, text: str):
    """The message about an invalid value begins with file, line and parameter."""
    configuration = Property()
    value = Bottle.parse(text)[0] if text != "inf" else float("inf")
    configuration.put("key", value, location=Location("robot.xml", 12, 5))
    with pytest.raises(ConfigurationError, match=r"^robot\.xml:12:5: key: "):
        READERS[reader](configuration)


@pytest.mark.parametrize("reader", ["port_name", "positive"])
def test_what_is_missing(reader: str):
    """The message about a missing parameter names it."""
    with pytest.raises(ConfigurationError, match=r"^key: it is missing"):
        READERS[reader](Property())


def test_carriers():
    """A missing carrier is the default, and an unknown one is refused."""
    assert parameters.carrier(Property(), "udp") == "udp"
    with pytest.raises(ConfigurationError, match=r"^carrier: "):
        parameters.carrier(Property({"carrier": "pigeon"}), "udp")


@pytest.mark.fuzz
@given(
    st.recursive(
        st.one_of(st.integers(-(2**63), 2**63 - 1), st.floats(), st.text(max_size=6), st.binary(max_size=6)),
        lambda inner: st.lists(inner, max_size=3),
        max_leaves=6,
    ),
    st.sampled_from([*READERS]),
)
def test_any_value(value: object, reader: str):
    """Any value is read, or raises ConfigurationError."""
    with contextlib.suppress(ConfigurationError):
        READERS[reader](Property({"key": value}))
