"""The text form of values, digit for digit as in YARP.

Parsing the text gives an equal value, except: integers become I32 or I64 for any width, F32 becomes F64, a
property a list of lists; the strings ``null``, ``nan``, ``inf`` become a vocab and floats; and a vocab that contains
blanks, commas, quotes, parentheses, braces, backslashes or a NUL in the middle, because nothing is escaped inside ``[
]``.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from rtf.bottle.containers import MAX_DEPTH, Container
from rtf.bottle.errors import BottleLimitError, BottleTypeError
from rtf.bottle.values import Float32, Int8, Int16, Int64, Vocab, Vocab64

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from rtf.bottle.containers import Value

_BARE = re.compile(r"[A-Za-z_][A-Za-z0-9_.\-]*")
_BOOLEANS = ("true", "false")
_TRUTHS = (0, ord("1"))
_SPECIAL = re.compile(r'[\\"\n\r\0]')
_ESCAPES = str.maketrans({"\\": "\\\\", '"': '\\"', "\n": "\\n", "\r": "\\r", "\0": "\\0"})


def items_text(items: Iterable[Value], depth: int = 0) -> str:
    """Return several values as text, separated by blanks. Raises :class:`BottleLimitError` if nested too deeply."""
    return " ".join([to_text(item, depth) for item in items])


def to_text(value: Value, depth: int = 0) -> str:
    """Return a value as text inside a bottle: strings quoted if necessary, lists in parentheses."""
    writer = _WRITERS.get(type(value))
    if writer is not None:
        return writer(value)
    if not isinstance(value, Container):
        raise BottleTypeError(f"a {type(value).__name__} is not a value of a bottle: {value!r}")
    if depth >= MAX_DEPTH:
        raise BottleLimitError(f"a bottle is nested more than {MAX_DEPTH} levels deep, or inside itself")
    return f"({items_text(value.elements(), depth + 1)})"


def to_string(value: Value | None) -> str:
    """Return a value as text alone: without quotes or brackets, and empty for ``None``."""
    if isinstance(value, str):
        return value
    if isinstance(value, Container):
        return items_text(value.elements())
    if value is None or isinstance(value, Vocab):
        return "" if value is None else str(value)
    return to_text(value).strip("{}")


def quote(text: str) -> str:
    """Return a string: bare if it looks like a name, else in double quotes; TAB and letters are not escaped."""
    if _BARE.fullmatch(text) and text not in _BOOLEANS:
        return text
    if _SPECIAL.search(text) is None:  # several times faster than a translation that changes nothing
        return f'"{text}"'
    return f'"{text.translate(_ESCAPES)}"'


def float_text(value: float) -> str:
    """Return a number with 21 significant digits without trailing zeros, always recognisable as a float."""
    text = f"{value:.21g}"
    return text if "." in text or "e" in text or "n" in text else text + ".0"


def _vocab_text(value: Vocab) -> str:
    return str(value) if value.value in _TRUTHS else f"[{value.text}]"


def _blob_text(value: bytes) -> str:
    return "{" + " ".join(map(str, value)) + "}"


_WRITERS: dict[type, Callable[[Any], str]] = {  # each function formats the type beside it
    int: str,
    str: quote,
    float: float_text,
    bytes: _blob_text,
    Vocab: _vocab_text,
    Vocab64: _vocab_text,
    Int8: str,
    Int16: str,
    Int64: str,
    Float32: float_text,
}
