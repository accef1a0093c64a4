"""Sounds: numpy arrays of 16-bit samples with a sampling frequency.

On the wire the samples are ordered channel after channel. YARP before 3.10 sent an image instead, which is not
supported.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from rtf.bottle import Bottle, BottleError, BottleTypeError, Dialect
from rtf.bottle.binary import LIST, TruncatedBottleError, encode, extent
from rtf.bottle.values import INT32_MAX, Kind
from rtf.middleware.types.codecs import TextCodec
from rtf.middleware.types.vector import SMALL, vector_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rtf.middleware.types.codecs import Buffer

_HEAD = struct.Struct("<10i")
_INT32 = Kind.INT32.value
_SAMPLES = vector_of("i2")
_WIDTH = 2
#: The number of elements of the list; in YARP 4.0 the last one is a list of markers.
_PARTS = {Dialect.YARP3: 5, Dialect.YARP4: 6}
_NO_MARKERS = encode(Bottle())


class SoundCodec(TextCodec["Sound"]):
    """Codec of sounds."""

    promise = "yarp/sound"

    def encode(self, value: Sound, dialect: Dialect) -> Sequence[Buffer]:
        """Return a header and the memory of the samples, joined if they are few."""
        channels, samples = value.samples.shape
        numbers = (samples, channels, _WIDTH, value.frequency)
        head = _HEAD.pack(LIST, _PARTS[dialect], *(part for number in numbers for part in (_INT32, number)))
        first, *rest = _SAMPLES.encode(value.samples.reshape(-1), dialect)
        blocks: list[Buffer] = [head + first, *rest]
        if dialect is Dialect.YARP4:
            blocks.append(_NO_MARKERS)
        return blocks if value.samples.nbytes > SMALL else (b"".join(blocks),)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[Sound, int]:
        sound, end = self._view(data, dialect)
        return Sound(sound.samples.copy(), sound.frequency), end

    def adopt(self, data: Buffer, dialect: Dialect) -> Sound:
        """Decode a sound whose samples are a view of the message."""
        return self._view(data, dialect)[0]

    def _view(self, data: Buffer, dialect: Dialect) -> tuple[Sound, int]:
        if len(data) < _HEAD.size:
            raise TruncatedBottleError(_HEAD.size)
        kind, parts, *numbers = _HEAD.unpack_from(data)
        if kind != LIST or parts not in _PARTS.values() or any(code != _INT32 for code in numbers[::2]):
            raise BottleError(f"this is not a sound: it begins with {bytes(data[:16])!r}")
        samples, channels, width, frequency = numbers[1::2]
        if width != _WIDTH:
            raise BottleError(f"a sound of {width} bytes a sample; only {_WIDTH} are supported")
        values, end = _SAMPLES.view_from(data, dialect, _HEAD.size)
        if samples < 0 or channels < 0 or samples * channels != values.size:
            raise BottleError(f"a sound of {samples} samples in {channels} channels with {values.size} values")
        if parts == _PARTS[Dialect.YARP4]:
            end = extent(data, end, dialect)
        return Sound(values.reshape(channels, samples), frequency), end


class Sound:
    """A sound. ``samples`` are 16-bit integers of the shape (channels, samples), ``frequency`` is in Hz."""

    __slots__ = ("frequency", "samples")
    __hash__ = None  # type: ignore[assignment]  # the samples can change
    codec: ClassVar[SoundCodec] = SoundCodec()

    def __init__(self, samples: NDArray[Any], frequency: int) -> None:
        if samples.ndim == 1:
            samples = samples.reshape(1, -1)
        if samples.dtype != np.int16 or samples.ndim != 2:  # noqa: PLR2004 - channels and samples
            raise BottleTypeError(
                f"a sound is an array of int16 of shape (channels, samples), not one of {samples.dtype.name} of shape "
                f"{samples.shape}"
            )
        if samples.size > INT32_MAX // _WIDTH or not -INT32_MAX <= frequency <= INT32_MAX:
            raise BottleTypeError(f"a sound of {samples.size} values at {frequency} Hz does not fit into a message")
        self.samples = samples
        self.frequency = frequency

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Sound):
            return NotImplemented
        return self.frequency == other.frequency and np.array_equal(self.samples, other.samples)

    def __repr__(self) -> str:
        channels, samples = self.samples.shape
        return f"<Sound {channels} x {samples} at {self.frequency} Hz>"


SOUND = Sound.codec
