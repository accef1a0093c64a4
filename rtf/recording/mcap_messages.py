"""The messages in MCAP files: images as ``sensor_msgs/msg/Image`` of ROS 2, all others as JSON.

Foxglove shows both without an extension. JSON has the stamp and, as ``values``, every number of the message in its
order, null for what is none. A message that is more than a row of 32-bit integers and 64-bit floats is in ``data``,
too, as its bytes in YARP 4's form, and one with words in ``text``. Schemas have objects, texts, numbers and flat arrays
only: Foxglove reads no alternatives, so they do not say where a number may be null.
"""

from __future__ import annotations

import struct
from math import floor, isfinite
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from rtf.bottle import Bottle, Dialect
from rtf.bottle.binary import decode_from, encode
from rtf.bottle.containers import Container
from rtf.bottle.values import INT32_MAX
from rtf.errors import RtfError
from rtf.middleware.types.image import Image
from rtf.middleware.types.pixels import pixel_format
from rtf.middleware.types.stamp import Stamp
from rtf.recording.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rtf.bottle import Value

BOTTLE_SCHEMA = "rtf.Bottle"
IMAGE_SCHEMA = "sensor_msgs/msg/Image"

BOTTLE_DEFINITION = msgspec.json.encode(
    {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": BOTTLE_SCHEMA,
        "description": "a message of YARP",
        "type": "object",
        "properties": {
            "count": {"type": "number", "description": "the number that the sender gave it, -1 without one"},
            "time": {"type": "number", "description": "the time that the sender wrote on it, in seconds"},
            "values": {
                "type": "array",
                "items": {"type": "number"},
                "description": "every number of the message, null for what is none",
            },
            "text": {"type": "string", "description": "the message as YARP prints it"},
            "data": {"type": "string", "contentEncoding": "base64", "description": "its bytes, as YARP 4 sends them"},
        },
    }
)
#: The definition, with those of its parts, as the registry of MCAP asks for it.
IMAGE_DEFINITION = b"""std_msgs/Header header
uint32 height
uint32 width
string encoding
uint8 is_bigendian
uint32 step
uint8[] data
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
_ENCODINGS = {
    "rgb": "rgb8",
    "bgr": "bgr8",
    "rgba": "rgba8",
    "bgra": "bgra8",
    "mono": "mono8",
    "mo16": "mono16",
    "dec": "32FC1",
    "rggb": "bayer_rggb8",
    "bggr": "bayer_bggr8",
    "gbrg": "bayer_gbrg8",
    "grbg": "bayer_grbg8",
}
_CODES = {encoding: code for code, encoding in _ENCODINGS.items()}
#: Pixel formats that ROS has no word for.
_OTHER = "yarp/"
_CDR = b"\0\1\0\0"  # little-endian
NANO = 1_000_000_000
_PLAIN = frozenset((int, float))


class Message(msgspec.Struct, omit_defaults=True):
    """A message as JSON."""

    count: int = -1
    time: float = 0.0
    values: list[int | float | None] = []
    text: str = ""
    data: bytes = b""


_encode = msgspec.json.Encoder().encode
_decode = msgspec.json.Decoder(Message).decode


def nanoseconds(seconds: float) -> int:
    """Return a finite time as MCAP and ROS have it; a time of this century divided by ``NANO`` is the same again."""
    whole = floor(seconds)
    return whole * NANO + round((seconds - whole) * NANO)


def bottle_to_json(bottle: Bottle, stamp: Stamp) -> bytes:
    """Return a message as JSON."""
    values: list[Any] = [*bottle]
    if _PLAIN.issuperset(map(type, values)) and isfinite(sum(values)):
        return _encode(Message(stamp.count, stamp.time, values))
    numbers = [*_numbers(values)]
    text = bottle.to_text() if None in numbers else ""
    return _encode(Message(stamp.count, stamp.time, numbers, text, encode(bottle, Dialect.YARP4)))


def _numbers(values: Iterable[Value]) -> Iterable[int | float | None]:
    for value in values:
        if isinstance(value, Container):
            yield from _numbers(value.elements())
        elif isinstance(value, float):
            yield float(value)
        else:
            yield int(value) if isinstance(value, int) else None


def json_to_bottle(data: bytes) -> tuple[Bottle, Stamp]:
    """Return the message of a JSON text with its stamp. Raises RecordingError."""
    try:
        message = _decode(data)
        stamp = Stamp(message.count, message.time) if 0 <= message.count <= INT32_MAX else Stamp()
        if message.data:
            return decode_from(message.data, 0, Dialect.YARP4)[0], stamp
        numbers = [float("nan") if value is None else value for value in message.values]
    except (msgspec.MsgspecError, RtfError, UnicodeError) as error:
        raise RecordingError(str(error)) from None
    if any(type(number) is int and not -INT32_MAX - 1 <= number <= INT32_MAX for number in numbers):
        raise RecordingError("a number has more than 32 bits, and the message no 'data'")
    return Bottle(numbers), stamp


def image_to_cdr(image: Image, stamp: Stamp, frame: str) -> bytes:
    """Return an image as ROS 2 sends it. Without a stamp its time is 0, as is usual there."""
    kind = image.format
    encoding = _ENCODINGS.get(str(kind.code), f"{_OTHER}{kind.code}")
    seconds, nano = divmod(nanoseconds(stamp.time), NANO) if stamp.valid else (0, 0)
    if not -INT32_MAX <= seconds <= INT32_MAX:
        seconds, nano = 0, 0
    pixels = np.ascontiguousarray(image.pixels)
    head = struct.pack("<iI", seconds, nano) + _string(frame)
    head = _padded(head) + struct.pack("<2I", image.height, image.width) + _string(encoding) + b"\0"
    head = _padded(head) + struct.pack("<2I", image.width * kind.depth, pixels.nbytes)
    return b"".join((_CDR, head, pixels.data.cast("B") if pixels.nbytes else b""))


def cdr_to_image(data: bytes, count: int) -> tuple[Image, Stamp]:
    """Return the image of a message of ROS 2; its stamp has the number ``count``. Raises RecordingError."""
    try:
        if data[: len(_CDR)] != _CDR:
            raise RecordingError("this is not the little-endian CDR of an image")
        body = memoryview(data)[len(_CDR) :]
        seconds, nano = struct.unpack_from("<iI", body)
        _, end = _read_string(body, 8)
        end = _aligned(end)
        height, width = struct.unpack_from("<2I", body, end)
        encoding, end = _read_string(body, end + 8)
        end = _aligned(end + 1)
        step, size = struct.unpack_from("<2I", body, end)
        pixels = body[end + 8 : end + 8 + size]
        image = _image(pixels, height, width, step, encoding)
    except (struct.error, RtfError, UnicodeError) as error:
        raise RecordingError(f"an image that cannot be read: {error}") from None
    stamp = Stamp(count, (seconds * NANO + nano) / NANO) if (seconds or nano) and 0 <= count <= INT32_MAX else Stamp()
    return image, stamp


def _image(pixels: memoryview, height: int, width: int, step: int, encoding: str) -> Image:
    code: str | int = _CODES.get(encoding, encoding.removeprefix(_OTHER))
    if encoding not in _CODES and not encoding.startswith(_OTHER):
        raise RecordingError(f"pixels {encoding[:40]!r} have no format in YARP")
    if isinstance(code, str) and code.removeprefix("-").isdecimal():
        code = int(code[:11])
    kind = pixel_format(code, step // width if width else 0)
    if not 0 <= height * step == len(pixels) or step < width * kind.depth:
        raise RecordingError(f"{height} rows of {step} bytes with {width} pixels are not {len(pixels)} bytes")
    strides = (step, kind.depth, kind.dtype.itemsize)
    shape = kind.shape(height, width)
    return Image(np.ndarray(shape, kind.dtype, pixels, 0, strides[: len(shape)]), kind)


def _string(text: str) -> bytes:
    data = text.encode("utf-8", "replace")
    return struct.pack("<I", len(data) + 1) + data + b"\0"


def _read_string(data: memoryview, start: int) -> tuple[str, int]:
    (size,) = struct.unpack_from("<I", data, start)
    end = start + 4 + size
    return bytes(data[start + 4 : end]).rstrip(b"\0").decode(), end


def _aligned(place: int) -> int:
    return -(-place // 4) * 4


def _padded(data: bytes) -> bytes:
    return data.ljust(_aligned(len(data)), b"\0")
