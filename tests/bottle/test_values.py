"""Scalar types that Python does not have."""

from __future__ import annotations

import copy
import pickle
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.bottle import FALSE, TRUE, BottleError, Float32, Int8, Int16, Int64, Vocab, Vocab64
from rtf.errors import RtfError


@pytest.mark.parametrize(("kind", "bits"), [(Int8, 8), (Int16, 16), (Int64, 64)])
def test_sized_integers_hold_their_range(kind: type[Int8], bits: int):
    """An integer of fixed width accepts exactly the numbers of its width."""
    assert kind(2 ** (bits - 1) - 1) == 2 ** (bits - 1) - 1
    assert kind(-(2 ** (bits - 1))) == -(2 ** (bits - 1))
    with pytest.raises(BottleError, match=f"{bits} bits"):
        kind(2 ** (bits - 1))


def test_sized_integers_name_their_type():
    """The representation of a sized integer has its width."""
    assert repr([Int8(5), Int16(-5), Int64(5)]) == "[Int8(5), Int16(-5), Int64(5)]"
    assert f"{Int8(5)} {Int64(-5)!s} {Float32(0.5)!s}" == "5 -5 0.5"


@given(st.floats(allow_nan=False, width=32))
def test_float32_keeps_single_precision(number: float):
    """A number that single precision can hold is unchanged."""
    assert Float32(number) == number


def test_float32_rounds_and_overflows():
    """Other numbers are rounded, and too large ones become infinite."""
    assert Float32(0.1) == struct.unpack("<f", struct.pack("<f", 0.1))[0]
    assert Float32(1e300) == float("inf")
    assert Float32(-1e300) == float("-inf")
    assert repr(Float32(0.5)) == "Float32(0.5)"


@pytest.mark.parametrize(
    ("word", "number"),
    [("set", 7628147), ("idl", 7103593), ("posd", 1685286768), ("torq", 1903325044), ("1", 49), ("", 0)],
)
def test_vocabs_pack_the_first_character_lowest(word: str, number: int):
    """A vocab is its characters, the first one in the lowest byte."""
    assert Vocab(word).value == number
    assert Vocab(number).text == word
    assert Vocab(word) == Vocab(number)


@given(st.integers(-(2**31), 2**32 - 1))
def test_vocabs_take_signed_and_unsigned_numbers(number: int):
    """A number and its unsigned equivalent are the same vocab; the representation makes it again."""
    vocab = Vocab(number)
    assert vocab.value == struct.unpack("<i", struct.pack("<I", number % 2**32))[0]
    assert eval(repr(vocab)) == vocab
    assert pickle.loads(pickle.dumps(vocab)) == vocab
    assert copy.deepcopy(vocab) == vocab


@pytest.mark.parametrize("value", [2**32, -(2**31) - 1, "fives"])
def test_vocabs_refuse_what_does_not_fit(value: int | str):
    """A vocab refuses a value that does not fit."""
    with pytest.raises(BottleError):
        Vocab(value)


def test_reading_cuts_vocabs():
    """Vocabs that are read from text are cut to the width, in bytes."""
    assert Vocab.truncated("abcdef") == Vocab("abcd")
    assert Vocab.truncated("\u00e9\u00e9\u00e9") == Vocab("\u00e9\u00e9")
    assert Vocab64.truncated("abcdefghij") == Vocab64("abcdefgh")


def test_vocabs_equal_only_vocabs():
    """A vocab equals neither its string nor its number, nor one of another width."""
    assert Vocab("set") != "set"
    assert Vocab("set") != 7628147
    assert Vocab("set") != Vocab64("set")
    assert len({Vocab("set"), Vocab("set"), Vocab64("set"), Vocab("get")}) == 3


def test_the_two_truths():
    """True is the vocab '1' and false the vocab 0; there is no other boolean."""
    assert (TRUE.value, FALSE.value) == (49, 0)
    assert (bool(TRUE), bool(FALSE)) == (True, False)
    assert (str(TRUE), str(FALSE), str(Vocab("ok"))) == ("true", "false", "ok")
    assert (repr(TRUE), repr(FALSE)) == ("Vocab('1')", "Vocab(0)")
    assert int(TRUE) == 49


def test_errors_are_ours_and_built_in():
    """BottleError is an RtfError and a ValueError; its message has the column."""
    error = BottleError("odd", 4)
    assert isinstance(error, RtfError)
    assert isinstance(error, ValueError)
    assert (str(error), error.offset) == ("odd (column 5)", 4)
