"""The balance of quotes, lists and blobs in a text."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.bottle import Balance, is_complete


@pytest.mark.parametrize(
    ("text", "complete"),
    [
        ("", True),
        ('a (b) {1} "c" [d', True),
        ("a (b", False),
        ('a "b', False),
        ('"a (" b', True),
        ("{1", False),
        ("a)", False),
        ("a) (", True),
        (r'"a\"', False),
        (r'"a\""', True),
        (r"\(", True),
        ("a\\", True),
    ],
)
def test_completeness(text: str, complete: bool):
    """Quotes, lists and blobs are balanced; square brackets and escaped characters do not count."""
    assert is_complete(text) is complete


def test_the_place_of_the_opening():
    """The place is that of the outermost open element, over all pieces."""
    balance = Balance()
    assert balance.feed("a (b) ")
    assert balance.since == -1
    assert not balance.feed("c (d (e)")
    assert balance.since == 8
    assert balance.feed(" f)")
    assert balance.since == -1


@given(st.lists(st.text('ab(){}"\n ')))
def test_pieces_count_as_the_whole(pieces: list[str]):
    """Feeding pieces equals feeding their sum, unless a backslash ends a piece."""
    balance = Balance()
    for piece in pieces:
        balance.feed(piece)
    assert balance.complete is is_complete("".join(pieces))
