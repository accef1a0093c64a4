"""Conversions of values: the result of asking any value for any type."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.bottle import (
    FALSE,
    TRUE,
    Bottle,
    Float32,
    Int8,
    Property,
    Value,
    Vocab,
    Vocab64,
    as_bool,
    as_bytes,
    as_dict,
    as_float,
    as_float32,
    as_int,
    as_list,
    as_string,
    as_vocab,
    is_bool,
)

SET = Vocab("set")


@pytest.mark.parametrize(
    ("value", "answers"),
    [
        (None, (0, 0.0, False, "", FALSE)),
        (5, (5, 5.0, True, "", Vocab(5))),
        (0, (0, 0.0, False, "", FALSE)),
        (Int8(-3), (-3, -3.0, True, "", Vocab(-3))),
        (2.9, (2, 2.9, False, "", FALSE)),
        (-2.9, (-2, -2.9, False, "", FALSE)),
        (Float32(1.5), (1, 1.5, False, "", FALSE)),
        (SET, (7628147, 7628147.0, True, "set", SET)),
        (TRUE, (49, 49.0, True, "true", TRUE)),
        (FALSE, (0, 0.0, False, "false", FALSE)),
        ("5", (0, 0.0, False, "5", Vocab("5"))),
        ("setting", (0, 0.0, False, "setting", Vocab("sett"))),
        (b"5", (0, 0.0, False, "", FALSE)),
        (Bottle([5]), (0, 0.0, False, "", FALSE)),
        (Property({"a": 5}), (0, 0.0, False, "", FALSE)),
    ],
)
def test_conversions(value: Value | None, answers: tuple[int, float, bool, str, Vocab]):
    """Every value converts to every type; without a sensible result it is the type's zero."""
    assert (as_int(value), as_float(value), as_bool(value), as_string(value), as_vocab(value)) == answers


def test_narrow_integers_wrap_around():
    """An integer that is too large for the width wraps around, as in C."""
    assert as_int(255, 8) == -1
    assert as_int(2**31, 32) == -(2**31)
    assert as_int(70000, 16) == 70000 - 65536
    assert as_int(Vocab64("abcdefgh"), 32) == Vocab("abcd").value


def test_floats_that_are_no_integers():
    """As integer, infinity is the greatest number of its sign, and NaN is 0."""
    assert (as_int(math.nan), as_int(math.inf), as_int(-1e300)) == (0, 2**63 - 1, -(2**63))


def test_single_precision():
    """Asking for single precision rounds."""
    assert as_float32(0.1) == Float32(0.1)


def test_only_two_vocabs_are_booleans():
    """A boolean is the vocab 0 or the vocab '1', nothing else."""
    assert is_bool(TRUE)
    assert is_bool(FALSE)
    assert not any(is_bool(value) for value in (SET, 1, 0, "true", None))


def test_containers_and_blobs():
    """Lists, properties and blobs convert to their own type only."""
    bottle, properties = Bottle([1]), Property({"a": 1})
    assert as_list(bottle) is bottle
    assert as_list(properties) is None
    assert as_dict(properties) is properties
    assert as_dict(bottle) is None
    assert as_bytes(b"x") == b"x"
    assert as_bytes("x") is None


@given(st.one_of(st.integers(-(2**63), 2**63 - 1), st.floats(), st.text("ab"), st.binary()))
def test_conversions_never_raise(value: Value):
    """No conversion raises, and the integer fits into the width."""
    for bits in (8, 16, 32, 64):
        assert -(2 ** (bits - 1)) <= as_int(value, bits) < 2 ** (bits - 1)
    as_float32(value)
    as_vocab(value)
