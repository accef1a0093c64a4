"""The small languages inside a suite file: words, durations, whole numbers, variables, names of files.

Pure functions on strings. Each raises ValueError with a sentence that fits after "attribute x of <y>"; the caller adds
the place.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from rtf.xml_tree import quote

if TYPE_CHECKING:
    from collections.abc import Mapping

MAX_TEXT = 64 * 1024
"""The longest attribute or text after variables were put in, in characters."""

SHORTEST = 0.001
LONGEST = 30 * 24 * 3600.0
"""Thirty days: longer than any endurance test, short enough to catch milliseconds written as seconds."""

_SECONDS = {"ms": 0.001, "s": 1.0, "min": 60.0, "h": 3600.0}
_DURATION = re.compile(r"([0-9]{1,12}(?:\.[0-9]{0,9})?|\.[0-9]{1,9}) ?(ms|s|min|h)?")
_INTEGER = re.compile(r"[+-]?[0-9]{1,12}")
_VARIABLE = re.compile(r"\$\{([^{}$]{1,64})\}")
_FROM_FILE = re.compile(r'(?<![^ ])--from +(?:"([^"]*)"|([^ "]+))')
_SUFFIX = re.compile(r"\.[A-Za-z]{1,5}(?:\.[0-9]{1,9})*$")
_QUOTED = re.compile(r""""([^"]*)"|'([^']*)'""")
_WORD = r"""((?:[^%s"']|"[^"]*"|'[^']*')+)|(["'])"""
_WORDS = {commas: re.compile(_WORD % (r"\s," if commas else r"\s")) for commas in (False, True)}


def split_words(text: str, *, commas: bool = True) -> tuple[str, ...]:
    """Split at white space (and commas); single or double quotes protect, also in the middle of a word."""
    words = []
    for match in _WORDS[commas].finditer(text):
        if match[2]:
            raise ValueError(f"has a quote ({match[2]}) that is never closed")
        words.append(_QUOTED.sub(lambda quoted: quoted[1] or quoted[2] or "", match[1]))
    return tuple(words)


def parse_duration(text: str, low: float = SHORTEST, high: float = LONGEST) -> float:
    """Read ``20``, ``1.5 s``, ``200ms``, ``3min`` or ``1h``; the answer is in seconds."""
    match = _DURATION.fullmatch(text.strip())
    allowed = f"a duration from {low:g} s to {high:g} s such as 20, 1.5s, 200ms, 3min or 1h"
    if match is None:
        raise ValueError(f"is {quote(text)}; it must be {allowed}")
    seconds = float(match[1]) * _SECONDS[match[2] or "s"]
    if not low <= seconds <= high:
        raise ValueError(f"is {quote(text)}, which is out of range; it must be {allowed}")
    return seconds


def parse_integer(text: str, low: int, high: int) -> int:
    """Read a whole number in ASCII digits."""
    allowed = f"a whole number from {low} to {high}"
    if _INTEGER.fullmatch(text.strip()) is None:
        raise ValueError(f"is {quote(text)}; it must be {allowed}")
    number = int(text)
    if not low <= number <= high:
        raise ValueError(f"is {quote(text)}, which is out of range; it must be {allowed}")
    return number


def substitute(text: str, bindings: Mapping[str, str]) -> str:
    """Replace ``${name}`` by its value; a name without a value stays as it is, and values are not looked into again."""
    if "${" not in text or not bindings:
        return text
    size = len(text) + sum(len(bindings.get(match[1], "")) for match in _VARIABLE.finditer(text))
    if size > MAX_TEXT:
        raise ValueError(f"is longer than {MAX_TEXT} characters once its variables are put in")
    return _VARIABLE.sub(lambda match: bindings.get(match[1], match[0]), text)


def variables_in(text: str) -> list[str]:
    """Return the names of the variables in a text."""
    return _VARIABLE.findall(text) if "${" in text else []


def plugin_stem(plugin: str) -> str:
    """Return the name of a plug-in without folder and file ending: ``checks/arms.py::Left`` gives ``arms::Left``."""
    plugin, separator, class_name = plugin.partition("::")
    name = plugin.replace("\\", "/").rstrip("/").rpartition("/")[2] or plugin
    return (_SUFFIX.sub("", name, count=1) or name) + separator + class_name


def parameter_file_stem(param: str) -> str:
    """Return the stem of the file that a parameter string names with ``--from``; empty if it names none."""
    match = _FROM_FILE.search(param)
    if match is None:
        return ""
    return (match[1] or match[2] or "").rpartition("/")[2].removesuffix(".ini")
