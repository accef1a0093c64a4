"""PNG files of camera pictures."""

from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_GREY, _RGB = 0, 2
_DEPTH = 8


def png(pixels: NDArray[np.uint8]) -> bytes:
    """Return the PNG file of grey (height, width) or red, green and blue (height, width, 3) pixels.

    Raises ValueError for another shape, another type, or an empty picture.
    """
    colour = {2: _GREY, 3: _RGB}.get(pixels.ndim)
    if colour is None or pixels.dtype != np.uint8 or pixels.size == 0 or pixels.shape[2:] not in {(), (3,)}:
        raise ValueError(f"pixels need 8 bits and one or three channels, not {pixels.dtype} of {pixels.shape}")
    height, width = pixels.shape[:2]
    rows = pixels.reshape(height, -1)
    lines = np.zeros((height, rows.shape[1] + 1), np.uint8)  # each row begins with the number of its filter: none
    lines[:, 1:] = rows
    head = struct.pack(">2I5B", width, height, _DEPTH, colour, 0, 0, 0)
    chunks = ((b"IHDR", head), (b"IDAT", zlib.compress(lines.tobytes())), (b"IEND", b""))
    return _SIGNATURE + b"".join(_chunk(kind, data) for kind, data in chunks)


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
