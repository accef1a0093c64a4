"""Recognition and parsing of numbers, as YARP and the C library do.

A word is a number if it begins with a digit, a sign or a point (or is ``inf``, ``-inf``, ``nan``) and consists of
digits, points, signs and ``e``; after an ``x`` among the leading zeros and signs also of hexadecimal letters. An
integer is what the C library parses from the beginning: ``1-2`` is 1, ``-`` and ``-x`` are 0, ``08`` is 0 because it
is octal. With a point or an exponent the whole word has to be a number, or it is 0.0: ``1.5-2``, ``1e``.
"""

from __future__ import annotations

import re

from rtf.bottle.values import INT64_MAX, INT64_MIN

# Among the leading zeros there may be one sign; later signs do not matter. One point in all.
_DECIMAL_SHAPE = re.compile(r"0*+[+-]?+0*+(?![+-])[0-9eE+-]*+(?:\.[0-9eE+-]*+)?")
_HEXADECIMAL_SHAPE = re.compile(r"[0xX]*+[+-]?+[0xX]*+(?![+-])[0-9a-fA-F+-]*+(?:\.[0-9a-fA-F+-]*+)?")
_HEXADECIMAL_LEAD = re.compile(r"[0+-]*+[xX]")
_INTEGER = re.compile(r"([+-]?)(?:0[xX]([0-9a-fA-F]+)|(0[0-7]*)|([1-9][0-9]*))")
_FLOAT = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_HEXADECIMAL_FLOAT = re.compile(r"[+-]?0[xX](?:[0-9a-fA-F]+\.?[0-9a-fA-F]*|\.[0-9a-fA-F]+)")
_NAMED = {"inf": float("inf"), "-inf": float("-inf"), "nan": float("nan")}
_FIRST = frozenset("0123456789+-.")
_MAX_HEXADECIMAL_DIGITS = 8
_MAX_DIGITS = 22  # as many as the longest octal number of 64 bits has; longer ones are too large anyway


def read_number(word: str) -> int | float | None:
    """Parse a word as a number: an ``int`` clipped to 64 bits or a ``float``; ``None`` if it is a string."""
    if word in _NAMED:
        return _NAMED[word]
    hexadecimal = _HEXADECIMAL_LEAD.match(word) is not None
    shape = _HEXADECIMAL_SHAPE if hexadecimal else _DECIMAL_SHAPE
    if word[:1] not in _FIRST or word == "." or shape.fullmatch(word) is None:
        return None
    if hexadecimal and len(word) - max(word.rfind("x"), word.rfind("X")) - 1 > _MAX_HEXADECIMAL_DIGITS:
        return None
    if "." in word or (not hexadecimal and ("e" in word or "E" in word)):
        return _float(word)
    return _integer(word)


def _integer(word: str) -> int:
    match = _INTEGER.match(word)
    if match is None:
        return 0
    sign, hexadecimal, octal, decimal = match.groups()
    base, digits = (16, hexadecimal) if hexadecimal else (8, octal) if octal else (10, decimal)
    digits = digits.lstrip("0") or "0"
    magnitude = int(digits, base) if len(digits) <= _MAX_DIGITS else INT64_MAX + 1
    return max(-magnitude, INT64_MIN) if sign == "-" else min(magnitude, INT64_MAX)


def _float(word: str) -> float:
    if _HEXADECIMAL_FLOAT.fullmatch(word):
        return float.fromhex(word)
    return float(word) if _FLOAT.fullmatch(word) else 0.0
