"""The contract of codecs: one class of tests for all of them."""

from __future__ import annotations

import contextlib
import random
from typing import Any, ClassVar

import numpy as np
import pytest

from rtf.bottle import Bottle, Dialect, Property, Vocab
from rtf.bottle.binary import TruncatedBottleError, encode, extent
from rtf.errors import RtfError
from rtf.middleware.types import (
    BYTES,
    IMAGE,
    MATRIX,
    PROPERTY,
    SOUND,
    STAMP,
    STRING,
    VECTOR,
    Image,
    Pair,
    PairCodec,
    ProtocolVersion,
    Record,
    Sound,
    Stamp,
    vector_of,
)
from rtf.middleware.types.codecs import BOTTLE, RAW, Codec, codec_of

WORDS = Bottle.parse('[set] [pos] 0 10.0 "a b" (1 2) {1 2}')
PIXELS = np.arange(5 * 7 * 3, dtype=np.uint8).reshape(5, 7, 3)


class CodecContract:
    """The tests; subclasses provide the codec and objects."""

    codec: ClassVar[Codec[Any]]
    values: ClassVar[list[Any]]
    #: Whether ``codec_of`` finds it for each of the objects.
    is_found: ClassVar[bool] = True
    #: Whether its bytes are a bottle, so that other programs find their end.
    is_bottle = True

    def bytes_of(self, value: object, dialect: Dialect) -> bytes:
        """Return the encoded object."""
        return b"".join(self.codec.encode(value, dialect))

    def cases(self) -> list[tuple[Any, Dialect, bytes]]:
        """Return every object in both dialects, with its bytes."""
        return [(value, dialect, self.bytes_of(value, dialect)) for value in self.values for dialect in Dialect]

    def assert_same(self, one: object, other: object) -> None:
        """Check that two objects have one type and are equal."""
        assert type(one) is type(other)
        if isinstance(one, np.ndarray):
            assert one.dtype == other.dtype
            np.testing.assert_array_equal(one, other)
        else:
            assert one == other

    def test_what_is_written_reads_back(self):
        """An object is the same after encoding and decoding, in both dialects."""
        for value, dialect, data in self.cases():
            self.assert_same(self.codec.decode(data, dialect), value)
            self.assert_same(self.codec.adopt(bytearray(data), dialect), value)

    def test_blocks_are_flat_bytes(self):
        """The length of each encoded block is its size in bytes, as the message's index needs it."""
        for value in self.values:
            for block in self.codec.encode(value, Dialect.YARP3):
                assert len(memoryview(block)) == memoryview(block).nbytes == len(bytes(block))

    def test_the_end_is_found_whatever_follows(self):
        """``decode_from`` returns the end of the object, also if other bytes follow."""
        for value, dialect, data in self.cases():
            for more in (b"", b"YA\0\0\0\0RP"):
                read, end = self.codec.decode_from(memoryview(bytearray(data + more)), dialect)
                assert end == len(data)
                self.assert_same(read, value)

    def test_the_bytes_are_a_bottle(self):
        """Encoded objects are bottles, so that tools can show them without their codec."""
        for _, dialect, data in self.cases():
            assert not self.is_bottle or extent(data, 0, dialect) == len(data)

    def test_what_is_cut_off_says_what_it_needs(self):
        """The error about a truncated object has the number of needed bytes, at most those of the object."""
        for _, dialect, data in self.cases():
            for size in range(len(data)):
                with pytest.raises(TruncatedBottleError) as caught:
                    self.codec.decode_from(data[:size], dialect)
                assert size < caught.value.needed <= len(data)

    def test_what_was_read_is_its_owners(self):
        """A decoded object does not change when its buffer is used again."""
        for value, dialect, data in self.cases():
            buffer = bytearray(data)
            read = self.codec.decode(memoryview(buffer), dialect)
            buffer[:] = bytes(len(buffer))
            self.assert_same(read, value)

    def test_text_reads_back(self):
        """An object is the same after it is written as text and read again."""
        for value in self.values:
            self.assert_same(self.codec.from_text(self.codec.to_text(value)), value)

    def test_damaged_bytes_are_refused_or_read(self):
        """Damaged bytes decode to an object, or raise RtfError."""
        chance = random.Random(11)
        cases = self.cases()
        for _ in range(500):
            _, dialect, data = chance.choice(cases)
            damaged = bytearray(data) if chance.random() < 0.8 else bytearray(chance.randbytes(80))
            for _ in range(chance.randint(1, 4)):
                at = chance.randrange(len(damaged))
                damaged[at] = chance.choice((damaged[at] ^ 1 << chance.randrange(8), 0xFF, 0, 0x7F))
            for read in (self.codec.decode, self.codec.adopt, self.codec.decode_from):
                with contextlib.suppress(RtfError):
                    read(bytes(damaged), dialect)

    def test_it_is_found_for_its_objects(self):
        """``codec_of`` finds the codec of an object."""
        for value in self.values:
            found = codec_of(value)
            if self.is_found:
                assert b"".join(found.encode(value, Dialect.YARP4)) == self.bytes_of(value, Dialect.YARP4)


class TestBottle(CodecContract):
    """The codec of bottles."""

    codec = BOTTLE
    values: ClassVar = [WORDS, Bottle(), Bottle([Property({"a": 1})])]

    def test_text_reads_back(self):
        """Bottles without properties survive as text; text cannot tell a property from a list of lists."""
        for value in self.values[:2]:
            assert BOTTLE.from_text(BOTTLE.to_text(value)) == value


class TestProperty(CodecContract):
    """The codec of properties."""

    codec = PROPERTY
    values: ClassVar = [Property(), Property({"key": "value", "list": [1, 2.0]})]


class TestString(CodecContract):
    """The codec of strings."""

    codec = STRING
    values: ClassVar = ["", "hello", "two words", "caf\u00e9 \udcff\0"]


class TestBytes(CodecContract):
    """The codec of bytes."""

    codec = BYTES
    values: ClassVar = [b"", b"\0\1\2"]


class TestRaw(CodecContract):
    """The codec of raw bytes."""

    codec = RAW
    values: ClassVar = [encode(WORDS)]
    is_found = False  # bytes that are sent are a blob

    def cases(self) -> list[tuple[Any, Dialect, bytes]]:
        """Raw bytes are the same in both dialects."""
        return [(value, Dialect.YARP3, value) for value in self.values]


class TestVector(CodecContract):
    """Vectors of doubles."""

    codec = VECTOR
    values: ClassVar = [np.array([]), np.array([1.5]), np.linspace(-1, 1, 53)]


class TestVectorOfInt8(CodecContract):
    """Vectors of 8-bit integers."""

    codec = vector_of(np.int8)
    values: ClassVar = [np.array([-128, 0, 127], np.int8)]


class TestVectorOfInt16(CodecContract):
    """Vectors of 16-bit integers."""

    codec = vector_of("i2")
    values: ClassVar = [np.array([-(2**15), 2**15 - 1], np.int16)]


class TestVectorOfInt32(CodecContract):
    """Vectors of 32-bit integers."""

    codec = vector_of(np.int32)
    values: ClassVar = [np.array([-(2**31), 2**31 - 1, 0], np.int32), np.array([], np.int32)]


class TestVectorOfInt64(CodecContract):
    """Vectors of 64-bit integers."""

    codec = vector_of(np.int64)
    values: ClassVar = [np.array([-(2**63), 2**63 - 1], np.int64)]


class TestVectorOfFloat32(CodecContract):
    """Vectors of single precision."""

    codec = vector_of(np.float32)
    values: ClassVar = [np.array([0.1, -3e38], np.float32)]


class TestMatrix(CodecContract):
    """Matrices."""

    codec = MATRIX
    values: ClassVar = [np.eye(3), np.zeros((0, 4)), np.arange(6.0).reshape(2, 3)]


class TestImage(CodecContract):
    """Images with and without padded rows."""

    codec = IMAGE
    values: ClassVar = [
        Image(PIXELS),
        Image(PIXELS[..., 0].copy(), "mono", quantum=1),
        Image(np.linspace(0, 1, 6, dtype=np.float32).reshape(2, 3)),
        Image(np.zeros((0, 0), np.uint8)),
        Image(PIXELS[:2, :2], -3),
    ]


class TestSound(CodecContract):
    """Sounds."""

    codec = SOUND
    values: ClassVar = [
        Sound(np.arange(-6, 6, dtype=np.int16).reshape(2, 6), 44100),
        Sound(np.zeros((1, 0), np.int16), 8000),
    ]


class TestStamp(CodecContract):
    """Stamps."""

    codec = STAMP
    values: ClassVar = [Stamp(213, 1795210389.10542), Stamp(0, 0.0), Stamp()]


class TestPair(CodecContract):
    """Pairs of which both parts have codecs."""

    codec = PairCodec(BOTTLE, VECTOR)
    values: ClassVar = [Pair(Bottle.parse("[dpo] 0"), np.array([7.5]))]

    def assert_same(self, one: object, other: object) -> None:
        """Compare both parts."""
        assert isinstance(one, Pair)
        assert isinstance(other, Pair)
        super().assert_same(one.first, other.first)
        super().assert_same(one.second, other.second)


class TestRecord(CodecContract):
    """Records of services, which decode to their elements."""

    codec = Record.codec
    values: ClassVar = [Record(), Record(Vocab("get"), "phase", 3, 1.5, b"\1", Bottle([1, 2]))]


class TestProtocolVersion(CodecContract):
    """The version of a protocol, whose bytes are no bottle."""

    codec = ProtocolVersion.codec
    values: ClassVar = [ProtocolVersion(0, 3, 12, 3)]
    is_bottle = False
