"""The elements of a request or a command, read strictly, because they move robots.

A word in place of a number, or a number that is not finite, is refused instead of being read as 0. Integers are
accepted as floats and whole floats as integers, as people type them.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, as_int
from rtf.bottle.values import INT32_MAX, INT32_MIN
from rtf.robot.errors import RefusedError

if TYPE_CHECKING:
    from rtf.bottle import Value


def number(value: Value | None) -> float:
    """Return a finite number. Raises RefusedError."""
    if type(value) is float and math.isfinite(value):  # as nearly always
        return value
    if isinstance(value, int | float) and math.isfinite(value):
        return float(value)
    raise RefusedError(f"a finite number is needed, not {shown(value)}")


def whole(value: Value | None) -> int:
    """Return a whole number of 32 bits, such as that of a joint. Raises RefusedError."""
    if type(value) is int and INT32_MIN <= value <= INT32_MAX:  # as nearly always
        return value
    if isinstance(value, int | float) and math.isfinite(value) and value == as_int(value, 32):
        return int(value)
    raise RefusedError(f"a whole number is needed, not {shown(value)}")


def inner(value: Value | None, count: int | None = None) -> Bottle:
    """Return a list, with ``count`` elements unless that is None. Raises RefusedError."""
    if isinstance(value, Bottle) and count in (None, len(value)):
        return value
    raise RefusedError(f"a list of {'some' if count is None else count} values is needed, not {shown(value)}")


def shown(value: Value | None) -> str:
    """Return an element as text for a message."""
    return "nothing" if value is None else repr(str(value)[:60])
