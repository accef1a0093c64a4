"""Command lines: splitting of a parameter string into words, and conversion of words to a property."""

from __future__ import annotations

import re
from itertools import takewhile
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Property, is_complete, to_string

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rtf.bottle import Value

_WORD = re.compile(r'"([^"]*)"?|([^ "]+)')


def split_arguments(text: str) -> list[str]:
    """Split a parameter string of a suite file into words, as the C++ framework does.

    Only blanks separate words; tabs and newlines are ordinary characters. A double quote begins or ends a part in which
    blanks are kept; it is not part of a word, and separates words, so ``a"b c"d`` is three words and ``""`` none. A
    quote that is not closed extends to the end. There are no escapes, and no limit to the number of words.
    """
    return [word[1] or word[2] for word in _WORD.finditer(text) if word[1] or word[2]]


def loose_words(text: str) -> list[str]:
    """Return the words before the first ``--key`` of a parameter string, which belong to no key."""
    return list(takewhile(lambda word: not word.startswith("--"), split_arguments(text)))


def parse_arguments(words: Iterable[str], *, into: Property | None = None) -> Property:
    """Convert ``--key value…`` words to a property; they are added to ``into`` if it is given, else to a new property.

    Words before the first ``--key`` are ignored; ``-5`` is a value. ``--section::key value`` sets a key inside a
    section. Each word is parsed as a value: a number, a list in parentheses, a string. A backslash is an ordinary
    character. A word with several values (it contains a blank) and one with open quotes or brackets are strings. Raises
    :class:`~rtf.bottle.BottleError` for words beyond the limits of bottles.
    """
    properties = Property() if into is None else into
    groups: list[Bottle] = []
    for word in words:
        if word.startswith("--"):
            groups.append(Bottle([_value(word[2:])]))
        elif groups:
            groups[-1].append(_value(word))
    for group in groups:
        key = to_string(group[0])
        if not key:
            continue
        if "::" in key:
            _put_nested(properties, key, group)
        else:
            properties.put_group(group, key=key)
    return properties


def _value(word: str) -> Value:
    text = word.replace("\\", "\\\\")
    values = Bottle.parse(text) if is_complete(text) else Bottle()
    return values[0] if len(values) == 1 else word


def _put_nested(properties: Property, key: str, group: Bottle) -> None:
    first, *rest = key.removesuffix("::").split("::")
    parent = properties.find_group(first)
    if parent is None:
        parent = Bottle([first])
        properties.put_group(parent, key=first)
    for name in rest:
        child = next((item for item in parent if isinstance(item, Bottle) and to_string(item.get(0)) == name), None)
        if child is None:
            child = Bottle([name])
            parent.append(child)
        parent = child
    parent[:] = [rest[-1] if rest else first, *group[1:]]
