"""The property: groups by key. It is the DICT value of bottles and the content of a configuration."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Self

from rtf.bottle.bottle import Bottle, same
from rtf.bottle.containers import Container
from rtf.bottle.values import Kind
from rtf.bottle.writing import to_string

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from rtf.bottle.containers import Value
    from rtf.errors import Location


class Property(Container):
    """Groups by key, in the order in which the keys were first given; the last of two equal keys wins.

    The group of ``key`` is the bottle ``key value…``; the value of ``key`` is the group's second element. A key may
    have no value. Where a key was read from is kept beside it, see :meth:`location`; it takes no part in equality.
    Two properties are equal when they have the same keys and equal groups, in any order.
    """

    __slots__ = ("_groups", "_places")
    kind: ClassVar[Kind] = Kind.DICT
    __hash__ = None  # type: ignore[assignment]  # the protocol for "not hashable"

    def __init__(self, values: Mapping[str, object] | None = None) -> None:
        self._groups: dict[str, Bottle] = {}
        self._places: dict[str | tuple[str, str], Location] = {}
        for key, value in (values or {}).items():
            self.put(key, value)

    @classmethod
    def parse(cls, text: str) -> Self:
        """Parse the text form ``(key value…) (key2 …)``; elements outside lists are ignored. Errors as for bottles."""
        return cls.from_bottle(Bottle.parse(text))

    @classmethod
    def from_bottle(cls, bottle: Bottle) -> Self:
        """Return a property of the lists in ``bottle``, each a group named by the text of its first element."""
        made = cls()
        for item in bottle:
            if isinstance(item, Bottle):
                made.put_group(item)
        return made

    @classmethod
    def of_elements(cls, items: list[Value]) -> Self:
        """Return a property of the lists in ``items``, as :meth:`from_bottle` does."""
        return cls.from_bottle(Bottle.adopt(items))

    def elements(self) -> list[Value]:
        """Return the groups in the order of :meth:`to_bottle`."""
        keys = sorted(self._groups, key=lambda key: key.encode("utf-8", "surrogatepass"))
        return [self._groups[key] for key in keys]

    def to_bottle(self) -> Bottle:
        """Return a bottle of the groups in ascending byte order of their keys, as YARP sends a property."""
        return Bottle.adopt(self.elements())

    def to_text(self) -> str:
        """Return the text form, keys in ascending byte order; a key without a value is ``(key)``."""
        return self.to_bottle().to_text()

    def find(self, key: str) -> Value | None:
        """Return the first value of ``key``, ``None`` if the key is missing or has no value."""
        group = self._groups.get(key)
        return None if group is None else group.get(1)

    def get(self, key: str, default: Value | None = None) -> Value | None:
        """Return the first value of ``key``, or ``default`` if there is none."""
        value = self.find(key)
        return default if value is None else value

    def check(self, key: str) -> bool:
        """Return whether the key is present, with or without a value."""
        return key in self._groups

    def find_group(self, key: str) -> Bottle | None:
        """Return the group of ``key``, including the key. It is not a copy: changing it changes the property."""
        return self._groups.get(key)

    def location(self, key: str, inner: str | None = None) -> Location | None:
        """Return the location of ``key``, or of ``inner`` in the section ``key``; ``None`` if it was not recorded."""
        return self._places.get(key if inner is None else (key, inner))

    def put(self, key: str, *values: object, location: Location | None = None) -> None:
        """Set the group of ``key`` to the key and the values, replacing an earlier one."""
        self.put_group(Bottle([key, *values]), key=key, location=location)

    def put_group(self, group: Bottle, *, key: str | None = None, location: Location | None = None) -> None:
        """Set a group that includes its key; ``key`` avoids computing it."""
        if key is None:
            key = to_string(group.get(0))
        self._groups[key] = group
        if location is None:
            self._places.pop(key, None)
        else:
            self._places[key] = location

    def locate(self, location: Location, key: str, inner: str | None = None) -> None:
        """Record the location of a key, or of a key in a section."""
        self._places[key if inner is None else (key, inner)] = location

    def remove(self, key: str) -> None:
        """Remove a key, if it exists."""
        self._groups.pop(key, None)
        self._places = {
            place: location
            for place, location in self._places.items()
            if place != key and not (isinstance(place, tuple) and place[0] == key)
        }

    def update(self, other: Property) -> None:
        """Add every group of ``other`` with its locations; it replaces groups with the same key."""
        self._groups.update(other._groups)
        self._places.update(other._places)

    def copy(self) -> Self:
        """Return a copy: groups are copied, the values in them are shared."""
        made = type(self)()
        made.update(self)
        for key, group in self._groups.items():
            made.put_group(group[:], key=key, location=self._places.get(key))
        return made

    def keys(self) -> Iterator[str]:
        """Return the keys, in the order in which they were first set."""
        return iter(self._groups)

    def items(self) -> Iterator[tuple[str, Bottle]]:
        """Return the keys and groups, in the same order."""
        return iter(self._groups.items())

    def __iter__(self) -> Iterator[str]:
        return iter(self._groups)

    def __len__(self) -> int:
        return len(self._groups)

    def __contains__(self, key: object) -> bool:
        return key in self._groups

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Property):
            return NotImplemented
        return self._groups.keys() == other._groups.keys() and same(self.to_bottle(), other.to_bottle())

    def __str__(self) -> str:
        return self.to_text()

    def __repr__(self) -> str:
        return f"Property.parse({self.to_text()!r})"


def as_dict(value: Value | None) -> Property | None:
    """Return a property, ``None`` for anything else, a list included."""
    return value if isinstance(value, Property) else None
