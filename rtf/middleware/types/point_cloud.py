"""Point clouds: numpy arrays of points x, y, z in m.

The bytes are not those of a bottle: a header of 13 bytes (width, height, the type of the points, and whether all of
them are finite), the header of a list of doubles, and for each point four floats, of which the last one is unused. The
source is YARP 3.12 and 4.0, ``PointCloud.cpp``.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from rtf.bottle import Bottle, BottleError, BottleTypeError, Dialect
from rtf.bottle.binary import TruncatedBottleError
from rtf.bottle.values import INT32_MAX
from rtf.middleware.types.codecs import TextCodec
from rtf.middleware.types.vector import CODES, VECTOR

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rtf.middleware.types.codecs import Buffer

#: Width, height, type and density; then the code of the list and its length.
_HEADER = struct.Struct("<3ib")
_LIST = struct.Struct("<2i")
#: The type of points that have x, y, z.
_XYZ = 2
_FLOATS = 4
_SIZE = 4 * _FLOATS


class PointCloudCodec(TextCodec["PointCloud"]):
    """Codec of point clouds; points of other types, such as those with colours, are refused."""

    promise = "yarp/pointCloud"

    def encode(self, value: PointCloud, dialect: Dialect) -> Sequence[Buffer]:
        height, width = value.points.shape[:2]
        count = height * width
        if count * _SIZE > INT32_MAX:
            raise BottleTypeError(f"a cloud of {count} points is too large for a message")
        header = _HEADER.pack(width, height, _XYZ, bool(np.isfinite(value.points).all()))
        padded = np.zeros((count, _FLOATS), "<f4")
        padded[:, :3] = value.points.reshape(count, 3)
        return header + _LIST.pack(CODES[dialect]["f8"], count), padded.tobytes()

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[PointCloud, int]:
        start = _HEADER.size + _LIST.size
        if len(data) < start:
            raise TruncatedBottleError(start)
        width, height, kind, _ = _HEADER.unpack_from(data)
        code, count = _LIST.unpack_from(data, _HEADER.size)
        if kind != _XYZ:
            raise BottleError(f"the points of this cloud are of type {kind}; those with x, y, z are of type {_XYZ}")
        if min(width, height) < 0 or width * height != count or code != CODES[dialect]["f8"]:
            raise BottleError(f"a cloud of {width} x {height} points with a list of {count}, of code {code}")
        end = start + count * _SIZE
        if len(data) < end:
            raise TruncatedBottleError(end)
        floats = np.frombuffer(data, "<f4", count * _FLOATS, start).reshape(height, width, _FLOATS)
        return PointCloud(floats[:, :, :3].copy()), end

    def to_text(self, value: PointCloud) -> str:
        """Return the points of all rows, each in brackets."""
        return Bottle(value.points.reshape(-1, 3).tolist()).to_text()

    def from_text(self, text: str) -> PointCloud:
        """Return the cloud of one row that has these points. Raises BottleError."""
        try:
            points = np.array([np.array(VECTOR.from_bottle(point)) for point in _lists(text)], np.float32)
            return PointCloud(points.reshape(1, -1, 3))
        except (TypeError, ValueError):
            raise BottleError(f"{text[:60]!r} is no list of points (x y z)") from None


def _lists(text: str) -> list[Bottle]:
    return [item for item in Bottle.parse(text) if isinstance(item, Bottle)]


class PointCloud:
    """A point cloud. ``points`` has the shape (height, width, 3), float32, in m; it is not copied.

    A point that was not measured is NaN. A cloud without order has one row.
    """

    __slots__ = ("points",)
    __hash__ = None  # type: ignore[assignment]  # the points can change
    codec: ClassVar[PointCloudCodec] = PointCloudCodec()

    def __init__(self, points: NDArray[np.float32]) -> None:
        if points.ndim != 3 or points.shape[2] != 3 or points.dtype != np.float32:  # noqa: PLR2004 - rows, columns, x y z
            raise BottleTypeError(
                f"640 x 480 points are an array of float32 of shape (480, 640, 3); this is one of {points.dtype.name} "
                f"of shape {points.shape}"
            )
        self.points = points

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, PointCloud):
            return NotImplemented
        return np.array_equal(self.points, other.points, equal_nan=True)

    def __repr__(self) -> str:
        return f"<PointCloud {self.points.shape[1]} x {self.points.shape[0]}>"


POINT_CLOUD = PointCloud.codec
