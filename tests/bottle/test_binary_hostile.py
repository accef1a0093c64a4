"""Bytes that are no bottle, or a part of one: they raise BottleError, in bounded memory and time."""

from __future__ import annotations

import contextlib
import random
import struct
import sys
import tracemalloc
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtf.bottle import MAX_DEPTH, Bottle, BottleError, BottleLimitError, BottleSyntaxError, Dialect, Property
from rtf.bottle.binary import (
    MAX_ELEMENTS,
    Scanner,
    TruncatedBottleError,
    decode,
    decode_from,
    encode,
    extent,
    possible_dialects,
)

SAMPLES = [
    Bottle.parse('[set] [pos] 0 10.0 "a b" (1 2 3) (a (b [c]) ()) {1 2 3} (x y) 3000000000 true'),
    Bottle.parse("1 2 3"),
    Bottle.parse("hello world"),
    Bottle([b"abc", b""]),
    Bottle([Property({"key": [1, 2.0], "other": Property({"k": "v"})}), "end"]),
    Bottle(),
    Bottle([[[[]]]]),
]
ENCODED = [(encode(bottle, dialect), dialect) for bottle in SAMPLES for dialect in Dialect]


@pytest.mark.parametrize(("data", "dialect"), ENCODED)
def test_a_bottle_that_is_cut_off_says_what_it_needs(data: bytes, dialect: Dialect):
    """The error about a truncated bottle has the number of needed bytes, at most those of the bottle."""
    for size in range(len(data)):
        for read in (decode_from, extent):
            with pytest.raises(TruncatedBottleError) as caught:
                read(data[:size], 0, dialect)
            assert size < caught.value.needed <= len(data)
        with pytest.raises(TruncatedBottleError) as caught:
            decode_from(b"before" + data[:size], 6, dialect)
        assert 6 + size < caught.value.needed <= 6 + len(data)


@pytest.mark.parametrize(("data", "dialect"), ENCODED)
def test_waiting_for_what_is_needed_comes_to_the_end(data: bytes, dialect: Dialect):
    """Waiting for the needed bytes each time leads to the whole bottle."""
    scanner, size = Scanner(dialect), 0
    for _ in range(len(data) + 1):
        try:
            end = scanner.end(data[:size])
            break
        except TruncatedBottleError as error:
            size = error.needed
    assert (end, size) == (len(data), len(data))
    assert decode(data[:size], dialect) is not None


@pytest.mark.parametrize(("data", "dialect"), ENCODED)
def test_a_scanner_goes_on_where_it_stopped(data: bytes, dialect: Dialect):
    """A scanner finds the end byte by byte, also among other bytes."""
    scanner = Scanner(dialect, 3)
    for size in range(3, 3 + len(data)):
        with pytest.raises(TruncatedBottleError):
            scanner.end((b"abc" + data)[:size])
    assert scanner.end(b"abc" + data + b"more") == 3 + len(data)
    assert scanner.end(b"abc" + data + b"more") == 3 + len(data)


def test_a_scanner_refuses_what_the_reader_refuses():
    """Scanner and decoder agree on damaged bottles: their end, that they are truncated, or invalid.

    Of a bottle that is both, the scanner may find first that it is truncated.
    """
    chance = random.Random(7)
    for _ in range(4000):
        data, dialect = chance.choice(ENCODED)
        damaged = bytearray(data)
        for _ in range(chance.randint(1, 3)):
            damaged[chance.randrange(len(damaged))] ^= 1 << chance.randrange(8)
        if chance.random() < 0.3:
            del damaged[chance.randrange(len(damaged)) :]
        read, scanned = outcome(end_read, damaged, dialect), outcome(extent, damaged, dialect)
        assert scanned == read or (isinstance(read, type) and isinstance(scanned, int) and scanned > len(damaged))


def outcome(reader: Callable[..., int], data: bytes, dialect: Dialect) -> int | type:
    """Return the end of the bottle, the number of needed bytes, or the class of the BottleError."""
    try:
        return reader(data, 0, dialect)
    except TruncatedBottleError as error:
        return error.needed
    except BottleError as error:
        return type(error)


def end_read(data: bytes, start: int, dialect: Dialect) -> int:
    """Decode a bottle, and return its end."""
    return decode_from(data, start, dialect)[1]


@settings(deadline=None)
@given(st.binary(max_size=200), st.sampled_from(Dialect))
def test_random_bytes_are_refused_or_read(data: bytes, dialect: Dialect):
    """Random bytes are decoded, or raise BottleError, also after the head of a list."""
    for start in (b"", b"\0\1\0\0\2\0\0\0"):
        outcome(end_read, start + data, dialect)
        outcome(extent, start + data, dialect)
        possible_dialects(start + data)


def head(code: int, count: int, rest: bytes = b"") -> bytes:
    """Return the head of a list, and these bytes after it."""
    return struct.pack("<ii", code, count) + rest


@pytest.mark.parametrize(
    ("data", "error", "message"),
    [
        (head(0, 1), BottleSyntaxError, "0 is not the code of a list"),
        (head(0x4159, 0), BottleSyntaxError, "not the code of a list"),
        (head(256, -1), BottleLimitError, "-1 elements"),
        (head(256 | 1, -1), BottleLimitError, "-1 elements"),
        (head(256 | 32, MAX_ELEMENTS + 1), BottleLimitError, "too long"),
        (head(256, 1, struct.pack("<ii", 2, 0)), BottleSyntaxError, "2 is not the code of a value"),
        (head(256 | 2, 1, bytes(4)), BottleSyntaxError, "2 is not the code of a value"),
        (head(256, 1, struct.pack("<ii", 4, -1)), BottleSyntaxError, "a length of -1 bytes"),
        (head(256 | 4, 1, struct.pack("<i", -5)), BottleSyntaxError, "a length of -5 bytes"),
        (head(256, 1, struct.pack("<iii", 768, 1, 0)), BottleSyntaxError, "1 is not the code of a list"),
        (head(256, 1, struct.pack("<iii", 768 | 1, 256, 0)), BottleSyntaxError, "769 is not the code of a value"),
        (head(256, 0, b"x"), BottleSyntaxError, "1 bytes follow"),
    ],
)
def test_broken_bottles_are_refused(data: bytes, error: type[BottleError], message: str):
    """Each kind of damage has its error, with the wrong value."""
    with pytest.raises(error, match=message):
        decode(data)
    assert possible_dialects(data) == ()


def test_codes_of_one_dialect_are_none_of_the_other():
    """Codes of one dialect are invalid in the other."""
    with pytest.raises(BottleSyntaxError, match="20 is not"):
        decode(encode(Bottle([1.5]), Dialect.YARP4))
    with pytest.raises(BottleSyntaxError, match="384 is not"):
        decode(bytes.fromhex("80010000 01000000 0000c03f"), Dialect.YARP4)
    with pytest.raises(BottleSyntaxError, match="128 is not"):
        decode(bytes.fromhex("00010000 01000000 80000000 0000c03f"), Dialect.YARP4)


def test_a_peer_is_known_by_its_floats():
    """The dialect of a bottle is known by its doubles only."""
    for text in ("1.5", "[is] 2 1.5", "(1.0 2.0) x", "3.25 (0.0) [ok]"):
        for dialect in Dialect:
            assert possible_dialects(encode(Bottle.parse(text), dialect)) == (dialect,)
    assert possible_dialects(encode(Bottle.parse("[get] [axes] 3 x"))) == tuple(Dialect)
    assert possible_dialects(b"") == ()


def test_lists_may_be_nested_just_so_deep():
    """Decoder and scanner refuse lists nested deeper than MAX_DEPTH."""
    level = struct.pack("<ii", 256, 1)
    data = level * MAX_DEPTH + head(256, 0)
    assert extent(data) == len(data)
    assert encode(decode(data)) == data
    for read in (decode, extent):
        with pytest.raises(BottleLimitError, match=str(MAX_DEPTH)):
            read(level + data)
        with pytest.raises(BottleLimitError, match=str(MAX_DEPTH)):
            read(level * 100_000)


def test_a_count_is_not_believed_before_its_bytes_are_there():
    """Announced elements are not allocated before their bytes arrive."""
    tracemalloc.start()
    try:
        for code in (256, 256 | 1, 256 | 4, 256 | 10, 256 | 12, 256 | 32):
            with pytest.raises(TruncatedBottleError) as caught:
                decode(head(code, MAX_ELEMENTS, bytes(100)))
            assert caught.value.needed >= MAX_ELEMENTS
        with pytest.raises(TruncatedBottleError):
            decode(head(256, 1, struct.pack("<ii", 12, 2**31 - 1)))
        assert tracemalloc.get_traced_memory()[1] < 1 << 20
    finally:
        tracemalloc.stop()


def test_all_lists_together_hold_no_more_than_one_may():
    """The limit of elements applies to all lists of a bottle together."""
    quarter = MAX_ELEMENTS // 4
    many = head(256, 5, head(256 | 32, quarter, bytes(quarter)) * 5)
    with pytest.raises(BottleLimitError, match="too long"):
        decode(many)
    assert extent(many) == len(many)
    with pytest.raises(BottleLimitError, match="too long"):
        extent(head(256, 5, head(256 | 4, quarter, bytes(4 * quarter)) * 5))


def test_dripping_bytes_cost_no_more_than_a_flood():
    """The work for a bottle that arrives byte by byte grows linearly with its size."""

    def drip(count: int) -> int:
        data = memoryview(encode(Bottle([["a", index] for index in range(count)])))
        scanner, calls = Scanner(), 0

        def counted(frame: object, event: str, argument: object) -> None:
            nonlocal calls
            calls += event in ("call", "c_call")

        sys.setprofile(counted)
        try:
            for size in range(len(data)):
                with contextlib.suppress(TruncatedBottleError):
                    scanner.end(data[:size])
            assert scanner.end(data) == len(data)
        finally:
            sys.setprofile(None)
        return calls

    assert drip(1000) < 11 * drip(100)
