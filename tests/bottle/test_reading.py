"""Reading text as YARP's reader does, with its oddities."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtf.bottle import (
    FALSE,
    MAX_DEPTH,
    MAX_TEXT,
    TRUE,
    Bottle,
    BottleError,
    BottleLimitError,
    BottleSyntaxError,
    Dialect,
    Vocab,
    Vocab64,
    reading,
)
from rtf.bottle.reading import read_exactly, read_quickly

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

SAMPLES: dict[str, list[object]] = {
    "5": [5],
    "1 2 3": [1, 2, 3],
    "1.5": [1.5],
    "hello": ["hello"],
    "a bc": ["a", "bc"],
    "[set]": [Vocab("set")],
    "[set] [pos] 0 10.0": [Vocab("set"), Vocab("pos"), 0, 10.0],
    "(1 2) (3.0)": [[1, 2], [3.0]],
    "(1 2) (3 4)": [[1, 2], [3, 4]],
    "((1 2) (3))": [[[1, 2], [3]]],
    "(key val)": [["key", "val"]],
    "()": [[]],
    "": [],
    "true false": [TRUE, FALSE],
    "1 x": [1, "x"],
    "10000000000": [10000000000],
    "{1 2 255}": [b"\x01\x02\xff"],
    '1 2.5 "hi there" [vo] (1 2 3) true {1 2 255}': [
        1, 2.5, "hi there", Vocab("vo"), [1, 2, 3], TRUE, b"\x01\x02\xff",
    ],
}  # fmt: skip
ODDITIES: dict[str, list[object]] = {
    "1,2,3": [1, 2, 3],
    " \t1\n,\r,2 ": [1, 2],
    "/path/x a-b a.b a;b a:b a=b 'a #a": ["/path/x", "a-b", "a.b", "a;b", "a:b", "a=b", "'a", "#a"],
    "- -x 1a 1. .5": [0, 0, "1a", 1.0, 0.5],
    "007 010 08 0xffffffff": [7, 8, 0, 4294967295],
    "99999999999999999999 -99999999999999999999": [2**63 - 1, -(2**63)],
    "null inf -inf": [Vocab("null"), math.inf, -math.inf],
    '"true" "false" "null" "5" "inf"': ["true", "false", "null", "5", "inf"],
    "[] [abcdef] [a b]": [FALSE, Vocab("abcd"), FALSE, "b]"],
    "[x]] [set [1] [a,b]": [Vocab("x]"), Vocab("se"), TRUE, FALSE, "b]"],
    r'"a\"b" "\n\r\0\t\x\\"': ['a"b', "\n\r\0tx\\"],
    r"a\ b a\nb tr\ue": ["a b", "a\nb", TRUE],
    '"" a""b "a"b': ["", 'a""b', 'a"'],
    "{} {300} {-1 2.5 x} {[a]}": [b"", b",", b"\xff\x02\x00", b"a"],
    "(1 2)x y": [[1], "y"],
    "f(1 2) x": ["f(1 2)", "x"],
    '(a "b)" c) d': [["a", "b)", "c"], "d"],
    "(1 2)(3 4)": [[1, "2)(3", 4]],
    # An unclosed list or quote is dropped, with all that follows it.
    "1 (2 3": [1],
    '1 "2 3': [1],
    "1 {2 3": [1],
    'name MotorTest_head" next 5': ["name"],
    "1 2) 3": [1],
    "1 a\\": [1],
}  # fmt: skip


@pytest.mark.parametrize(("text", "values"), [*SAMPLES.items(), *ODDITIES.items()])
def test_text_is_read_as_yarp_reads_it(text: str, values: list[object]):
    """Types and values of a text are those of YARP."""
    assert Bottle.parse(text) == Bottle(values)


@pytest.mark.parametrize("text", [*SAMPLES, *ODDITIES])
def test_the_exact_reader_agrees(text: str):
    """The exact reader gives the result of the quick one for every sample."""
    assert Bottle.adopt(read_exactly(text, Dialect.YARP3)) == Bottle.parse(text)


@pytest.mark.parametrize("text", SAMPLES)
def test_ordinary_text_is_read_quickly(text: str):
    """No ordinary text needs the exact reader."""
    assert read_quickly(text, Dialect.YARP3) is not None


def test_long_vocabs_belong_to_the_later_dialect():
    """In YARP 4.0 a vocab of more than four characters has 64 bits."""
    assert Bottle.parse("[abcdef] [abcd]", dialect=Dialect.YARP4) == Bottle([Vocab64("abcdef"), Vocab("abcd")])
    assert Bottle.parse("[abcdefghij]", dialect=Dialect.YARP4) == Bottle([Vocab64("abcdefgh")])


@pytest.mark.parametrize(("text", "column"), [('a "b', 3), ("(a (b)", 1), ("a) b", 2), ("{1", 1)])
def test_strict_reading_names_the_place(text: str, column: int):
    """In strict mode an unclosed element is an error with the place of its opening."""
    with pytest.raises(BottleSyntaxError, match=rf"column {column}\)") as caught:
        Bottle.parse(text, strict=True)
    assert caught.value.offset == column - 1


def test_strict_reading_accepts_the_oddities():
    """Strict mode concerns the balance only."""
    assert Bottle.parse("(1 2)x f(1)", strict=True) == Bottle([[1], "f(1)"])


@pytest.mark.parametrize("tail", ["", ")", " x)(y"])
def test_depth_is_bounded(tail: str):
    """Text nested deeper than MAX_DEPTH raises BottleLimitError."""
    depth = MAX_DEPTH
    assert Bottle.parse("(" * depth + ")" * depth)
    with pytest.raises(BottleLimitError):
        Bottle.parse("(" * (depth + 1) + tail + ")" * (depth + 1))
    with pytest.raises(BottleLimitError):
        read_exactly("(" * (depth + 1) + ")" * (depth + 1), Dialect.YARP3)


def test_size_is_bounded():
    """Text longer than MAX_TEXT is refused."""
    with pytest.raises(BottleLimitError, match="characters"):
        Bottle.parse(" " * (MAX_TEXT + 1))


def test_work_is_bounded(monkeypatch: pytest.MonkeyPatch):
    """Long, malformed text that is deeply nested is refused."""
    monkeypatch.setattr(reading, "MAX_WORK", reading.MAX_WORK // 16)  # the test itself is work, too
    with pytest.raises(BottleLimitError):
        Bottle.parse("(" * 90 + "(a)b " * (MAX_TEXT // 8 // 16) + ")" * 90)


@pytest.mark.parametrize("pattern", ['"', "\\", "[", "0", "0x", " ,", "(a)b", '"\\a', "1.", "{ ", "a\\"])
def test_repetition_takes_no_time(pattern: str):
    """A text of one repeated pattern is read in linear time."""
    Bottle.parse(pattern * (200_000 // len(pattern)))
    Bottle.parse(pattern * (200_000 // len(pattern)) + '"')


def test_surrogates_that_are_no_bytes_raise_our_error():
    """A vocab with a lone surrogate raises BottleError."""
    with pytest.raises(BottleError, match="UTF-8"):
        Bottle.parse("[\ud800]")


ODD_TEXT = st.text(st.one_of(st.sampled_from('()[]{}" \t\n\r,\\.-+0x19eabtruefalsn'), st.characters()), max_size=60)


@settings(deadline=None)
@given(ODD_TEXT)
def test_any_text_reads_or_raises_our_error(text: str):
    """Any text is read, or raises BottleError, and both readers agree."""
    for dialect in Dialect:
        try:
            quick = read_quickly(text, dialect)
            exact = read_exactly(text, dialect)
        except BottleError:
            continue
        if quick is not None:
            assert repr(Bottle.adopt(quick)) == repr(Bottle.adopt(exact))


@pytest.mark.fuzz
def test_mutated_text_reads_or_raises_our_error(mutations: Callable[..., Iterator[str]]):
    """Twenty thousand damaged texts are read, or raise BottleError."""
    seeds = [
        '1 2.5 "hi there" [vo] (1 2 3) true {1 2 255}',
        '--joints (0 1 2) --home (0.0 -10.5 1e-3) --name "a b" --on true',
        '((a (b "c) d")) x) [ok] -7.5e-3 0x1f 010 null',
        'key "v\\"q\\\\" {1 2} (a,b, c)\n next',
    ]
    for text in mutations(seeds, 20_000, '()[]{}" \t\n,\\.-+0x9eabn'):
        try:
            Bottle.parse(text)
        except BottleError:
            continue


@pytest.mark.fuzz
def test_mutated_text_is_read_alike_by_both_readers(mutations: Callable[..., Iterator[str]]):
    """When the quick reader accepts a damaged text, the exact one agrees."""
    seeds = ['1 2.5 "hi \\" there" [vo] (1 (2 3)) true {1 2 255} 0x1f -inf']
    agreed = 0
    for text in mutations(seeds, 5_000, '()[]{}" \t\n,\\.-+0x9eabn', seed=2):
        quick = read_quickly(text, Dialect.YARP3)
        if quick is not None:
            agreed += 1
            assert repr(Bottle.adopt(quick)) == repr(Bottle.adopt(read_exactly(text, Dialect.YARP3)))
    assert agreed > 250
