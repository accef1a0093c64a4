"""Images: numpy arrays of pixels with a pixel format.

On the wire an image is a header of 60 bytes, which is the start of a bottle, and a blob: the rows in order, each padded
to a multiple of the *quantum*.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from rtf.bottle import BottleError, BottleTypeError, Dialect, Vocab
from rtf.bottle.binary import TruncatedBottleError, decode_from
from rtf.bottle.values import INT32_MAX, Kind
from rtf.middleware.types.codecs import TextCodec
from rtf.middleware.types.colors import convert
from rtf.middleware.types.pixels import PixelFormat, pixel_format, usual_format
from rtf.middleware.types.vector import contiguous

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rtf.middleware.types.codecs import Buffer

#: The default padding of rows in bytes, as everywhere in YARP.
QUANTUM = 8
_MAX_QUANTUM = 0xFFFF
_HEADER = struct.Struct("<15i")
_MAT = Vocab("mat").value
_LIST, _WORD, _NUMBERS, _BLOB = (int(kind) for kind in (Kind.LIST, Kind.VOCAB32, Kind.LIST | Kind.INT32, Kind.BLOB))
#: The bits above the quantum: YARP 3.5 to 3.9 store the row order there, 3.12 always this value.
_BEHIND_QUANTUM = {Dialect.YARP3: 1 << 16, Dialect.YARP4: 0}


class _Header(NamedTuple):
    kind: int
    parts: int
    mat_code: int
    mat: int
    pixel_code: int
    pixel: int
    numbers_code: int
    numbers: int
    depth: int
    size: int
    quantum: int
    width: int
    height: int
    blob_code: int
    blob_size: int


_FIXED = (_LIST, 4, _WORD, _MAT, _WORD)
_BEGINNING = struct.pack("<5i", *_FIXED)


class ImageCodec(TextCodec["Image"]):
    """Codec of images. With a ``code``, every received image is converted to that pixel format."""

    promise = "yarp/image"

    def __init__(self, code: str | None = None) -> None:
        self._code = None if code is None else pixel_format(code).code

    def encode(self, value: Image | NDArray[Any], dialect: Dialect) -> Sequence[Buffer]:
        """Return the header and the memory of the pixels; rows that need padding are copied."""
        image = value if isinstance(value, Image) else Image(value)
        kind, pixels = image.format, image.pixels
        height, width = pixels.shape[:2]
        row = _row(width * kind.depth, image.quantum)
        size = row * height
        if size > INT32_MAX:
            raise BottleTypeError(f"an image of {size} bytes is too large for a message")
        quantum = image.quantum | _BEHIND_QUANTUM[dialect]
        head = (*_FIXED, kind.number, _NUMBERS, 5, kind.depth, size, quantum, width, height, _BLOB, size)
        block = contiguous(pixels, kind.dtype)
        if row != width * kind.depth:
            rows = np.zeros((height, row), np.uint8)
            rows[:, : width * kind.depth] = block.reshape(height, -1).view(np.uint8)
            block = rows
        return (_HEADER.pack(*head), block.data.cast("B")) if size else (_HEADER.pack(*head),)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[Image, int]:  # noqa: ARG002 - the same in both
        header, end = _read_header(data)
        return self._made(header, bytearray(memoryview(data)[_HEADER.size : end]), 0), end

    def adopt(self, data: Buffer, dialect: Dialect) -> Image:  # noqa: ARG002
        """Decode an image whose pixels are a view of the message."""
        header, _ = _read_header(data)
        return self._made(header, data, _HEADER.size)

    def to_text(self, value: Image | NDArray[Any]) -> str:
        """Return the header's words and numbers and the bytes of the pixels, without the row order."""
        return decode_from(b"".join(self.encode(value, Dialect.YARP4)))[0].to_text()

    def _made(self, header: _Header, data: Buffer, start: int) -> Image:
        kind = pixel_format(header.pixel, header.depth)
        row, quantum = _layout(header, kind)
        strides = (row, kind.depth, kind.dtype.itemsize)
        shape = kind.shape(header.height, header.width)
        pixels: NDArray[Any] = np.ndarray(shape, kind.dtype, data, start, strides[: len(shape)])
        image = Image(pixels, kind, quantum)
        return image if self._code is None else image.to(self._code)


def is_image(data: Buffer) -> bool:
    """Return whether a message begins as an image does."""
    return data[: len(_BEGINNING)] == _BEGINNING


def _read_header(data: Buffer) -> tuple[_Header, int]:
    if len(data) < _HEADER.size:
        raise TruncatedBottleError(_HEADER.size)
    header = _Header._make(_HEADER.unpack_from(data))
    fixed = (header.kind, header.parts, header.mat_code, header.mat, header.pixel_code)
    if fixed != _FIXED or (header.numbers_code, header.numbers, header.blob_code) != (_NUMBERS, 5, _BLOB):
        raise BottleError(f"this is not an image: it begins with {bytes(data[:24])!r}")
    if min(header.width, header.height, header.size) < 0 or header.blob_size != header.size:
        raise BottleError(
            f"an image of {header.width} x {header.height} pixels in {header.size} bytes, of which {header.blob_size} "
            "are said to follow"
        )
    end = _HEADER.size + header.size
    if end > len(data):
        raise TruncatedBottleError(end)
    return header, end


def _layout(header: _Header, kind: PixelFormat) -> tuple[int, int]:
    """Return the size of a row and the quantum. Raises BottleError if they do not match the size."""
    if header.depth != kind.depth:
        raise BottleError(f"pixels {kind.code!r} have {kind.depth} bytes, not {header.depth}")
    quantum = header.quantum & _MAX_QUANTUM or 1
    least = header.width * kind.depth
    if _row(least, quantum) * header.height == header.size:
        return _row(least, quantum), quantum
    if least * header.height == header.size:  # rows without padding, despite the quantum
        return least, 1
    raise BottleError(
        f"{header.width} x {header.height} pixels {kind.code!r} in rows of multiples of {quantum} bytes do not make "
        f"{header.size} bytes"
    )


def _row(size: int, quantum: int) -> int:
    return -(-size // quantum) * quantum


class Image:
    """An image. ``pixels`` has the shape (height, width), or (height, width, channels).

    ``code`` is YARP's word for the pixel format, such as ``rgb``; None: the usual one for such an array. The pixels are
    not copied. Those of a received image may be read-only.
    """

    __slots__ = ("format", "pixels", "quantum")
    __hash__ = None  # type: ignore[assignment]  # the pixels can change
    codec: ClassVar[ImageCodec] = ImageCodec()

    def __init__(
        self, pixels: NDArray[Any], code: str | int | PixelFormat | None = None, quantum: int = QUANTUM
    ) -> None:
        if not isinstance(code, PixelFormat):
            code = usual_format(pixels) if code is None else pixel_format(code)
        self.format = code
        shape = self.format.shape(*pixels.shape[:2]) if pixels.ndim > 1 else ()
        if pixels.shape != shape or pixels.dtype != self.format.dtype:
            raise BottleTypeError(
                f"640 x 480 pixels {self.format.code!r} are an array of {self.format.dtype.name} of shape "
                f"{self.format.shape(480, 640)}; this is one of {pixels.dtype.name} of shape {pixels.shape}"
            )
        if not 1 <= quantum <= _MAX_QUANTUM:
            raise BottleTypeError(f"rows are filled up to a multiple of 1 to {_MAX_QUANTUM} bytes, not of {quantum}")
        self.pixels = pixels
        self.quantum = quantum

    @property
    def code(self) -> str | int:
        """The word for the pixel format, or its number if it has no word."""
        return self.format.code

    @property
    def width(self) -> int:
        """The number of pixels per row."""
        return int(self.pixels.shape[1])

    @property
    def height(self) -> int:
        """The number of rows; the first row is the top one."""
        return int(self.pixels.shape[0])

    def to(self, code: str | int) -> Image:
        """Return the image in another pixel format; itself if it has it. Raises BottleTypeError for unknown formats."""
        target = pixel_format(code)
        if target == self.format:
            return self
        return Image(convert(self.pixels, self.code, target.code), target.code, self.quantum)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Image):
            return NotImplemented
        return self.format == other.format and np.array_equal(self.pixels, other.pixels)

    def __repr__(self) -> str:
        return f"<Image {self.code} {self.width} x {self.height}>"


IMAGE = Image.codec
