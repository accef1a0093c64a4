"""The parameters of a configuration, read with what they must be; whoever wrote it wrong is told where."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Property, as_bool, as_float, as_int, as_string, to_string
from rtf.middleware.carriers import registry
from rtf.middleware.errors import MiddlewareError
from rtf.robot.errors import ConfigurationError

if TYPE_CHECKING:
    from rtf.bottle import Value

_YES = ("on", "true", "yes", "1")
_NO = ("off", "false", "no", "0")


def wrong(configuration: Property, key: str, sentence: str) -> ConfigurationError:
    """The error to raise for a parameter; it begins with its place."""
    location = configuration.location(key)
    return ConfigurationError(f"{key}: {sentence}" if location is None else f"{location}: {key}: {sentence}")


def group_of(configuration: Property, key: str) -> Property:
    """A group as a configuration of its own; of nothing if it is not there."""
    return Property.from_bottle(configuration.find_group(key) or Bottle())


def port_name(configuration: Property, key: str, default: str | None = None) -> str:
    """What the names of ports begin with, such as ``/icub/inertial``; without ``default`` it must be there."""
    value = configuration.find(key)
    if value is None:
        if default is not None:
            return default
        raise wrong(configuration, key, "it is missing; it begins the names of ports, such as /icub/inertial")
    name = as_string(value).rstrip("/")
    if not name.startswith("/"):
        raise wrong(configuration, key, f"{to_string(value)} is no name of ports; it begins with '/'")
    return name


def carrier(configuration: Property, default: str) -> str:
    """The parameter ``carrier``: the name of one that is known here."""
    name = as_string(configuration.get("carrier", default))
    try:
        registry.by_name(name)
    except MiddlewareError as error:
        raise wrong(configuration, "carrier", str(error)) from None
    return name


def positive(configuration: Property, key: str, default: float | None = None) -> float:
    """A number above 0; without ``default`` it must be there."""
    value = configuration.get(key, default)
    if value is None:
        raise wrong(configuration, key, "it is missing; it is a number above 0")
    number = as_float(value)
    if not isinstance(value, int | float) or not 0 < number < math.inf:
        raise wrong(configuration, key, f"{to_string(value)} is no number above 0")
    return number


def count(configuration: Property, key: str, default: int, most: int) -> int:
    """A whole number from 1 to ``most``."""
    value = configuration.get(key, default)
    if not isinstance(value, int) or not 1 <= value <= most:
        raise wrong(configuration, key, f"{to_string(value)} is no whole number from 1 to {most}")
    return as_int(value)


def flag(configuration: Property, key: str, *, default: bool = False) -> bool:
    """Yes or no; a key without a value says yes."""
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
    """A list of words, ``(a b)``; of none if the key is not there."""
    value: Value | None = configuration.find(key)
    given = value if isinstance(value, Bottle) else Bottle([] if value is None else [value])
    found = tuple(map(as_string, given))
    if not all(found):
        raise wrong(configuration, key, f"{to_string(value)} is no list of names, such as (left right)")
    return found
