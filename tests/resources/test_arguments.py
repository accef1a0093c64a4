"""Splitting parameter strings into words, and words into a property."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtf.bottle import Bottle, BottleError, Property
from rtf.resources import parse_arguments, split_arguments

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", []),
        ("   ", []),
        ('a "b c" d', ["a", "b c", "d"]),
        ('--joints "(0 1 2)"', ["--joints", "(0 1 2)"]),
        ("  a   b  ", ["a", "b"]),
        ("a\tb\nc d", ["a\tb\nc", "d"]),
        ("'a b'", ["'a", "b'"]),
        (r"a\ b \"c d\"", ["a\\", "b", "\\", "c d\\"]),
        ('a "b c', ["a", "b c"]),
        ('"  a"', ["  a"]),
        ('a"b c"d', ["a", "b c", "d"]),
        ('"" a ""', ["a"]),
    ],
)
def test_splitting(text: str, words: list[str]):
    """Words are separated by blanks, and protected by double quotes; nothing is escaped."""
    assert split_arguments(text) == words


def test_the_number_of_words_is_not_limited():
    """The number of words has no limit, unlike in the C++ framework."""
    assert len(split_arguments("a " * 1000)) == 1000


@given(st.lists(st.text(st.characters(exclude_characters='"'), min_size=1)))
def test_quoted_words_come_back(words: list[str]):
    """A quoted word is split unchanged."""
    assert split_arguments(" ".join(f'"{word}"' for word in words)) == words


@given(st.text('ab" \t\\', max_size=40))
def test_splitting_loses_only_quotes_and_blanks(text: str):
    """Splitting keeps every other character, in order."""
    assert "".join(split_arguments(text)).replace(" ", "") == text.replace(" ", "").replace('"', "")


@pytest.mark.parametrize(
    ("line", "properties"),
    [
        ("--a b c", "(a b c)"),
        ("--name x --joints (0,1) --flag", "(name x) (joints (0 1)) (flag)"),
        ('--joints "(0 1 2)"', "(joints (0 1 2))"),
        ('--name "a b"', '(name "a b")'),
        ("--offset -5 -2.5 --max 3", "(offset -5 -2.5) (max 3)"),
        ("ignored --a 1", "(a 1)"),
        ("--a 1 --a 2", "(a 2)"),
        ("--path C:\\dir\\file", '(path "C:\\\\dir\\\\file")'),
        ('--path "C:\\my dir"', '(path "C:\\\\my dir")'),
        ("--open (1 --quote a)", '(open "(1") (quote "a)")'),
        ("--grp::sub::key 1 2", "(grp (sub (key 1 2)))"),
        ("--grp::a 1 --grp::b 2 --c 3", "(grp (a 1) (b 2)) (c 3)"),
        ("--grp::a 1 --grp::a 2", "(grp (a 2))"),
        ("--a::a 1", "(a (a 1))"),
        ("-- x --a 1", "(a 1)"),
        ("", ""),
    ],
)
def test_parsing(line: str, properties: str):
    """Words after ``--key`` are its values, and ``::`` separates sections."""
    assert parse_arguments(split_arguments(line)) == Property.parse(properties)


def test_empty_words_are_empty_strings():
    """An empty word is an empty string."""
    assert parse_arguments(["--a", "", "  "]).find_group("a") == Bottle(["a", "", "  "])


def test_overlaying():
    """Words replace keys of an existing property, and extend its sections."""
    properties = Property.parse("(a 1) (b 2) (grp (x 1) (y 2))")
    assert parse_arguments(["--a", "5", "--grp::x", "6"], into=properties) is properties
    assert properties == Property.parse("(a 5) (b 2) (grp (x 6) (y 2))")


@settings(deadline=None)
@given(st.lists(st.one_of(st.text(max_size=10), st.text('-:ab(){}"\\ 1', max_size=10))))
def test_any_words_parse_or_raise_our_error(words: list[str]):
    """Any words are parsed, or raise BottleError."""
    try:
        parse_arguments(words).to_text()
    except BottleError:
        return


@pytest.mark.fuzz
def test_mutated_parameter_strings_parse_or_raise_our_error(mutations: Callable[..., Iterator[str]]):
    """Twenty thousand damaged strings are parsed, or raise BottleError."""
    seeds = ['--name "a b" --joints "(0 1 2)" --from x.ini', "--grp::sub::key -5 --flag", "--a [set] {1 2} --b c"]
    for text in mutations(seeds, 20_000, '-:"()[]{} \\\t1a'):
        words = split_arguments(text)
        assert '"' not in "".join(words)
        try:
            parse_arguments(words)
        except BottleError:
            continue
