"""Writing text exactly as YARP does."""

from __future__ import annotations

import math
import string

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtf.bottle import (
    FALSE,
    MAX_DEPTH,
    TRUE,
    Bottle,
    BottleLimitError,
    BottleTypeError,
    Float32,
    Int8,
    Int16,
    Int64,
    Property,
    Value,
    Vocab,
    Vocab64,
    to_string,
    to_text,
)

TEXTS: list[tuple[Value, str]] = [
    (5, "5"), (Int8(-5), "-5"), (Int16(5), "5"), (Int64(5), "5"), (10000000000, "10000000000"),
    (1.0, "1.0"), (0.1, "0.100000000000000005551"), (1e20, "100000000000000000000.0"), (1e21, "1e+21"),
    (1e-5, "1.0000000000000000818e-05"), (1 / 3, "0.33333333333333331483"), (-0.0, "-0.0"),
    (Float32(0.1), "0.100000001490116119385"), (math.nan, "nan"), (math.inf, "inf"), (-math.inf, "-inf"),
    (Vocab("abcd"), "[abcd]"), (Vocab("set"), "[set]"), (Vocab("x]"), "[x]]"), (Vocab64("abcdef"), "[abcdef]"),
    (TRUE, "true"), (FALSE, "false"), (Vocab("true"), "[true]"),
    ("hello", "hello"), ("a.b-c_9", "a.b-c_9"), ("", '""'), ("true", '"true"'), ("false", '"false"'),
    ("hi there", '"hi there"'), ("9a", '"9a"'), (".a", '".a"'), ("-a", '"-a"'), ("/icub", '"/icub"'),
    ('a\\b"c', '"a\\\\b\\"c"'), ("a\nb\rc\0d", '"a\\nb\\rc\\0d"'), ("a\tb", '"a\tb"'), ("caf\u00e9", '"caf\u00e9"'),
    ("null", "null"), ("nan", "nan"), ("inf", "inf"),
    (b"\x01\x02\xff", "{1 2 255}"), (b"", "{}"),
    (Bottle([1, [2, []]]), "(1 (2 ()))"), (Bottle(), "()"),
    (Property({"k": "v", "k2": "v2"}), "((k v) (k2 v2))"),
]  # fmt: skip


@pytest.mark.parametrize(("value", "text"), TEXTS)
def test_text_is_written_as_yarp_writes_it(value: Value, text: str):
    """Every value in a bottle has YARP's text."""
    assert to_text(value) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, ""),
        ("hi there", "hi there"),
        (Vocab("set"), "set"),
        (TRUE, "true"),
        (Bottle([1, "a b"]), '1 "a b"'),
        (b"\x01\x02", "1 2"),
        (1.5, "1.5"),
        (Property({"k": 1}), "(k 1)"),
    ],
)
def test_a_value_alone_is_written_bare(value: Value | None, text: str):
    """Alone, a string has no quotes, and a list no brackets."""
    assert to_string(value) == text


def test_elements_are_separated_by_one_blank():
    """Elements are separated by one blank, without brackets around the bottle."""
    assert Bottle([1, "a", [2.0]]).to_text() == "1 a (2.0)"
    assert Bottle().to_text() == ""
    assert str(Bottle([1, 2])) == "1 2"


def test_what_is_no_value_is_refused():
    """An object that is no value cannot be written."""
    with pytest.raises(BottleTypeError, match="complex"):
        to_text(1j)  # type: ignore[arg-type]


def test_a_bottle_inside_itself_is_refused():
    """A bottle inside itself raises BottleLimitError."""
    bottle = Bottle([1])
    bottle.append(bottle)
    with pytest.raises(BottleLimitError, match=str(MAX_DEPTH)):
        bottle.to_text()


VOCABS = st.text(string.ascii_letters + string.digits + ":;=/_.-", min_size=1, max_size=4).map(Vocab)
STRINGS = st.text(st.characters(exclude_categories=["Cs"])).filter(lambda text: text not in {"null", "nan", "inf"})
SCALARS = st.one_of(
    st.integers(-(2**63), 2**63 - 1),
    st.integers(-1000, 1000),
    st.floats(allow_nan=False),
    STRINGS,
    st.binary(),
    VOCABS,
    st.booleans(),
)
BOTTLES = st.recursive(st.lists(SCALARS), lambda inner: st.lists(st.one_of(SCALARS, inner)), max_leaves=30).map(Bottle)


@settings(deadline=None)
@given(BOTTLES)
def test_what_is_written_reads_back(bottle: Bottle):
    """A bottle is the same after it is written as text and read again, but for the documented exceptions."""
    assert Bottle.parse(bottle.to_text()) == bottle


@pytest.mark.parametrize(
    ("value", "read"),
    [
        ("null", Vocab("null")),
        ("inf", math.inf),
        (Float32(0.1), float(Float32(0.1))),
        (Int8(5), 5),
        (Int64(5), 5),
        (Property({"k": 1}), Bottle([["k", 1]])),
        (Vocab("a b"), FALSE),
    ],
)
def test_the_exceptions_read_back_as_documented(value: Value, read: Value):
    """Values that text cannot distinguish read back as documented."""
    assert Bottle.parse(to_text(value))[0] == read


@given(st.floats(allow_nan=False))
def test_every_float_reads_back_exactly(number: float):
    """Every double reads back exactly."""
    assert Bottle.parse(to_text(number)) == Bottle([number])
