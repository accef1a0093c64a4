"""The binary form of bottles, byte by byte, in both dialects."""

from __future__ import annotations

import json
import math
import struct
import tracemalloc
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtf.bottle import (
    FALSE,
    MAX_DEPTH,
    TRUE,
    Bottle,
    BottleLimitError,
    BottleTypeError,
    Dialect,
    Float32,
    Int8,
    Int16,
    Int64,
    Property,
    Vocab,
    Vocab64,
)
from rtf.bottle.binary import LARGE_BLOB, decode, decode_from, encode, encode_blocks, encode_element, possible_dialects

RECORDED = json.loads((Path(__file__).parents[1] / "data" / "yarp_wire" / "bottles.json").read_text())
INT32_MIN, INT32_MAX = -(2**31), 2**31 - 1

#: Values with the same bytes in both dialects.
SAME = [
    ("5", "01010000 01000000 05000000"),
    ("1 2 3", "01010000 03000000 01000000 02000000 03000000"),
    ("hello", "04010000 01000000 05000000 68656c6c6f"),
    ("a bc", "04010000 02000000 01000000 61 02000000 6263"),
    ("[set]", "09010000 01000000 73657400"),
    ("(1 2) (3 4)", "00010000 02000000 01010000 02000000 01000000 02000000 01010000 02000000 03000000 04000000"),
    (
        "((1 2) (3))",
        "00010000 01000000 00010000 02000000 01010000 02000000 01000000 02000000 01010000 01000000 03000000",
    ),
    ("(key val)", "00010000 01000000 04010000 02000000 03000000 6b6579 03000000 76616c"),
    ("()", "00010000 01000000 00010000 00000000"),
    ("", "00010000 00000000"),
    ("true false", "09010000 02000000 31000000 00000000"),
    ("1 x", "00010000 02000000 01000000 01000000 04000000 01000000 78"),
    ("10000000000", "11010000 01000000 00e40b5402000000"),
    ("{1 2 255}", "0c010000 01000000 03000000 0102ff"),
]
REST = (
    "04000000 08000000 6869207468657265 09000000 766f0000 01010000 03000000 01000000 02000000 03000000 "
    "09000000 31000000 0c000000 03000000 0102ff"
)
#: Text, the bytes of YARP 3, the bytes of YARP 4.0.
DIFFERENT = [
    ("1.5", "0a010000 01000000 000000000000f83f", "14010000 01000000 000000000000f83f"),
    (
        "[set] [pos] 0 10.0",
        "00010000 04000000 09000000 73657400 09000000 706f7300 01000000 00000000 0a000000 0000000000002440",
        "00010000 04000000 09000000 73657400 09000000 706f7300 01000000 00000000 14000000 0000000000002440",
    ),
    (
        "(1 2) (3.0)",
        "00010000 02000000 01010000 02000000 01000000 02000000 0a010000 01000000 0000000000000840",
        "00010000 02000000 01010000 02000000 01000000 02000000 14010000 01000000 0000000000000840",
    ),
    (
        '1 2.5 "hi there" [vo] (1 2 3) true {1 2 255}',
        f"00010000 07000000 01000000 01000000 0a000000 0000000000000440 {REST}",
        f"00010000 07000000 01000000 01000000 14000000 0000000000000440 {REST}",
    ),
    ("[abcdef]", "09010000 01000000 61626364", "12010000 01000000 6162636465660000"),
]
ENCODINGS = [(text, dialect, data) for text, data in SAME for dialect in Dialect] + [
    (text, dialect, data)
    for text, *both in DIFFERENT
    for dialect, data in zip((Dialect.YARP3, Dialect.YARP4), both, strict=True)
]


@pytest.mark.parametrize(("text", "dialect", "data"), ENCODINGS)
def test_encodings_of_real_programs(text: str, dialect: Dialect, data: str):
    """A text is encoded to the recorded bytes of YARP's programs, and decoded from them."""
    bottle = Bottle.parse(text, dialect=dialect)
    assert encode(bottle, dialect).hex() == data.replace(" ", "")
    assert decode(bytes.fromhex(data), dialect) == bottle


@pytest.mark.parametrize(
    ("value", "three", "four"),
    [
        (Int8(-2), "20010000 01000000 fe", "20010000 01000000 fe"),
        (Int16(-2), "40010000 01000000 feff", "40010000 01000000 feff"),
        (Int64(1), "11010000 01000000 0100000000000000", "11010000 01000000 0100000000000000"),
        (Float32(1.5), "80010000 01000000 0000c03f", "0a010000 01000000 0000c03f"),
        (-0.0, "0a010000 01000000 0000000000000080", "14010000 01000000 0000000000000080"),
        (Vocab64("abcdefgh"), "09010000 01000000 61626364", "12010000 01000000 6162636465666768"),
        ("a\0\u00e9\udcff", "04010000 01000000 05000000 6100c3a9ff", "04010000 01000000 05000000 6100c3a9ff"),
    ],
)
def test_every_scalar_has_its_code(value: object, three: str, four: str):
    """Each type has the code and bytes of its dialect, and alone it is a list of its type."""
    assert encode(Bottle([value])).hex() == three.replace(" ", "")
    assert encode(Bottle([value]), Dialect.YARP4).hex() == four.replace(" ", "")
    assert decode(bytes.fromhex(four), Dialect.YARP4) == Bottle([value])


def test_a_property_inside_is_a_bottle_behind_the_code_of_a_dictionary():
    """A property in a bottle has the code 768 or 512, followed by a whole bottle."""
    bottle = Bottle([Property({"k": "v"}), 9])
    data = bytes.fromhex(
        "00010000 02000000 00030000 00010000 01000000 04010000 02000000 01000000 6b 01000000 76 01000000 09000000"
    )
    assert encode(bottle) == data
    assert decode(data) == bottle
    assert decode(data.replace(b"\0\3\0\0", b"\0\2\0\0")) == bottle


def test_a_property_alone_is_a_bottle_of_its_groups():
    """A property alone has the bytes of a bottle of lists."""
    assert encode(Property({"b": 1, "a": [1.0]})) == encode(Bottle.parse("(a (1.0)) (b 1)"))


def test_a_number_too_large_for_a_type_does_not_change_the_others():
    """Integers are a list of 32 or of 64 bits if all are, else each has its code."""
    assert encode(Bottle([1, INT32_MAX, INT32_MIN]))[:1] == b"\x01"
    assert encode(Bottle([2**31, -(2**31) - 1]))[:1] == b"\x11"
    mixed = Bottle([1, 2**31])
    assert encode(mixed).hex() == "000100000200000001000000010000001100000000000080" + "00000000"
    assert decode(encode(mixed)) == Bottle([1, Int64(2**31)])


@pytest.mark.parametrize(
    ("data", "text"),
    [
        ("00010000 02000000 00010000 00000000 00010000 01000000 01000000 05000000", "() (5)"),  # unspecialised
        ("04010000 00000000", ""),  # an empty list of strings
        ("02010000 00000000", ""),  # and of a type that does not exist
        ("01020000 01000000 07000000", "7"),  # marked as a dictionary
        ("01030000 01000000 07000000", "7"),
        ("00010000 01000000 00030000 00020000 00000000", "()"),  # a dictionary of none
        ("00010000 01000000 20000000 ff", "-1"),  # a last element of less than eight bytes
        ("00010000 01000000 40000000 0100", "1"),
        ("00010000 02000000 20000000 01 0c010000 02000000 00000000 01000000 07", "1 ({} {7})"),
    ],
)
def test_unusual_forms_are_read(data: str, text: str):
    """Unspecialised lists, empty lists of any type, and both codes of dictionaries are decoded."""
    assert decode(bytes.fromhex(data)).to_text() == text


@pytest.mark.parametrize("entry", RECORDED, ids=lambda entry: f"{entry['dialect']} {entry['from']}")
def test_recorded_messages_are_written_as_they_were_read(entry: dict[str, object]):
    """Recorded messages are decoded, and encoded to the same bytes, unless a generated service wrote them.

    Services never specialise lists; their messages give the same bottle.
    """
    data, dialect = bytes.fromhex(str(entry["hex"])), Dialect(entry["dialect"])
    bottle = decode(data, dialect)
    written = encode(bottle, dialect)
    if plain(bottle, dialect) != data:
        assert written == data
    assert decode(written, dialect) == bottle
    assert dialect in possible_dialects(data)


def plain(bottle: Bottle, dialect: Dialect) -> bytes:
    """Encode a bottle without specialised lists."""
    parts = [struct.pack("<ii", 256, len(bottle))]
    parts += [
        plain(value, dialect) if isinstance(value, Bottle) else encode_element(value, dialect) for value in bottle
    ]
    return b"".join(parts)


SCALARS = st.one_of(
    st.integers(INT32_MIN, INT32_MAX),
    st.integers(-(2**63), 2**63 - 1).map(Int64),
    st.integers(-(2**15), 2**15 - 1).map(Int16),
    st.integers(-128, 127).map(Int8),
    st.floats(allow_nan=False),
    st.floats(allow_nan=False, width=32).map(Float32),
    st.text(),
    st.binary().map(lambda raw: raw.decode("utf-8", "surrogateescape")),
    st.binary(),
    st.integers(INT32_MIN, INT32_MAX).map(Vocab),
    st.sampled_from([TRUE, FALSE, Vocab("set"), Vocab("pos")]),
)
ALIKE = SCALARS.flatmap(
    lambda first: st.lists(SCALARS.filter(lambda value: type(value) is type(first)), max_size=3).map(
        lambda rest: [first, *rest]
    )
)


def lists(scalars: st.SearchStrategy[object]) -> st.SearchStrategy[Bottle]:
    """Generate nested bottles."""
    keys = st.text(st.characters(codec="utf-8"), min_size=1, max_size=3)
    return st.recursive(
        st.one_of(st.lists(scalars, max_size=5), ALIKE).map(Bottle),
        lambda inner: st.one_of(
            st.lists(st.one_of(scalars, inner), max_size=5).map(Bottle),
            st.dictionaries(keys, st.one_of(scalars, inner), max_size=3).map(lambda items: Bottle([Property(items)])),
        ),
        max_leaves=25,
    )


BOTTLES = lists(SCALARS)
BOTTLES4 = lists(st.one_of(SCALARS, st.integers(-(2**63), 2**63 - 1).map(Vocab64)))


@settings(deadline=None)
@given(BOTTLES)
def test_what_is_written_reads_back_in_3(bottle: Bottle):
    """In YARP 3 a bottle is the same after encoding and decoding."""
    data = encode(bottle)
    assert decode(data) == bottle
    assert encode(decode(data)) == data


@settings(deadline=None)
@given(BOTTLES4)
def test_what_is_written_reads_back_in_4(bottle: Bottle):
    """In YARP 4 a bottle, also with long vocabs, is the same after encoding and decoding."""
    data = encode(bottle, Dialect.YARP4)
    assert decode(data, Dialect.YARP4) == bottle
    assert encode(decode(data, Dialect.YARP4), Dialect.YARP4) == data


@settings(deadline=None)
@given(BOTTLES, st.binary(max_size=20), st.binary(max_size=20))
def test_a_bottle_is_found_among_other_bytes(bottle: Bottle, before: bytes, after: bytes):
    """Decoding starts at the given place, ends with the bottle, and takes any kind of buffer."""
    data = before + encode(bottle) + after
    for buffer in (data, bytearray(data), memoryview(data)):
        assert decode_from(buffer, len(before)) == (bottle, len(data) - len(after))


@given(st.binary(min_size=8, max_size=8))
def test_every_double_keeps_its_bits(raw: bytes):
    """A double keeps all its bits, those of NaN, too."""
    (value,) = struct.unpack("<d", raw)
    kept = decode(encode(Bottle([value])))[0]
    assert struct.pack("<d", kept) == struct.pack("<d", value)
    assert math.isnan(value) or kept == value


def test_large_blobs_are_not_copied():
    """A large blob is a block of its own, without a copy; small ones are joined."""
    large, small = bytes(LARGE_BLOB), bytes(LARGE_BLOB - 1)
    for bottle in (
        Bottle([large]),
        Bottle([1, large]),
        Bottle([1, [large, small], large, "end"]),
        Bottle([large, large]),
    ):
        blocks = encode_blocks(bottle)
        assert b"".join(blocks) == encode(bottle)
        assert [block is large for block in blocks if len(block) == LARGE_BLOB] == [True] * str(bottle).count(
            "{" + "0 " * (LARGE_BLOB - 1) + "0}"
        )
    assert len(encode_blocks(Bottle([1, small]))) == 1
    assert len(encode_blocks(Bottle([large] * 1000))) < 256


@pytest.mark.parametrize("kind", [bytes, bytearray, memoryview])
def test_a_blob_is_copied_once(kind: type):
    """Decoding a large blob copies it once."""
    size = 8 << 20
    data = kind(encode(Bottle(["x", bytes(size)])))
    tracemalloc.start()
    try:
        bottle = decode(data)
        assert tracemalloc.get_traced_memory()[1] < 1.1 * size
    finally:
        tracemalloc.stop()
    assert bottle == Bottle(["x", bytes(size)])


def test_a_blob_is_the_receivers_own():
    """A decoded bottle does not change with its buffer."""
    data = bytearray(encode(Bottle([b"abc", 1, "text"])))
    bottle = decode(data)
    data[:] = bytes(len(data))
    assert bottle == Bottle([b"abc", 1, "text"])


def test_a_bottle_that_cannot_be_written_says_why():
    """A bottle inside itself or nested too deep, and a value of no type, raise BottleError."""
    circle = Bottle()
    circle.append(circle)
    with pytest.raises(BottleLimitError, match="inside itself"):
        encode(circle)
    deep = Bottle()
    for _ in range(MAX_DEPTH):
        deep = Bottle([deep])
    assert decode(encode(deep)) == deep
    with pytest.raises(BottleLimitError, match=str(MAX_DEPTH)):
        encode(Bottle([deep]))
    with pytest.raises(BottleTypeError, match="complex"):
        encode(Bottle.adopt([1j, 1j]))  # type: ignore[list-item]
