"""Images as files, as YARP's data dumper writes them and its player reads them.

Colours are PPM files, one channel of 8 bits is a PGM file, depths are ``.float``: two 64-bit numbers, height and width,
then the pixels as 32-bit floats. PNG, JPEG and ``.floatzip`` (the same pixels, compressed by zlib) are read only.
"""

from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image as Pillow

from rtf.bottle import BottleError
from rtf.bottle.values import INT32_MAX
from rtf.middleware.types.image import Image
from rtf.recording.errors import RecordingError

if TYPE_CHECKING:
    from pathlib import Path
    from typing import Any

    from numpy.typing import NDArray

_SIZE = struct.Struct("<2Q")
_DEPTHS = (".float", ".floatzip")
_FLOAT = 4
DEPTH = "dec"


def write_picture(folder: Path, number: int, image: Image) -> str:
    """Write the file of an image; return its name. Raises OSError, and RecordingError for pixels that it cannot hold.

    As in YARP, what is neither grey nor a depth is written as red, green and blue, so an alpha channel is lost.
    """
    pixels = image.pixels
    if image.code == DEPTH:
        suffix, head = ".float", _SIZE.pack(image.height, image.width)
    elif pixels.dtype == np.uint8 and pixels.ndim == 2:  # noqa: PLR2004 - rows and columns
        suffix, head = ".pgm", b"P5\n%d %d\n255\n" % (image.width, image.height)
    else:
        suffix, head = ".ppm", b"P6\n%d %d\n255\n" % (image.width, image.height)
        try:
            pixels = image.to("rgb").pixels
        except BottleError:
            raise RecordingError(
                f"{folder}: the data dumper's format has no place for pixels {image.code!r}; record them as MCAP"
            ) from None
    name = f"{number:08d}{suffix}"
    with (folder / name).open("wb") as file:
        file.write(head)
        file.write(np.ascontiguousarray(pixels).data)
    return name


def read_picture(path: Path, code: str) -> Image:
    """Read the file of an image whose pixels had the format ``code``. Raises RecordingError."""
    try:
        if path.suffix in _DEPTHS:
            return Image(_depths(path), DEPTH)
        with Pillow.open(path, formats=("PPM", "PNG", "JPEG")) as picture:
            grey = picture.mode == "L"
            pixels = np.asarray(picture if grey else picture.convert("RGB"))
    except (OSError, ValueError, SyntaxError, zlib.error, Pillow.DecompressionBombError) as error:
        raise RecordingError(f"{path}: this image cannot be read: {error}") from None
    try:
        if grey:
            return Image(pixels, "mono").to(code) if code in _COLOURS else Image(pixels, code or "mono")
        return Image(pixels, "rgb").to(code or "rgb")
    except BottleError as error:
        raise RecordingError(f"{path}: {error}") from None


#: Colours into which a grey picture, such as a JPEG file of a colour image, is converted.
_COLOURS = ("rgb", "bgr", "rgba", "bgra", "hsv")


def _depths(path: Path) -> NDArray[Any]:
    data = path.read_bytes()
    if len(data) < _SIZE.size:
        raise RecordingError(f"{path}: {len(data)} bytes are no image of depths")
    height, width = _SIZE.unpack_from(data)
    size = height * width * _FLOAT
    if size > INT32_MAX or max(height, width) > INT32_MAX:
        raise RecordingError(f"{path}: an image of {width} x {height} depths is too large for a message")
    rest = data[_SIZE.size :]
    if path.suffix == ".floatzip":
        rest = zlib.decompressobj().decompress(rest, size + 1)
    if len(rest) != size:
        raise RecordingError(f"{path}: {width} x {height} depths are {size} bytes, but there are {len(rest)}")
    return np.frombuffer(rest, "<f4").reshape(height, width)
