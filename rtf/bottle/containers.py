"""The common base of lists and properties, for modules that must not import these classes.

The readers and writers of values are imported by :class:`~rtf.bottle.Bottle`; what they need of it is here. The classes
register themselves when they are defined.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, TypeAlias

from rtf.bottle.errors import BottleTypeError
from rtf.bottle.values import (
    INT32_MAX,
    INT32_MIN,
    Float32,
    Int8,
    Int16,
    Int64,
    Kind,
    Vocab,
    Vocab64,
)

MAX_DEPTH = 100
"""The largest nesting of lists, in text, on the wire and in memory; YARP has no limit, robots use three levels."""


class Container(ABC):
    """A value that contains values: a bottle, which is a list, or a property."""

    __slots__ = ()
    kind: ClassVar[Kind]

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if "kind" in vars(cls):
            _KINDS[cls] = cls.kind
            CONTAINERS[cls.kind] = cls

    @classmethod
    @abstractmethod
    def of_elements(cls, items: list[Value]) -> Container:
        """Return a container that takes ownership of elements; nothing is checked or copied."""

    @abstractmethod
    def elements(self) -> list[Value]:
        """Return the elements, of a property its groups, in the order of writing. They must not be changed."""


Value: TypeAlias = int | float | str | bytes | Vocab | Container
"""What a bottle holds. A missing value (YARP's null value) is ``None`` and is never inside a bottle."""

#: The classes of lists and properties.
CONTAINERS: dict[Kind, type[Container]] = {}
_KINDS: dict[type, Kind] = {
    float: Kind.FLOAT64,
    str: Kind.STRING,
    bytes: Kind.BLOB,
    Vocab: Kind.VOCAB32,
    Vocab64: Kind.VOCAB64,
    Int8: Kind.INT8,
    Int16: Kind.INT16,
    Int64: Kind.INT64,
    Float32: Kind.FLOAT32,
}


def is_value(value: object) -> bool:
    """Return whether an object may be in a bottle without conversion; False for plain integers, which are checked."""
    return type(value) in _KINDS


def kind_of(value: Value) -> Kind:
    """Return the type of a value. Raises :class:`BottleTypeError` for any other object."""
    if type(value) is int:
        return Kind.INT32 if INT32_MIN <= value <= INT32_MAX else Kind.INT64
    try:
        return _KINDS[type(value)]
    except KeyError:
        raise BottleTypeError(f"a {type(value).__name__} is not a value of a bottle: {value!r}") from None
