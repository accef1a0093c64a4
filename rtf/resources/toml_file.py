"""TOML files that are read by a schema of msgspec, with file and line in every error.

:class:`TomlFile` reads one; :func:`line_of` finds the line of a key in its text.
"""

from __future__ import annotations

import copy
import re
import tomllib
from collections import Counter
from typing import TYPE_CHECKING, Any, Generic, NoReturn, TypeVar

import msgspec

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

T = TypeVar("T")

_TABLE = re.compile(r"\s*\[\[?\s*(.+?)\s*\]\]?\s*(?:#.*)?$")
_KEY = re.compile(r"""\s*((?:"[^"]*"|'[^']*'|[\w-]+)(?:\s*\.\s*(?:"[^"]*"|'[^']*'|[\w-]+))*)\s*=""")
_WORD = re.compile(r""""([^"]*)"|'([^']*)'|([\w-]+)""")
#: A word of the path in an error of msgspec: ``$.parts[...].joints`` has keys after dots, and places in brackets.
_STEP = re.compile(r"\.([\w-]+)|\[(\d+|\.\.\.)\]")

#: What msgspec says of a key that no table has.
_UNKNOWN_KEY = re.compile(r"Object contains unknown field `(.+)`")


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


class TomlFile(Generic[T]):
    """A file and its ``data``, which :meth:`converted` checks and turns into an object of a class of msgspec.

    ``error`` is the class of the exceptions, whose messages begin with the file and the line. It is also raised for a
    file that cannot be read.
    """

    def __init__(self, path: Path, error: type[Exception]) -> None:
        self.path = path
        self._error = error
        try:
            self.text = path.read_text(encoding="utf-8")
            self.data: dict[str, Any] = tomllib.loads(self.text)
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as failure:
            raise error(f"{path}: {failure}") from None

    def place(self, keys: Sequence[str]) -> str:
        """Return the place of a key, ``file:line``."""
        return f"{self.path}:{line_of(self.text, keys)}"

    def fail(self, keys: Sequence[str], problem: str) -> NoReturn:
        """Raise an error at the place of a key."""
        raise self._error(f"{self.place(keys)}: {problem}")

    def converted(self, kind: type[T], names: str) -> T:
        """Return the data as an object of this class; ``names`` says what a name that its pattern refuses should be."""
        try:
            return msgspec.convert(self.data, kind)
        except msgspec.ValidationError as error:
            sentence, _, path = str(error).partition(" - at ")
            keys = _named(self.data, kind, steps_of(path.strip("`$")), str(error))
            where = ".".join(keys) or "the file"
            if unknown := _UNKNOWN_KEY.fullmatch(sentence):
                self.fail([*keys, unknown[1]], f"{where}: there is no key {unknown[1]!r}")
            if "matching regex" in sentence:
                sentence = names
            self.fail(keys, f"{where}: {sentence[:1].lower()}{sentence[1:]}")


def _named(data: dict[str, Any], kind: type, steps: list[str], error: str) -> list[str]:
    """Return ``steps`` with the names of the keys that msgspec writes as an ellipsis: those that raise this error."""
    data = copy.deepcopy(data)
    here: Any = data
    for place, step in enumerate(steps):
        if step == "..." and isinstance(here, dict):
            everything = dict(here)
            for key, value in everything.items():
                here.clear()
                here[key] = value
                try:
                    msgspec.convert(data, kind)
                except msgspec.ValidationError as again:
                    if str(again) == error:
                        steps[place] = key
                        break
            step = steps[place]  # noqa: PLW2901 - its name is known now
        here = here[int(step)] if isinstance(here, list) else here.get(step)
    return steps


def _words(dotted: str) -> list[str]:
    return [match[1] or match[2] or match[3] or "" for match in _WORD.finditer(dotted)]
