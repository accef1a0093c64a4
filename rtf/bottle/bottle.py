"""The bottle: a list of typed values, with look-ups of values and groups by key."""

from __future__ import annotations

from collections.abc import Callable, Iterable, MutableSequence
from typing import Any, ClassVar, SupportsIndex, overload

from rtf.bottle.containers import MAX_DEPTH, Container, Value, is_value, kind_of
from rtf.bottle.errors import BottleError, BottleLimitError, BottleTypeError
from rtf.bottle.reading import read_items
from rtf.bottle.values import FALSE, INT64_MAX, INT64_MIN, TRUE, Dialect, Kind
from rtf.bottle.writing import items_text, to_string


class Bottle(MutableSequence[Value], Container):
    """A list of values. Elements are checked and converted when they are added; a nested bottle is a list value.

    ``bool`` becomes a vocab, lists, tuples and arrays become bottles, enumerations their plain value. Two bottles are
    equal when the types and contents of their elements are (``1`` is not ``1.0``). Membership and ``index`` use
    Python's own equality. A bottle can change, so it is not hashable.
    """

    __slots__ = ("_items",)
    kind: ClassVar[Kind] = Kind.LIST
    __hash__ = None  # type: ignore[assignment]  # the protocol for "not hashable"

    def __init__(self, values: Iterable[object] = ()) -> None:
        self._items: list[Value] = [coerce(value) for value in values]

    @staticmethod
    def adopt(items: list[Value]) -> Bottle:
        """Return a bottle that takes ownership of a list of values; nothing is checked or copied."""
        bottle: Bottle = Bottle.__new__(Bottle)
        bottle._items = items
        return bottle

    @classmethod
    def of_elements(cls, items: list[Value]) -> Bottle:
        """See :meth:`adopt`."""
        return cls.adopt(items)

    def elements(self) -> list[Value]:
        """Return the list of the bottle's elements, which must not be changed."""
        return self._items

    @staticmethod
    def parse(text: str, *, strict: bool = False, dialect: Dialect = Dialect.YARP3) -> Bottle:
        """Parse the text form. As in YARP an element that is not closed is dropped; ``strict`` raises an error.

        Raises :class:`BottleLimitError` for text that is too long or too deeply nested, :class:`BottleSyntaxError`
        when strict, :class:`BottleError` for a vocab that cannot be written as UTF-8, and nothing else.
        """
        return Bottle.adopt(read_items(text, strict=strict, dialect=dialect))

    def to_text(self) -> str:
        """Return the text form: elements separated by one blank, without outer parentheses."""
        return items_text(self._items)

    def get(self, index: int, default: Value | None = None) -> Value | None:
        """Return the element at ``index``, or ``default`` if there is none; as in YARP a negative index has none."""
        return self._items[index] if 0 <= index < len(self._items) else default

    def tail(self) -> Bottle:
        """Return a new bottle of all elements but the first."""
        return self.adopt(self._items[1:])

    def find(self, key: str) -> Value | None:
        """Return the second element of the list ``(key …)``, or the element after a flat ``key``; else ``None``.

        The elements are scanned in order and the first match wins, even when nothing follows it.
        """
        index = self._position(key)
        if index < 0:
            return None
        found = self._items[index]
        return found.get(1) if isinstance(found, Bottle) else self.get(index + 1)

    def check(self, key: str) -> bool:
        """Return whether ``key`` is the first element of a list in this bottle, or an element itself."""
        return self._position(key) >= 0

    def find_group(self, key: str) -> Bottle | None:
        """Return the list ``(key …)`` itself, or for a flat key a new bottle of the key and the next element."""
        index = self._position(key)
        if index < 0:
            return None
        found = self._items[index]
        return found if isinstance(found, Bottle) else Bottle.adopt(self._items[index : index + 2])

    def _position(self, key: str) -> int:
        for index, item in enumerate(self._items):
            head = item.get(0) if isinstance(item, Bottle) else item
            if (head if isinstance(head, str) else to_string(head)) == key:
                return index
        return -1

    def insert(self, index: SupportsIndex, value: object) -> None:
        """Insert a value before ``index``; errors as for :func:`coerce`."""
        self._items.insert(index, coerce(value))

    def append(self, value: object) -> None:
        """Append a value; errors as for :func:`coerce`."""
        self._items.append(coerce(value))

    def __len__(self) -> int:
        return len(self._items)

    @overload
    def __getitem__(self, index: SupportsIndex) -> Value: ...
    @overload
    def __getitem__(self, index: slice) -> Bottle: ...
    def __getitem__(self, index: SupportsIndex | slice) -> Value | Bottle:
        if isinstance(index, slice):
            return self.adopt(self._items[index])
        return self._items[index]

    def __setitem__(self, index: SupportsIndex | slice, value: object) -> None:
        if isinstance(index, slice):
            if not isinstance(value, Iterable):
                raise BottleTypeError(f"a slice is replaced by several values, not by {value!r}")
            self._items[index] = [coerce(item) for item in value]
        else:
            self._items[index] = coerce(value)

    def __delitem__(self, index: SupportsIndex | slice) -> None:
        del self._items[index]

    def __eq__(self, other: object) -> bool:
        return same(self, other) if isinstance(other, Bottle) else NotImplemented

    def __str__(self) -> str:
        return self.to_text()

    def __repr__(self) -> str:
        return f"Bottle.parse({self.to_text()!r})"

    def __copy__(self) -> Bottle:
        return self.adopt(self._items.copy())


def coerce(value: object) -> Value:
    """Convert a Python object to a value.

    Raises :class:`BottleTypeError` for an unsupported type and :class:`BottleError` for a number beyond 64 bits.
    """
    if is_value(value):
        return value  # type: ignore[return-value]  # as is_value has checked
    for types, convert in _CONVERSIONS:
        if isinstance(value, types):
            return convert(value)
    if hasattr(value, "tolist"):  # arrays and scalars of numpy and similar libraries
        return coerce(value.tolist())
    raise BottleTypeError(f"a {type(value).__name__} cannot be put into a bottle: {value!r}")


def _whole(value: int) -> int:
    if not INT64_MIN <= value <= INT64_MAX:
        raise BottleError(f"{value:#x} does not fit into 64 bits; send it as a float or a string")
    return int(value)


_CONVERSIONS: tuple[tuple[Any, Callable[[Any], Value]], ...] = (  # each function converts the types beside it
    (bool, lambda value: TRUE if value else FALSE),
    (int, _whole),
    (float, float),
    (str, str.__str__),
    ((list, tuple), Bottle),
    ((bytes, bytearray, memoryview), bytes),
)


def same(one: Value, other: Value, depth: int = 0) -> bool:
    """Return whether two values agree in type and content. Raises :class:`BottleLimitError` if nested too deeply."""
    if depth > MAX_DEPTH:
        raise BottleLimitError(f"a bottle is nested more than {MAX_DEPTH} levels deep, or inside itself")
    if kind_of(one) is not kind_of(other):
        return False
    if isinstance(one, Bottle) and isinstance(other, Bottle):
        return len(one) == len(other) and all(same(a, b, depth + 1) for a, b in zip(one, other, strict=True))
    return one == other


def as_list(value: Value | None) -> Bottle | None:
    """Return a list, ``None`` for anything else, a property included."""
    return value if isinstance(value, Bottle) else None
