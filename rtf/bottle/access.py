"""What a value is when it is asked for as something else; every question has an answer, for a missing value too.

These are YARP's conversions. They never raise: what has no sensible answer gives 0, the empty string, false or
``None``. Strings are not parsed: ``as_int("5")`` is 0. The questions for a list and a property stand beside those
classes.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rtf.bottle.values import INT64_MAX, INT64_MIN, Vocab, to_single

if TYPE_CHECKING:
    from rtf.bottle.containers import Value

_TRUTHS = (0, ord("1"))


def as_int(value: Value | None, bits: int = 64) -> int:
    """The integer: numbers cut towards zero, vocabs as their packed number, 0 for the rest.

    A number too large for ``bits`` wraps around, as a C cast does. An infinite float gives the largest 64-bit number
    of its sign, cut to ``bits``; a float that is no number gives 0.
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
    """The number in double precision: numbers as they are, vocabs as their packed number, 0.0 for the rest."""
    if isinstance(value, int | float):
        return float(value)
    return float(value.value) if isinstance(value, Vocab) else 0.0


def as_float32(value: Value | None) -> float:
    """As :func:`as_float`, rounded to single precision."""
    return to_single(as_float(value))


def as_bool(value: Value | None) -> bool:
    """Whether an integer or a vocab is not 0; everything else is false, floats and the string ``true`` included."""
    if isinstance(value, Vocab):
        return bool(value)
    return isinstance(value, int) and value != 0


def is_bool(value: Value | None) -> bool:
    """Whether the value is one of the two vocabs that stand for false and true."""
    return isinstance(value, Vocab) and value.value in _TRUTHS


def as_string(value: Value | None) -> str:
    """A string as it is, a vocab as its characters or ``true`` or ``false``, else the empty string."""
    if isinstance(value, str):
        return value
    return str(value) if isinstance(value, Vocab) else ""


def as_vocab(value: Value | None) -> Vocab:
    """A vocab of 32 bits: a vocab as it is, the first four bytes of a string, an integer's lowest 32 bits, else 0."""
    if isinstance(value, str):
        return Vocab.truncated(value)
    if isinstance(value, float):
        return Vocab(0)
    return Vocab(as_int(value, 32))


def as_bytes(value: Value | None) -> bytes | None:
    """The bytes of a blob, ``None`` for anything else."""
    return value if isinstance(value, bytes) else None
