"""Words as numbers: which are numbers, and their values."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.bottle import Bottle
from rtf.bottle.numbers import read_number

DATA = Path(__file__).parents[1] / "data"
INTEGERS = {
    "0": 0, "5": 5, "-7": -7, "+5": 5, "-": 0, "+": 0, "-x": 0, "007": 7, "010": 8, "08": 0, "-010": -8,
    "0x1f": 31, "0X1F": 31, "-0x10": -16, "0xffffffff": 4294967295, "0x1e": 30, "0x": 0, "00x5": 0, "0x-5": 0,
    "1-2": 1, "2026-01-31": 2026, "2147483648": 2147483648, "10000000000": 10000000000,
    "9223372036854775807": 2**63 - 1, "9223372036854775808": 2**63 - 1, "99999999999999999999": 2**63 - 1,
    "-9223372036854775808": -(2**63), "-99999999999999999999": -(2**63), "0777777777777777777777": 2**63 - 1,
}  # fmt: skip
FLOATS = {
    "1.": 1.0, ".5": 0.5, "-.5": -0.5, "1e3": 1000.0, "1E3": 1000.0, "1e": 0.0, "1e+": 0.0, "1.5e-": 0.0,
    "1.5-2": 0.0, "1e5-3": 0.0, "1e-5": 1e-5, "1e999": math.inf,
    "-1e999": -math.inf, "-.": 0.0, ".e": 0.0, "0x1.8": 1.5, "007.5": 7.5, "inf": math.inf, "-inf": -math.inf,
}  # fmt: skip
STRINGS = [
    "", ".", "x1", "e5", "1a", "1..2", "1.2.3", "--1", "+-1", "0x123456789", "0x1g", "1x", "+inf", "infinity",
    "INF", "NaN", "nano", "/1", "\u0661", "1_000", "1 ",
]  # fmt: skip


@pytest.mark.parametrize(("word", "number"), INTEGERS.items())
def test_integers(word: str, number: int):
    """Integers are read as C's strtoll does with base 0, and saturate at 64 bits."""
    assert read_number(word) == number
    assert type(read_number(word)) is int


@pytest.mark.parametrize(("word", "number"), FLOATS.items())
def test_floats(word: str, number: float):
    """A point or an exponent makes a float, read as C's strtod does."""
    assert read_number(word) == number
    assert type(read_number(word)) is float


def test_not_a_number_is_a_number():
    """The word nan is a float."""
    value = read_number("nan")
    assert isinstance(value, float)
    assert math.isnan(value)


@pytest.mark.parametrize("word", STRINGS)
def test_strings(word: str):
    """Everything else is a string."""
    assert read_number(word) is None


def test_words_are_read_as_by_yarp():
    """Words of digits, signs, points, ``e`` and ``x`` are read as ``yarp read`` of 3.12.3 printed them."""
    lines = (DATA / "numbers_of_yarp_3.12.3.tsv").read_text("utf-8").splitlines()
    differing = [line for line in lines if Bottle.parse(line.partition("\t")[0]).to_text() != line.partition("\t")[2]]
    assert len(lines) > 500
    assert differing == []


@given(st.integers(-(2**63), 2**63 - 1))
def test_every_integer_reads_back(number: int):
    """Every decimal number of 64 bits is read exactly."""
    assert read_number(str(number)) == number


@given(st.text("0123456789+-.eExXabcdefinf", max_size=30))
def test_any_word_has_an_answer(word: str):
    """No word raises an error, and integers fit into 64 bits."""
    value = read_number(word)
    if isinstance(value, int):
        assert -(2**63) <= value < 2**63


def test_endless_digits_are_read_at_once():
    """A number of a million digits is read quickly, beyond Python's limit of digits."""
    assert read_number("9" * 1_000_000) == 2**63 - 1
    assert read_number("0" * 1_000_000) == 0
    assert read_number("9" * 1_000_000 + ".5") == math.inf
