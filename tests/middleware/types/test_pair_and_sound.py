"""Pairs, sounds, and values that are sent alone."""

from __future__ import annotations

import numpy as np
import pytest

from rtf.bottle import Bottle, BottleError, BottleTypeError, Dialect, Property
from rtf.bottle.binary import LARGE_BLOB, decode, encode
from rtf.middleware.types import BYTES, IMAGE, PROPERTY, SOUND, STRING, VECTOR, Image, Pair, PairCodec, Sound
from rtf.middleware.types.codecs import BOTTLE

THREE, FOUR = Dialect.YARP3, Dialect.YARP4


def written(value, dialect: Dialect = THREE) -> str:
    """Return the bytes of an object in hexadecimal."""
    return b"".join(value.codec.encode(value, dialect)).hex()


def test_a_command_with_numbers():
    """A command with a vector has the bytes of a real client."""
    pair = Pair(Bottle.parse("[dpo] 0"), np.array([7.5]))
    assert written(pair) == (
        "00010000 02000000 00010000 02000000 09000000 64706f00 01000000 00000000 0a010000 01000000 0000000000001e40"
    ).replace(" ", "")
    read = PairCodec(BOTTLE, VECTOR).decode(bytes.fromhex(written(pair)), THREE)
    assert read.first == pair.first
    assert isinstance(read.second, np.ndarray)


def test_a_pair_may_be_typed():
    """A pair is read from a text of two lists."""
    read = PairCodec(BOTTLE, VECTOR).from_text("([dpo] 0) (7 8.5)")
    assert read.first == Bottle.parse("[dpo] 0")
    np.testing.assert_array_equal(read.second, [7, 8.5])
    for text in ("1 2 3", "", "(1) (2) (3)"):
        with pytest.raises(BottleError, match="a pair is a list of two"):
            PairCodec(BOTTLE, VECTOR).from_text(text)


def test_large_parts_of_a_pair_are_not_copied():
    """Large parts of a pair are encoded and adopted without a copy."""
    pixels = np.zeros((100, 100, 4), np.uint8)
    pair = Pair("seen", Image(pixels))
    blocks = pair.codec.encode(pair, THREE)
    assert np.shares_memory(np.frombuffer(blocks[-1], np.uint8), pixels)
    data = bytearray(b"".join(blocks))
    read = PairCodec(STRING, IMAGE).adopt(data, THREE)
    assert (read.first, read.second) == ("seen", Image(pixels))
    assert np.shares_memory(read.second.pixels, np.frombuffer(data, np.uint8))
    with pytest.raises(BottleError):
        PairCodec(IMAGE, STRING).decode(data, THREE)


def test_a_sound_is_a_list_of_five_or_six():
    """A sound has samples, channels, bytes, frequency, and samples by channel; in 4.0 also markers."""
    sound = Sound(np.array([[1, 2], [3, 4]], np.int16), 8000)
    assert decode(bytes.fromhex(written(sound))).to_text() == "2 2 2 8000 (1 2 3 4)"
    assert decode(bytes.fromhex(written(sound, FOUR)), FOUR).to_text() == "2 2 2 8000 (1 2 3 4) ()"
    marked = bytes.fromhex(written(sound, FOUR))[:-8] + encode(Bottle(["mark", 3]), FOUR)
    assert SOUND.decode_from(marked, FOUR) == (sound, len(marked))
    assert SOUND.decode(bytes.fromhex(written(sound)), FOUR) == sound


def test_samples_are_not_copied():
    """Many samples are encoded and adopted without a copy."""
    samples = np.zeros((2, 44100), np.int16)
    blocks = SOUND.encode(Sound(samples, 44100), FOUR)
    assert np.shares_memory(np.frombuffer(blocks[1], np.int16), samples)
    data = bytearray(b"".join(blocks))
    assert np.shares_memory(SOUND.adopt(data, FOUR).samples, np.frombuffer(data, np.uint8))


def test_one_channel_may_be_a_plain_array():
    """A one-dimensional array is a sound of one channel; other arrays are refused."""
    assert Sound(np.zeros(5, np.int16), 8000).samples.shape == (1, 5)
    for samples in (np.zeros(5), np.zeros((1, 2, 3), np.int16)):
        with pytest.raises(BottleTypeError, match="array of int16"):
            Sound(samples, 8000)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("2 2 2 8000 (1 2 3)", "2 samples in 2 channels with 3 values"),
        ("-2 -2 2 8000 (1 2 3 4)", "-2 samples"),
        ("2 2 4 8000 (1 2 3 4)", "4 bytes a sample"),
        ("2 2 2.0 8000 (1 2 3 4)", "not a sound"),
        ("2 2 2 8000 (1 2 3 99999)", "does not fit into int16"),
        ("[mat] [mono] (1 2 3 4 5) {1 2 3 4 5 6}", "not a sound"),
    ],
)
def test_sounds_that_are_none_are_refused(text: str, message: str):
    """A sound whose numbers do not fit its samples is refused."""
    with pytest.raises(BottleError, match=message):
        SOUND.from_text(text)


def test_a_string_alone():
    """A string is a bottle of one string; any other bottle decodes to its text."""
    assert b"".join(STRING.encode("run", THREE)).hex() == "040100000100000003000000" + b"run".hex()
    assert STRING.decode(encode(Bottle.parse("[set] 1 (2 3)")), THREE) == "[set] 1 (2 3)"


def test_bytes_alone():
    """Bytes of any buffer are a bottle of one blob, and large ones are not copied."""
    for value in (b"abc", bytearray(b"abc"), memoryview(b"abc"), np.frombuffer(b"abc", np.uint8)):
        assert b"".join(BYTES.encode(value, FOUR)) == encode(Bottle([b"abc"]))
    large = bytes(LARGE_BLOB)
    head, body = BYTES.encode(large, THREE)
    assert body.obj is large
    assert bytes(head) + large == encode(Bottle([large]))
    with pytest.raises(BottleError, match="expected bytes"):
        BYTES.decode(encode(Bottle(["abc"])), THREE)


def test_a_dictionary_is_a_property():
    """A dictionary is encoded as a property, with its dictionaries as properties inside."""
    data = b"".join(PROPERTY.encode({"a": 1, "list": [1, 2.5], "in": {"b": "x"}}, THREE))
    read = PROPERTY.decode(data, THREE)
    assert read.find("a") == 1
    assert read.find("list") == Bottle([1, 2.5])
    assert read.find("in") == Property({"b": "x"})
    assert data == encode(read)
