"""PNG files of pictures."""

import struct
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot_testing.judging.png import png


def read(data):
    """Read a file independently: its size, kind and rows."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    at, chunks = 8, {}
    while at < len(data):
        (size,) = struct.unpack_from(">I", data, at)
        kind, body = data[at + 4 : at + 8], data[at + 8 : at + 8 + size]
        assert struct.unpack_from(">I", data, at + 8 + size) == (zlib.crc32(kind + body),)
        chunks[kind] = body
        at += 12 + size
    assert list(chunks) == [b"IHDR", b"IDAT", b"IEND"]
    return struct.unpack(">2I5B", chunks[b"IHDR"]), zlib.decompress(chunks[b"IDAT"])


@given(st.integers(1, 20), st.integers(1, 20), st.sampled_from([(), (3,)]), st.integers(0, 2**32 - 1))
def test_every_pixel_is_in_the_file(height, width, channels, seed):
    """The rows of the file, each after its filter 0, are those of the picture."""
    pixels = np.random.default_rng(seed).integers(0, 256, (height, width, *channels), dtype=np.uint8)
    (found_width, found_height, depth, colour, *rest), rows = read(png(pixels))
    assert (found_width, found_height, depth, colour, rest) == (width, height, 8, 2 if channels else 0, [0, 0, 0])
    lines = np.frombuffer(rows, np.uint8).reshape(height, -1)
    assert (lines[:, 0] == 0).all()
    assert np.array_equal(lines[:, 1:].reshape(pixels.shape), pixels)


@pytest.mark.parametrize(
    "pixels",
    [np.zeros((2, 2), float), np.zeros((0, 3, 3), np.uint8), np.zeros((2, 2, 4), np.uint8), np.zeros(3, np.uint8)],
)
def test_other_arrays_are_refused(pixels):
    """The error has the shape of the array."""
    with pytest.raises(ValueError, match="not"):
        png(pixels)
