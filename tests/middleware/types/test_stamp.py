"""Stamps as envelopes and as objects."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.bottle import Bottle, BottleError, Dialect
from rtf.bottle.binary import encode
from rtf.middleware.types import STAMP, Stamp


@pytest.mark.parametrize(
    ("stamp", "text"),
    [
        (Stamp(5, 123.5), "5 123.5"),
        (Stamp(213, 1795210389.10542), "213 1795210389.10542"),
        (Stamp(0, 0.0), "0 0"),
        (Stamp(7, 1e-5), "7 1e-05"),
        (Stamp(1, 1 / 3), "1 0.333333333333333"),
    ],
)
def test_an_envelope_is_the_count_and_the_time(stamp: Stamp, text: str):
    """An envelope has the count, and the time with fifteen digits as in YARP."""
    assert str(stamp) == text
    assert Stamp.parse(text).count == stamp.count
    assert Stamp.parse(text).time == float(f"{stamp.time:.15g}")


@given(st.integers(0, 2**31 - 1), st.floats(allow_nan=False, allow_infinity=False))
def test_the_time_keeps_fifteen_digits(count: int, time: float):
    """Any time reads back rounded to fifteen digits."""
    assert Stamp.parse(str(Stamp(count, time))) == Stamp(count, float(f"{time:.15g}"))


@pytest.mark.parametrize(
    "text", ["", "hello", "5", "5 x", "x 5", "(5 1.0)", "1 2 3 4", "9999999999 1.0", "__ADMIN", "9" * 5000]
)
def test_other_envelopes_are_no_stamps(text: str):
    """An envelope that is no stamp gives None."""
    assert Stamp.parse(text) is None


def test_what_people_write_is_read():
    """Blanks, integers and a third number are accepted."""
    assert Stamp.parse(" 7  99.5 ") == Stamp(7, 99.5)
    assert Stamp.parse("7 99") == Stamp(7, 99.0)
    assert Stamp.parse("-1 0") == Stamp()
    assert not Stamp.parse("-1 0").valid
    assert STAMP.from_text("7 99 0") == Stamp(7, 99.0)


def test_a_stamp_as_an_object():
    """As an object a stamp is a list of an integer and a double."""
    data = "00010000 02000000 01000000 05000000 0a000000 0000000000e05e40".replace(" ", "")
    assert b"".join(STAMP.encode(Stamp(5, 123.5), Dialect.YARP3)).hex() == data
    assert STAMP.decode(encode(Bottle([5, 123.5, 0])), Dialect.YARP3) == Stamp(5, 123.5)
    for other in ([5], [5, "x"], ["x", 5.0], [1, 2, 3, 4], [-2, 1.0]):
        with pytest.raises(BottleError, match="a stamp is a count and a time"):
            STAMP.decode(encode(Bottle(other)), Dialect.YARP3)


def test_counts_go_on():
    """Counts begin at 0, and restart there after the greatest one."""
    first = Stamp().next(1.5)
    assert first == Stamp(0, 1.5)
    assert first.valid
    assert first.next(2.5) == Stamp(1, 2.5)
    assert Stamp(2**31 - 1, 0.0).next(1.0) == Stamp(0, 1.0)
