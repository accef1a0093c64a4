"""Lines of the keys of a TOML file, for messages."""

from __future__ import annotations

import re
from collections import Counter
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

_TABLE = re.compile(r"\s*\[\[?\s*(.+?)\s*\]\]?\s*(?:#.*)?$")
_KEY = re.compile(r"""\s*((?:"[^"]*"|'[^']*'|[\w-]+)(?:\s*\.\s*(?:"[^"]*"|'[^']*'|[\w-]+))*)\s*=""")
_WORD = re.compile(r""""([^"]*)"|'([^']*)'|([\w-]+)""")
#: A word of the path in an error of msgspec: ``$.parts[...].joints`` has keys after dots, and places in brackets.
_STEP = re.compile(r"\.([\w-]+)|\[(\d+|\.\.\.)\]")


def line_of(text: str, path: Sequence[str]) -> int:
    """Return the line, from 1, that shares the longest beginning with ``path``: the first such table or key.

    A key inside of an inline table has the line of that table. A table of an array, ``[[body.outlines]]``, has its
    number, from 0, at the end of its path. 1 if nothing of the path is found.
    """
    best, found = 0, 1
    table: list[str] = []
    arrays: Counter[str] = Counter()
    for number, line in enumerate(text.splitlines(), 1):
        header = _TABLE.match(line)
        if header:
            here = table = _words(header[1])
            if line.lstrip().startswith("[["):
                name = ".".join(table)
                table.append(str(arrays[name]))
                arrays[name] += 1
        else:
            key = _KEY.match(line)
            if key is None:
                continue
            here = [*table, *_words(key[1])]
        shared = next((place for place, pair in enumerate(zip(here, path, strict=False)) if pair[0] != pair[1]), None)
        length = min(len(here), len(path)) if shared is None else shared
        if length > best:
            best, found = length, number
    return found


def steps_of(path: str) -> list[str]:
    """Return the steps of a path as msgspec writes it: ``$.parts.head`` is parts and head, ``[...]`` an ellipsis."""
    return [match[1] or match[2] for match in _STEP.finditer(path)]


def _words(dotted: str) -> list[str]:
    return [match[1] or match[2] or match[3] or "" for match in _WORD.finditer(dotted)]
