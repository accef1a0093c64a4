"""The property: groups by key. It is the DICT value of bottles and the contents of a configuration."""

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
        """Read the text form ``(key value…) (key2 …)``; what stands outside lists is ignored. Errors as for bottles."""
        return cls.from_bottle(Bottle.parse(text))

    @classmethod
    def from_bottle(cls, bottle: Bottle) -> Self:
        """Make a property of the lists in ``bottle``, each a group named by the text of its first element."""
        made = cls()
        for item in bottle:
            if isinstance(item, Bottle):
                made.put_group(item)
        return made

    @classmethod
    def of_elements(cls, items: list[Value]) -> Self:
        """As :meth:`from_bottle`, of the elements of one."""
        return cls.from_bottle(Bottle.adopt(items))

    def elements(self) -> list[Value]:
        """The groups as :meth:`to_bottle` has them."""
        keys = sorted(self._groups, key=lambda key: key.encode("utf-8", "surrogatepass"))
        return [self._groups[key] for key in keys]

    def to_bottle(self) -> Bottle:
        """A bottle of the groups in ascending byte order of their keys: what YARP sends for a property."""
        return Bottle.adopt(self.elements())

    def to_text(self) -> str:
        """Write the text form, keys in ascending byte order; a key without a value is written ``(key)``."""
        return self.to_bottle().to_text()

    def find(self, key: str) -> Value | None:
        """The first value of ``key``, ``None`` when the key is missing or has no value."""
        group = self._groups.get(key)
        return None if group is None else group.get(1)

    def get(self, key: str, default: Value | None = None) -> Value | None:
        """The first value of ``key``, or ``default`` when there is none."""
        value = self.find(key)
        return default if value is None else value

    def check(self, key: str) -> bool:
        """Whether the key is present, with or without a value."""
        return key in self._groups

    def find_group(self, key: str) -> Bottle | None:
        """The group of ``key``, beginning with the key itself. It is not a copy: changing it changes the property."""
        return self._groups.get(key)

    def location(self, key: str, inner: str | None = None) -> Location | None:
        """Where ``key``, or ``inner`` in the section ``key``, was read from; ``None`` when nobody recorded it."""
        return self._places.get(key if inner is None else (key, inner))

    def put(self, key: str, *values: object, location: Location | None = None) -> None:
        """Set the group of ``key`` to the key and the values, forgetting what was there."""
        self.put_group(Bottle([key, *values]), key=key, location=location)

    def put_group(self, group: Bottle, *, key: str | None = None, location: Location | None = None) -> None:
        """Set a group that already begins with its key; ``key`` spares working it out."""
        if key is None:
            key = to_string(group.get(0))
        self._groups[key] = group
        if location is None:
            self._places.pop(key, None)
        else:
            self._places[key] = location

    def locate(self, location: Location, key: str, inner: str | None = None) -> None:
        """Record where a key, or a key in a section, was read from."""
        self._places[key if inner is None else (key, inner)] = location

    def remove(self, key: str) -> None:
        """Take a key away; one that is not there is no error."""
        self._groups.pop(key, None)
        self._places = {
            place: location
            for place, location in self._places.items()
            if place != key and not (isinstance(place, tuple) and place[0] == key)
        }

    def update(self, other: Property) -> None:
        """Take over every group of ``other`` with its places; where both have a key, the other's group wins."""
        self._groups.update(other._groups)
        self._places.update(other._places)

    def copy(self) -> Self:
        """A property that can change without changing this one: groups are copied, the values in them are shared."""
        made = type(self)()
        made.update(self)
        for key, group in self._groups.items():
            made.put_group(group[:], key=key, location=self._places.get(key))
        return made

    def keys(self) -> Iterator[str]:
        """The keys, in the order in which they were first given."""
        return iter(self._groups)

    def items(self) -> Iterator[tuple[str, Bottle]]:
        """Every key with its group, in the same order."""
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
    """The property, ``None`` for anything else, a list included."""
    return value if isinstance(value, Property) else None
