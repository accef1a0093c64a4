"""What holds for every codec, whatever it writes."""

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
    """Subclasses say which codec, and objects that it can write."""

    codec: ClassVar[Codec[Any]]
    values: ClassVar[list[Any]]
    #: Whether ``codec_of`` finds it for each of the objects.
    is_found: ClassVar[bool] = True
    #: Whether its bytes are a bottle, so that others can tell where they end.
    is_bottle = True

    def bytes_of(self, value: object, dialect: Dialect) -> bytes:
        """All blocks together."""
        return b"".join(self.codec.encode(value, dialect))

    def cases(self) -> list[tuple[Any, Dialect, bytes]]:
        """Every object in both dialects."""
        return [(value, dialect, self.bytes_of(value, dialect)) for value in self.values for dialect in Dialect]

    def assert_same(self, one: object, other: object) -> None:
        """Two objects are of one type and equal."""
        assert type(one) is type(other)
        if isinstance(one, np.ndarray):
            assert one.dtype == other.dtype
            np.testing.assert_array_equal(one, other)
        else:
            assert one == other

    def test_what_is_written_reads_back(self):
        """An object survives the wire in both dialects."""
        for value, dialect, data in self.cases():
            self.assert_same(self.codec.decode(data, dialect), value)
            self.assert_same(self.codec.adopt(bytearray(data), dialect), value)

    def test_blocks_are_flat_bytes(self):
        """The length of each block is its size, as the index of a message and the kernel need it."""
        for value in self.values:
            for block in self.codec.encode(value, Dialect.YARP3):
                assert len(memoryview(block)) == memoryview(block).nbytes == len(bytes(block))

    def test_the_end_is_found_whatever_follows(self):
        """An object is read from the start of a buffer that holds more, and says where it ends."""
        for value, dialect, data in self.cases():
            for more in (b"", b"YA\0\0\0\0RP"):
                read, end = self.codec.decode_from(memoryview(bytearray(data + more)), dialect)
                assert end == len(data)
                self.assert_same(read, value)

    def test_the_bytes_are_a_bottle(self):
        """Everything that travels can be shown by who does not know its type."""
        for _, dialect, data in self.cases():
            assert not self.is_bottle or extent(data, 0, dialect) == len(data)

    def test_what_is_cut_off_says_what_it_needs(self):
        """Cut off anywhere, it asks for more than there is and no more than there will be."""
        for _, dialect, data in self.cases():
            for size in range(len(data)):
                with pytest.raises(TruncatedBottleError) as caught:
                    self.codec.decode_from(data[:size], dialect)
                assert size < caught.value.needed <= len(data)

    def test_what_was_read_is_its_owners(self):
        """The buffer of a message is used again; what was read from it does not change."""
        for value, dialect, data in self.cases():
            buffer = bytearray(data)
            read = self.codec.decode(memoryview(buffer), dialect)
            buffer[:] = bytes(len(buffer))
            self.assert_same(read, value)

    def test_text_reads_back(self):
        """What a person sees is what a person can type."""
        for value in self.values:
            self.assert_same(self.codec.from_text(self.codec.to_text(value)), value)

    def test_damaged_bytes_are_refused_or_read(self):
        """Changed, cut and random bytes give an object or our own error, and nothing else."""
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
        """A port that is given an object knows how to send it."""
        for value in self.values:
            found = codec_of(value)
            if self.is_found:
                assert b"".join(found.encode(value, Dialect.YARP4)) == self.bytes_of(value, Dialect.YARP4)


class TestBottle(CodecContract):
    """Bottles."""

    codec = BOTTLE
    values: ClassVar = [WORDS, Bottle(), Bottle([Property({"a": 1})])]

    def test_text_reads_back(self):
        """Text cannot tell a property from a list of lists; all else survives."""
        for value in self.values[:2]:
            assert BOTTLE.from_text(BOTTLE.to_text(value)) == value


class TestProperty(CodecContract):
    """Properties."""

    codec = PROPERTY
    values: ClassVar = [Property(), Property({"key": "value", "list": [1, 2.0]})]


class TestString(CodecContract):
    """Strings."""

    codec = STRING
    values: ClassVar = ["", "hello", "two words", "caf\u00e9 \udcff\0"]


class TestBytes(CodecContract):
    """Blobs."""

    codec = BYTES
    values: ClassVar = [b"", b"\0\1\2"]


class TestRaw(CodecContract):
    """Bytes that are taken as they are."""

    codec = RAW
    values: ClassVar = [encode(WORDS)]
    is_found = False  # bytes that are sent are a blob

    def cases(self) -> list[tuple[Any, Dialect, bytes]]:
        """Bytes have no dialect."""
        return [(value, Dialect.YARP3, value) for value in self.values]


class TestVector(CodecContract):
    """Vectors of doubles."""

    codec = VECTOR
    values: ClassVar = [np.array([]), np.array([1.5]), np.linspace(-1, 1, 53)]


class TestVectorOfInt8(CodecContract):
    """Vectors of other types, the shortest first."""

    codec = vector_of(np.int8)
    values: ClassVar = [np.array([-128, 0, 127], np.int8)]


class TestVectorOfInt16(CodecContract):
    """Vectors of 16 bits."""

    codec = vector_of("i2")
    values: ClassVar = [np.array([-(2**15), 2**15 - 1], np.int16)]


class TestVectorOfInt32(CodecContract):
    """Vectors of YARP's own integers."""

    codec = vector_of(np.int32)
    values: ClassVar = [np.array([-(2**31), 2**31 - 1, 0], np.int32), np.array([], np.int32)]


class TestVectorOfInt64(CodecContract):
    """Vectors of long integers."""

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
    """Images, with rows that are filled up and without."""

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
        """Part by part."""
        assert isinstance(one, Pair)
        assert isinstance(other, Pair)
        super().assert_same(one.first, other.first)
        super().assert_same(one.second, other.second)


class TestRecord(CodecContract):
    """What services say to each other; what is read are the elements."""

    codec = Record.codec
    values: ClassVar = [Record(), Record(Vocab("get"), "phase", 3, 1.5, b"\1", Bottle([1, 2]))]


class TestProtocolVersion(CodecContract):
    """The one answer that is no bottle."""

    codec = ProtocolVersion.codec
    values: ClassVar = [ProtocolVersion(0, 3, 12, 3)]
    is_bottle = False
