"""Point clouds: the bytes of YARP, and invalid clouds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from rtf.bottle import BottleError, BottleTypeError, Dialect
from rtf.bottle.binary import TruncatedBottleError
from rtf.middleware.types import POINT_CLOUD, PointCloud

#: A cloud of 3 x 2 points, written by YARP 3.12.3; in YARP 4.0 the list of doubles has another code.
RECORDED = (
    "030000000200000002000000010a01000006000000"
    "0000003f000080be0000803f00000000" "0000c03f000080be0000803f00000000" "00002040000080be0000803f00000000"
    "0000003f0000403f0000803f00000000" "0000c03f0000403f0000004000000000" "000020400000403f0000404000000000"
)  # fmt: skip
BYTES = {
    Dialect.YARP3: bytes.fromhex(RECORDED),
    Dialect.YARP4: bytes.fromhex(RECORDED.replace("0a010000", "14010000")),
}
POINTS = np.array(
    [[[0.5, -0.25, 1], [1.5, -0.25, 1], [2.5, -0.25, 1]], [[0.5, 0.75, 1], [1.5, 0.75, 2], [2.5, 0.75, 3]]], np.float32
)


@pytest.mark.parametrize("dialect", Dialect)
def test_bytes_are_those_of_yarp(dialect: Dialect):
    """A cloud has YARP's bytes in both dialects, and decodes from them."""
    assert b"".join(POINT_CLOUD.encode(PointCloud(POINTS), dialect)) == BYTES[dialect]
    assert POINT_CLOUD.decode(BYTES[dialect], dialect) == PointCloud(POINTS)


@given(
    hnp.arrays("f4", st.tuples(st.integers(0, 5), st.integers(0, 5), st.just(3)), elements=st.floats(width=32)),
    st.sampled_from(Dialect),
    st.binary(max_size=9),
)
def test_every_cloud_comes_back(points: np.ndarray, dialect: Dialect, rest: bytes):
    """A cloud is the same after encoding and decoding, and its density tells whether all points are finite."""
    data = b"".join(POINT_CLOUD.encode(PointCloud(points), dialect))
    found, end = POINT_CLOUD.decode_from(data + rest, dialect)
    assert found == PointCloud(points)
    assert end == len(data)
    assert data[12] == bool(np.isfinite(points).all())


@given(st.integers(0, len(BYTES[Dialect.YARP3]) - 1))
def test_a_part_of_a_cloud_says_that_more_is_needed(size: int):
    """A truncated cloud raises TruncatedBottleError."""
    with pytest.raises(TruncatedBottleError):
        POINT_CLOUD.decode_from(BYTES[Dialect.YARP3][:size], Dialect.YARP3)


@pytest.mark.parametrize(
    ("place", "value", "problem"),
    [(0, 4, "4 x 2 points"), (0, 255, "of 6"), (8, 6, "of type 6"), (13, 0, "of code"), (17, 7, "a list of 7")],
)
def test_other_messages_are_no_clouds(place: int, value: int, problem: str):
    """A message with a wrong size or other points is refused."""
    data = bytearray(BYTES[Dialect.YARP3])
    data[place] = value
    with pytest.raises(BottleError, match=problem):
        POINT_CLOUD.decode(bytes(data), Dialect.YARP3)


@pytest.mark.parametrize("points", [np.zeros((2, 3), np.float32), np.zeros((2, 2, 4), np.float32), np.zeros((2, 2, 3))])
def test_other_arrays_are_no_clouds(points: np.ndarray):
    """The error about a wrong array shows a valid shape."""
    with pytest.raises(BottleTypeError, match=r"float32 of shape \(480, 640, 3\)"):
        PointCloud(points)


def test_text():
    """A cloud of one row is read from text and written as text; other text is an error."""
    typed = POINT_CLOUD.from_text("(1 2 3.5) (4 5 6)")
    assert typed == PointCloud(np.array([[[1, 2, 3.5], [4, 5, 6]]], np.float32))
    assert POINT_CLOUD.from_text(POINT_CLOUD.to_text(typed)) == typed
    for wrong in ("(1 2)", "(1 2 x)", "((1) 2 3)"):
        with pytest.raises(BottleError):
            POINT_CLOUD.from_text(wrong)
    assert repr(typed) == "<PointCloud 2 x 1>"
    assert (typed == 1) is False
