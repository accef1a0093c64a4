"""The variables of configuration files."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.bottle import Property
from rtf.resources import ResourceError, ResourceLimitError
from rtf.resources.variables import Variables

READ = Property.parse('(read 1) (given 2) (env 3) (words "a b") (list (1 2)) (dir "C:\\\\x") (flag)')
VARIABLES = Variables({"env": "E", "empty": "", "words2": "x y"}, Property.parse("(given G) (env 4) (empty D)"))


@pytest.mark.parametrize(
    ("text", "expanded"),
    [
        ("plain", "plain"),
        ("/${env}/x", "/E/x"),
        ("/$(env)/x", "/E/x"),
        ("/$env/x", "/E/x"),
        ("$env", "E"),
        ("$env$given$read", "EG1"),
        ("${empty}", "D"),
        ("$words", "a b"),
        ("$list", "1 2"),
        ("$dir", "C:\\\\x"),
        ("$__YARP__", "1"),
        ("\\$env \\\\", "\\$env \\\\"),
        ("${env-x}", "E-x}"),
        ("$env}", "E}"),
        ("$(env}", "E"),
        ("$e\\nv", "E"),
        ("[$env]", "[E]"),
    ],
)
def test_expansion(text: str, expanded: str):
    """A variable is that of the environment, the given ones, or the keys read before, in this order."""
    assert VARIABLES.expand(text, READ, 1000) == (expanded, [])


@pytest.mark.parametrize(
    ("text", "expanded", "names"),
    [
        ("/${robotname}/x", "//x", ["robotname"]),
        ("$a$b", "", ["a", "b"]),
        ("5 $ 6", "5  6", [""]),
        ("${}x", "x", [""]),
        ("$\u00e9", "\u00e9", [""]),
    ],
)
def test_undefined_variables_become_empty_and_are_named(text: str, expanded: str, names: list[str]):
    """An unknown variable is empty, as in YARP, and its name is returned."""
    assert VARIABLES.expand(text, READ, 1000) == (expanded, names)


def test_a_key_without_a_value_is_defined():
    """A key without a value is defined and empty."""
    assert VARIABLES.expand("$flag", READ, 1000) == ("", [])


def test_values_are_not_expanded_again():
    """Variables in values are not expanded."""
    assert Variables({"a": "$b", "b": "x"}, Property()).expand("$a", Property(), 10) == ("$b", [])


def test_expansion_is_bounded():
    """Expanded text has a limit."""
    with pytest.raises(ResourceLimitError, match="longer than 100"):
        Variables({"a": "x" * 60}, Property()).expand("$a $a", Property(), 100)


@given(st.text("$(){}\\ab_ \u00e9", max_size=40))
def test_any_text_expands_or_raises_our_error(text: str):
    """Any text is expanded, or raises ResourceError."""
    try:
        VARIABLES.expand(text, READ, 1000)
    except ResourceError:
        return
