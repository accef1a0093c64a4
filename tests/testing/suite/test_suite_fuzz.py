"""Many damaged suite files: none crashes or hangs the loader."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

import pytest

from rtf.testing.suite.model import TestSuite
from rtf.testing.suite.xml import load_suite_bytes

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

ROUNDS = 25_000
SEED = 20260913

SEEDS = (
    b'<suite name="S"><test param="--from a.ini" repetition="2">A</test></suite>',
    b'<suite name="S"><environment>-e</environment><test timeout="5s" tags="a b">A</test></suite>',
    b'<suite name="S"><for name="p" in="x y"><test name="t${p}">A</test></for></suite>',
    b'<suite name="S"><fixture depends="G">F</fixture><fixture>G</fixture><test fixtures="F">A</test></suite>',
    b'<suite name="S"><!-- a -- b --><test>A<parameter name="v">1</parameter></test></suite>',
    b'<suite name="S"><test>A</test><test requires="test:a">B</test></suite>',
    b'<!DOCTYPE suite><suite name="S"><timeout>5</timeout><include>x</include></suite>',
    b'<?xml version="1.0" encoding="utf-8"?><suite name="\xc3\xa9"><test expected="fail">A</test></suite>',
)
PIECES = (
    *(
        b"<",
        b">",
        b'"',
        b"'",
        b"&",
        b"--",
        b"-->",
        b"<!--",
        b"]]>",
        b"<![CDATA[",
        b"<?",
        b"<!DOCTYPE s [",
        b"&#0;",
        b"&lt;",
    ),
    *(
        b"\0",
        b"\xff",
        b"\xef\xbb\xbf",
        b"\xff\xfe",
        b"${p}",
        b"${",
        b"999999999999",
        b"-1",
        b"1e9",
        b"nan",
        b"../",
        b"~2",
    ),
    *(
        b"<test>",
        b"</test>",
        b"<for ",
        b"</suite>",
        b"<suite>",
        b"<include>",
        b' in="a b"',
        b' depends="F"',
        b"\r\n",
        b" ",
    ),
)


def mutate(data: bytes, choose: Callable[[], float]) -> bytes:
    """Damage a file at one to three places: cut, repeat, overwrite, insert."""
    for _ in range(1 + int(choose() * 3)):
        at, piece = int(choose() * (len(data) + 1)), PIECES[int(choose() * len(PIECES))]
        kind = choose()
        if kind < 0.2:
            data = data[:at] + data[at + int(choose() * 12) :]
        elif kind < 0.3:
            data = data[:at] + data[max(0, at - int(choose() * 30)) :]
        elif kind < 0.5:
            data = data[:at] + bytes((int(choose() * 256),)) + data[at + 1 :]
        else:
            data = data[:at] + piece + data[at:]
    return data


@pytest.mark.fuzz
def test_damaged_files_are_told_apart_from_sound_ones_and_nothing_else_happens(tmp_path: Path):
    """A damaged file gives a suite or an error, never an exception, and always the same."""
    choose = random.Random(SEED).random
    file = str(tmp_path / "s.xml")
    suites = 0
    for number in range(ROUNDS):
        data = mutate(SEEDS[number % len(SEEDS)], choose)
        loaded = load_suite_bytes(data, file)
        if loaded.suite is None:
            assert loaded.errors, data
        else:
            assert isinstance(loaded.suite, TestSuite)
            suites += 1
        if number % 1000 == 0:
            again = load_suite_bytes(data, file)
            assert (loaded.suite, [*map(str, loaded.diagnostics)]) == (again.suite, [*map(str, again.diagnostics)])
    assert ROUNDS // 20 < suites < ROUNDS
