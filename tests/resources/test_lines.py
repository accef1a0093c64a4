"""Joining lines, and finding comments."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.resources import DiagnosticKind
from rtf.resources.lines import comment_start, join_lines, split_lines


def joined(text: str) -> list[str]:
    """Join the lines of a text."""
    return [line.text for line in join_lines(split_lines(text, "f"))]


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        ("a\nb", ["a", "b"]),
        ("a\r\nb\r\n", ["a", "b", ""]),
        ("a (1\n 2)\nb", ["a (1 2)", "b"]),
        ("a {1\n 2}\nb", ["a {1 2}", "b"]),
        ('a "1\n 2"\nb', ['a "1 2"', "b"]),
        ("a \\\nb", ["a b"]),
        ("a \\\r\nb", ["a b"]),
        ("a \\\\\nb", ["a \\\\", "b"]),
        ("a (1 \\\n 2)", ["a (1  2)"]),
        ("a (1\n# 2\n3)", ["a (1# 23)"]),
        ("a [1\n2]", ["a [1", "2]"]),
        ("a \\", ["a "]),
    ],
)
def test_joining(text: str, lines: list[str]):
    """Open quotes, lists and blobs, and a backslash, join lines; square brackets do not."""
    assert joined(text) == lines


def test_a_joined_line_stands_where_it_begins():
    """The place of a joined line is its first line."""
    lines = list(join_lines(split_lines("a\nb (1\n2)\nc", "f.ini")))
    assert [str(line.location) for line in lines] == ["f.ini:1", "f.ini:2", "f.ini:4"]


@pytest.mark.parametrize(
    ("text", "rest"),
    [
        ("a 1", "a 1"),
        ("a 1 // b", "a 1 "),
        ("a 1 # b", "a 1"),
        ("# b", ""),
        ("// b", ""),
        ("url http://x", "url http:"),
        ('url "http://x" // y', 'url "http://x" '),
        ('a "x # y" # z', 'a "x # y"'),
        ("a#b", "a#b"),
        ("a /# b", "a /# b"),
        ("a / / b", "a / / b"),
        ("a\t#b", "a"),
        ("a /b/c", "a /b/c"),
    ],
)
def test_comments(text: str, rest: str):
    """Outside quotes ``//`` begins a comment anywhere, ``#`` only at the beginning or after a blank."""
    end = comment_start(text)
    assert (text if end < 0 else text[:end]) == rest


@pytest.mark.parametrize(
    ("text", "kind", "place"),
    [
        ("a (1\n2)", DiagnosticKind.GLUED_LINES, "f:2"),
        ("a\\\nb", DiagnosticKind.GLUED_LINES, "f:2"),
        ("a 1\nb (2\nc 3", DiagnosticKind.UNBALANCED, "f:2"),
        ("a (1 # one\n2)", DiagnosticKind.SWALLOWED_LINES, "f:1"),
        ("# it's (odd\nb 1\n# )", DiagnosticKind.SWALLOWED_LINES, "f:1"),
    ],
)
def test_what_joining_does_is_reported(text: str, kind: DiagnosticKind, place: str):
    """Joins that glue words or hide text are reported with their place."""
    found = [item for line in join_lines(split_lines(text, "f")) for item in line.diagnostics()]
    assert [(item.kind, str(item.location)) for item in found] == [(kind, place)]
    assert str(found[0]).startswith(f"{place}: ")


@pytest.mark.parametrize("text", ["a 1\nb 2", "a (1\n 2)", "a (1,\n2\n)", "a \\\n b", "a (1 \\\n2)", "# a\n# b"])
def test_ordinary_text_is_not_reported(text: str):
    """Matrices over several lines are not reported."""
    assert not [item for line in join_lines(split_lines(text, "f")) for item in line.diagnostics()]


@given(st.text('ab(){}"#/\\\n '))
def test_joining_loses_only_line_ends_and_backslashes(text: str):
    """Joining keeps every other character, in order."""
    assert "".join(joined(text)).replace("\\", "") == text.replace("\n", "").replace("\\", "")
