"""Codecs: which one an object has, which modules it loads, and raw bytes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from rtf.bottle import Bottle, Dialect, Property
from rtf.bottle.binary import encode
from rtf.middleware.errors import ProtocolError
from rtf.middleware.types import (
    BYTES,
    IMAGE,
    MATRIX,
    PROPERTY,
    STRING,
    VECTOR,
    Image,
    Pair,
    Record,
    Stamp,
)
from rtf.middleware.types.codecs import BOTTLE, RAW, Codec, RawCodec, codec_of
from rtf.middleware.wire.outgoing_message import OutgoingMessage

THREE = Dialect.YARP3
BOTTLES = Bottle([["a", index, [index / 2]] for index in range(300)])


@pytest.mark.parametrize(
    ("value", "codec"),
    [
        (Bottle([1]), BOTTLE),
        (Property(), BOTTLE),
        ("hello", STRING),
        (b"abc", BYTES),
        (bytearray(b"abc"), BYTES),
        ({"a": 1}, PROPERTY),
        (np.zeros(3), VECTOR),
        (np.eye(2), MATRIX),
        (Image(np.zeros((2, 2), np.uint8)), IMAGE),
        (Stamp(), Stamp.codec),
        (Record(), Record.codec),
    ],
)
def test_an_object_has_a_codec(value: object, codec: Codec[object]):
    """Objects of these types are sent without naming a codec."""
    assert codec_of(value) is codec


def test_a_message_whose_bytes_are_there_has_its_size():
    """A thread that asks while another one encodes the message, as for the page of its port, gets the right size."""
    sizes: list[int] = []

    class Blocks(tuple[bytes, ...]):
        """Blocks that are counted while somebody else asks."""

        __slots__ = ()

        def __len__(self) -> int:
            if not sizes:
                sizes.append(-1)
                sizes.append(message.size)
            return super().__len__()

    class Slow(RawCodec):
        def encode(self, value: bytes, dialect: Dialect) -> Blocks:
            return Blocks(super().encode(value, dialect))

    message = OutgoingMessage("D", b"hello", Slow(), THREE)
    assert message.size == 5
    assert sizes == [-1, 5]


@pytest.mark.parametrize("value", [None, 5, [1, 2], object(), 1j])
def test_other_objects_have_none(value: object):
    """The error about any other type has a hint."""
    with pytest.raises(ProtocolError, match=f"the type {type(value).__name__}; pass a codec, or a Bottle"):
        codec_of(value)


def test_the_codec_of_a_pair_is_that_of_its_parts():
    """A pair is encoded with the codecs of its parts."""
    pair = Pair("a", np.zeros(2))
    assert b"".join(codec_of(pair).encode(pair, THREE)).endswith(b"".join(VECTOR.encode(np.zeros(2), THREE)))


LOADING = """
import sys
from pathlib import Path
from rtf.middleware.types.codecs import codec_of
from rtf.middleware.types import STRING, Record, Stamp
from rtf.bottle import Bottle, Dialect
for value in (Bottle([1]), "text", b"bytes", {"a": 1}, Stamp(1, 2.0), Record(1)):
    codec_of(value).encode(value, Dialect.YARP3)
assert "numpy" not in sys.modules, "numpy was loaded"
import rtf.middleware.types
rtf.middleware.types.VECTOR
assert "numpy" in sys.modules
"""


def test_numpy_is_loaded_when_it_is_needed():
    """Importing the types does not load numpy."""
    subprocess.run([sys.executable, "-c", LOADING], check=True, env={"PYTHONPATH": ":".join(sys.path)})


def test_the_types_say_what_they_have_not():
    """All exported names exist, and an unknown one raises AttributeError."""
    from rtf.middleware import types

    assert {name for name in types.__all__ if not hasattr(types, name)} == set()
    with pytest.raises(AttributeError, match="Vektor"):
        types.Vektor  # noqa: B018


def test_raw_bytes_are_taken_as_they_are():
    """The raw codec takes a whole message, or the bottle at the beginning of a reply."""
    data = encode(Bottle([1, 2]))
    assert RAW.decode(data + b"more", THREE) == data + b"more"
    assert RAW.decode_from(memoryview(data + b"more"), THREE) == (data, len(data))


def test_the_benchmark_runs():
    """The benchmark of codecs runs, and times every row."""
    script = Path(__file__).parents[1] / "benchmarks" / "run_codec_benchmarks.py"
    ran = subprocess.run(
        [sys.executable, str(script), "--seconds", "0", "--repeat", "1"],
        check=True,
        text=True,
        capture_output=True,
        env={"PYTHONPATH": ":".join(sys.path)},
    )
    heading, *lines = ran.stdout.splitlines()
    assert heading.split() == ["best", "median", "goal"]
    assert len(lines) > 20
    assert all(line.count(" us") == 2 for line in lines)
