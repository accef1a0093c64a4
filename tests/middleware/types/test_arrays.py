"""Vectors and matrices: the bytes of numpy arrays, without a loop over the elements."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from rtf.bottle import Bottle, BottleError, BottleTypeError, Dialect
from rtf.bottle.binary import decode, encode
from rtf.middleware.types import MATRIX, VECTOR, vector_of
from rtf.middleware.types.codecs import codec_of

THREE, FOUR = Dialect.YARP3, Dialect.YARP4
RECORDED = json.loads((Path(__file__).parents[2] / "data" / "yarp_wire" / "bottles.json").read_text())
DOUBLES = [entry for entry in RECORDED if entry["hex"][:4] in ("0a01", "1401")]


def written(codec, value, dialect: Dialect = THREE) -> str:
    """Return the bytes of an object in hexadecimal."""
    return b"".join(codec.encode(value, dialect)).hex()


def test_a_vector_as_real_programs_send_it():
    """The bytes of a vector are those of a real board, in both dialects."""
    assert written(VECTOR, np.array([3.0, 4.0])) == "0a01000002000000" + "0000000000000840" + "0000000000001040"
    assert written(VECTOR, np.array([3.0]), FOUR) == "1401000001000000" + "0000000000000840"
    assert VECTOR.promise == "yarp/vector"


@pytest.mark.parametrize("entry", DOUBLES, ids=lambda entry: f"{entry['dialect']} {entry['from']}")
def test_recorded_vectors(entry: dict[str, object]):
    """Recorded vectors decode to the numbers of the bottle, and encode to the same bytes."""
    data, dialect = bytes.fromhex(str(entry["hex"])), Dialect(entry["dialect"])
    read = VECTOR.decode(data, dialect)
    np.testing.assert_array_equal(read, list(decode(data, dialect)))
    assert written(VECTOR, read, dialect) == entry["hex"]


@pytest.mark.parametrize(
    ("dtype", "three", "four"),
    [
        ("i1", "20", "20"),
        ("i2", "40", "40"),
        ("i4", "01", "01"),
        ("i8", "11", "11"),
        ("f4", "80", "0a"),
        ("f8", "0a", "14"),
    ],
)
def test_each_type_has_the_code_of_its_dialect(dtype: str, three: str, four: str):
    """A vector of another type has that type's code in each dialect."""
    array = np.array([1, 2], dtype)
    for dialect, code in ((THREE, three), (FOUR, four)):
        assert written(vector_of(dtype), array, dialect) == f"{code}01000002000000" + array.tobytes().hex()


@settings(deadline=None)
@given(hnp.arrays(st.sampled_from(["i1", "i2", "i4", "i8", "f4", "f8"]), st.integers(0, 40)), st.sampled_from(Dialect))
def test_vectors_are_what_bottles_are(array: np.ndarray, dialect: Dialect):
    """A vector has the bytes of the bottle of its elements, and decodes to the same bits."""
    codec = vector_of(array.dtype)
    data = b"".join(codec.encode(array, dialect))
    assert codec.decode(data, dialect).tobytes() == array.tobytes()
    if array.dtype == np.float64 and array.size:
        assert data == encode(Bottle(array), dialect)


def test_large_arrays_are_not_copied():
    """Large arrays are encoded and adopted without a copy."""
    array = np.arange(10_000.0)
    head, body = VECTOR.encode(array, THREE)
    assert np.shares_memory(np.frombuffer(body), array)
    matrix = np.zeros((100, 100))
    assert np.shares_memory(np.frombuffer(MATRIX.encode(matrix, THREE)[1]), matrix)
    data = bytearray(bytes(head) + bytes(body))
    assert np.shares_memory(VECTOR.adopt(data, THREE), np.frombuffer(data, np.uint8))
    assert not np.shares_memory(VECTOR.decode(data, THREE), np.frombuffer(data, np.uint8))
    assert len(VECTOR.encode(np.arange(53.0), THREE)) == 1


def test_arrays_that_lie_otherwise_are_written_the_same():
    """Arrays of any memory layout, lists and other numbers are encoded alike."""
    plain = written(VECTOR, np.array([0.0, 2.0, 4.0]))
    frozen = np.array([0.0, 2.0, 4.0])
    frozen.flags.writeable = False
    for value in (np.arange(6.0)[::2], np.array([0, 2, 4], ">f8"), frozen, [0, 2, 4], np.array([0, 2, 4], np.uint8)):
        assert written(VECTOR, value) == plain
    matrix = np.arange(6.0).reshape(2, 3)
    assert written(MATRIX, matrix.T) == written(MATRIX, matrix.T.copy())
    assert written(MATRIX, np.asfortranarray(matrix)) == written(MATRIX, matrix)


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("1 2 3", [1, 2, 3]),
        ("1 2.5", [1, 2.5]),
        ("", []),
        ("[a] 1", [97, 1]),
        ("3000000000 1", [3e9, 1]),
        ("nan", [math.nan]),
    ],
)
def test_a_vector_may_be_typed(text: str, numbers: list[float]):
    """A flat list of numbers is a vector; a vocab counts as its number."""
    read = VECTOR.from_text(text)
    assert read.dtype == np.float64
    np.testing.assert_array_equal(read, numbers)


def test_vectors_become_those_of_the_receiver():
    """Elements of another type are converted if they fit, and refused otherwise."""
    integers = vector_of(np.int32)
    np.testing.assert_array_equal(integers.from_text("1.0 -2.0"), [1, -2])
    assert integers.decode(encode(Bottle([1.0, 2.0])), THREE).dtype == np.int32
    assert vector_of(np.float32).from_text("1e300")[0] == np.inf
    for text, message in [("1.5", "whole"), ("3000000000", "fit"), ("nan", "fit"), ("1 -9999999999.0", "fit")]:
        with pytest.raises(BottleError, match=message):
            integers.from_text(text)
    with pytest.raises(BottleError, match="fit"):
        vector_of(np.int64).from_text("9223372036854775808.0")


@pytest.mark.parametrize("text", ['"a"', "1 (2)", "{1 2}", "1 2 x"])
def test_a_vector_of_other_things_is_refused(text: str):
    """The error names the element that is not a number."""
    with pytest.raises(BottleError, match="a vector holds numbers; element"):
        VECTOR.from_text(text)


def test_a_negative_count_is_refused():
    """A negative count of elements is refused."""
    with pytest.raises(BottleError, match="-1 elements"):
        VECTOR.decode(bytes.fromhex("0a010000ffffffff"), THREE)


def test_a_matrix_to_the_byte():
    """A matrix has rows, columns, and the elements row by row."""
    assert written(MATRIX, np.array([[1.0, 2.0]])) == (
        "00010000 03000000 01000000 01000000 01000000 02000000 0a010000 02000000 000000000000f03f 0000000000000040"
    ).replace(" ", "")
    assert MATRIX.to_text(np.array([[1.0, 2.0]])) == "1 2 (1.0 2.0)"
    np.testing.assert_array_equal(MATRIX.from_text("2 2 (1 2 3 4)"), [[1, 2], [3, 4]])
    np.testing.assert_array_equal(MATRIX.from_text("1 2 (1 2.5)"), [[1, 2.5]])


@pytest.mark.parametrize(
    "text", ["2 2 (1 2 3)", "-1 -4 (1 2 3 4)", "2 2", "1 2 3", "1.0 1 (5)", "", "2147483647 2 (1)"]
)
def test_a_matrix_that_is_none_is_refused(text: str):
    """A matrix whose rows and columns do not fit the elements is refused."""
    with pytest.raises(BottleError, match="a matrix"):
        MATRIX.from_text(text)


def test_a_bare_array_is_a_vector_or_a_matrix():
    """The codec of an array follows from its shape and type; ambiguous arrays are refused with a hint."""
    assert codec_of(np.zeros(3)) is VECTOR
    assert codec_of(np.zeros(3, np.int16)) is vector_of("i2")
    assert codec_of(np.zeros(3, ">f8")) is VECTOR
    assert codec_of(np.zeros((3, 3))) is codec_of(np.zeros((2, 2), np.int64)) is MATRIX
    for array, hint in [
        (np.zeros(3, np.uint8), "astype"),
        (np.zeros(3, bool), "astype"),
        (np.zeros((4, 4), np.uint8), "Image"),
        (np.zeros((4, 4, 3)), "Image"),
        (np.array(1.0), "codec"),
    ]:
        with pytest.raises(BottleTypeError, match=hint):
            codec_of(array)


def test_what_has_the_wrong_shape_is_not_sent():
    """An array with wrong dimensions or elements for its codec is refused."""
    with pytest.raises(BottleTypeError, match="one dimension"):
        VECTOR.encode(np.eye(2), THREE)
    with pytest.raises(BottleTypeError, match="two dimensions"):
        MATRIX.encode(np.zeros(2), THREE)
    for value in (["a"], [None], [1j], [[1], [2, 3]]):
        with pytest.raises(BottleTypeError):
            VECTOR.encode(value, THREE)
