"""Conversions of a value to another type, as in YARP; a missing value can be converted, too.

They never raise: a value without a sensible conversion gives 0, the empty string, false or ``None``. Strings are not
parsed: ``as_int("5")`` is 0. The conversions to a list and a property are beside those classes.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rtf.bottle.values import INT64_MAX, INT64_MIN, Vocab, to_single

if TYPE_CHECKING:
    from rtf.bottle.containers import Value

_TRUTHS = (0, ord("1"))


def as_int(value: Value | None, bits: int = 64) -> int:
    """Return an integer: numbers truncated towards zero, vocabs as their packed number, else 0.

    A number too large for ``bits`` wraps around, as in a C cast. An infinite float gives the largest 64-bit number of
    its sign, truncated to ``bits``; NaN gives 0.
    """
    if isinstance(value, float):
        value = _whole(value)
    elif isinstance(value, Vocab):
        value = value.value
    elif not isinstance(value, int):
        return 0
    half = 1 << bits - 1
    return value if -half <= value < half else (value + half) % (2 * half) - half


def _whole(value: float) -> int:
    if math.isnan(value):
        return 0
    if math.isinf(value) or not INT64_MIN <= value <= INT64_MAX:
        return INT64_MAX if value > 0 else INT64_MIN
    return int(value)


def as_float(value: Value | None) -> float:
    """Return a float: numbers unchanged, vocabs as their packed number, else 0.0."""
    if isinstance(value, int | float):
        return float(value)
    return float(value.value) if isinstance(value, Vocab) else 0.0


def as_float32(value: Value | None) -> float:
    """Return the same as :func:`as_float`, rounded to single precision."""
    return to_single(as_float(value))


def as_bool(value: Value | None) -> bool:
    """Return whether an integer or a vocab is not 0; False for all else, floats and the string ``true`` included."""
    if isinstance(value, Vocab):
        return bool(value)
    return isinstance(value, int) and value != 0


def is_bool(value: Value | None) -> bool:
    """Return whether the value is one of the two vocabs for false and true."""
    return isinstance(value, Vocab) and value.value in _TRUTHS


def as_string(value: Value | None) -> str:
    """Return a string unchanged, a vocab as its characters or ``true`` or ``false``, else the empty string."""
    if isinstance(value, str):
        return value
    return str(value) if isinstance(value, Vocab) else ""


def as_vocab(value: Value | None) -> Vocab:
    """Return a 32-bit vocab: of a vocab, the first four bytes of a string, or an integer's low 32 bits; else 0."""
    if isinstance(value, str):
        return Vocab.truncated(value)
    if isinstance(value, float):
        return Vocab(0)
    return Vocab(as_int(value, 32))


def as_bytes(value: Value | None) -> bytes | None:
    """Return the bytes of a blob, ``None`` for anything else."""
    return value if isinstance(value, bytes) else None
