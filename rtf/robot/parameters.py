"""Access to the parameters of a configuration, with checks; errors name the location in the file."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Property, as_bool, as_float, as_int, as_string, to_string
from rtf.middleware.carriers import registry
from rtf.middleware.errors import MiddlewareError
from rtf.robot.errors import ConfigurationError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rtf.bottle import Value

_YES = ("on", "true", "yes", "1")
_NO = ("off", "false", "no", "0")


def wrong(configuration: Property, key: str, sentence: str) -> ConfigurationError:
    """Return the error for a parameter; the message begins with its location."""
    location = configuration.location(key)
    return ConfigurationError(f"{key}: {sentence}" if location is None else f"{location}: {key}: {sentence}")


def group_of(configuration: Property, key: str) -> Property:
    """Return a group as a configuration, with the locations of its keys; an empty one if it is missing."""
    group = Property.from_bottle(configuration.find_group(key) or Bottle())
    for inner in group:
        location = configuration.location(key, inner) or configuration.location(key)
        if location is not None:
            group.locate(location, inner)
    return group


def port_name(configuration: Property, key: str, default: str | None = None) -> str:
    """Return a prefix of port names, such as ``/icub/inertial``; required unless there is a ``default``."""
    value = configuration.find(key)
    if value is None:
        if default is not None:
            return default
        raise wrong(configuration, key, "it is missing; it is the prefix of the port names, such as /icub/inertial")
    name = as_string(value).rstrip("/")
    if not name.startswith("/"):
        raise wrong(configuration, key, f"{to_string(value)} is not a port name; it begins with '/'")
    return name


def carrier(configuration: Property, default: str) -> str:
    """Return the parameter ``carrier``, the name of a known carrier."""
    name = as_string(configuration.get("carrier", default))
    try:
        registry.by_name(name)
    except MiddlewareError as error:
        raise wrong(configuration, "carrier", str(error)) from None
    return name


def positive(configuration: Property, key: str, default: float | None = None) -> float:
    """Return a number above 0; required unless there is a ``default``."""
    value = configuration.get(key, default)
    if value is None:
        raise wrong(configuration, key, "it is missing; it is a number above 0")
    found = as_float(value)
    if not isinstance(value, int | float) or not 0 < found < math.inf:
        raise wrong(configuration, key, f"{to_string(value)} is not a number above 0")
    return found


def number(configuration: Property, key: str, default: float) -> float:
    """Return a finite number."""
    value = configuration.get(key, default)
    if not isinstance(value, int | float) or not math.isfinite(value):
        raise wrong(configuration, key, f"{to_string(value)} is not a number")
    return float(value)


def text(configuration: Property, key: str, default: str | None = None) -> str:
    """Return a word or a text; required unless there is a ``default``."""
    value = configuration.get(key, default)
    if value is None or not as_string(value):
        raise wrong(configuration, key, "it is missing")
    return as_string(value)


def choice(configuration: Property, key: str, default: str, words: Iterable[str]) -> str:
    """Return one of some words."""
    found = text(configuration, key, default)
    if found not in (known := [*words]):
        raise wrong(configuration, key, f"{found!r} is none of {', '.join(known)}")
    return found


def count(configuration: Property, key: str, default: int, most: int) -> int:
    """Return a whole number from 1 to ``most``."""
    value = configuration.get(key, default)
    if not isinstance(value, int) or not 1 <= value <= most:
        raise wrong(configuration, key, f"{to_string(value)} is not a whole number from 1 to {most}")
    return as_int(value)


def flag(configuration: Property, key: str, *, default: bool = False) -> bool:
    """Return a yes or no parameter; a key without a value means yes."""
    if not configuration.check(key):
        return default
    value = configuration.find(key)
    word = as_string(value).lower()
    if value is None or word in _YES:
        return True
    if word not in ("", *_NO) or isinstance(value, Bottle):
        raise wrong(configuration, key, f"{to_string(value)} is neither yes nor no")
    return as_bool(value)


def names(configuration: Property, key: str) -> tuple[str, ...]:
    """Return a list of words, ``(a b)``; empty if the key is missing."""
    value: Value | None = configuration.find(key)
    given = value if isinstance(value, Bottle) else Bottle([] if value is None else [value])
    found = tuple(map(as_string, given))
    if not all(found):
        raise wrong(configuration, key, f"{to_string(value)} is not a list of names, such as (left right)")
    return found
