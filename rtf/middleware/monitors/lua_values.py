"""What a monitor in Lua gets to know of Python: messages, bottles and such, with the names that YARP's scripts use."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rtf.bottle import (
    Bottle,
    Int64,
    Property,
    Vocab,
    as_bool,
    as_float,
    as_int,
    as_string,
    as_vocab,
    coerce,
    is_bool,
    to_string,
    to_text,
)

if TYPE_CHECKING:
    from rtf.bottle import Value
    from rtf.middleware.monitors.monitor import MonitoredMessage

# Method names are those of YARP's classes.


class LuaObject:
    """Base class of what Lua may use. Everything that does not begin with ``_`` is open."""

    __slots__ = ()


class LuaValue(LuaObject):
    """A value of a bottle. Without one, as after a failed search, it is null, and 0 or empty."""

    __slots__ = ("_value",)

    def __init__(self, value: Value | None) -> None:
        self._value = value

    def isNull(self) -> bool:
        """Whether there is none."""
        return self._value is None

    def isBool(self) -> bool:
        """Whether it is a truth value."""
        return self._value is not None and is_bool(self._value)

    def isInt32(self) -> bool:
        """Whether it is an integer."""
        return isinstance(self._value, int)

    def isFloat64(self) -> bool:
        """Whether it is a floating-point number."""
        return isinstance(self._value, float)

    def isString(self) -> bool:
        """Whether it is a text."""
        return isinstance(self._value, str)

    def isVocab32(self) -> bool:
        """Whether it is a vocab."""
        return isinstance(self._value, Vocab)

    def isList(self) -> bool:
        """Whether it is a list."""
        return isinstance(self._value, Bottle)

    def asBool(self) -> bool:
        """As a truth value."""
        return as_bool(self._value)

    def asInt32(self) -> int:
        """As an integer."""
        return as_int(self._value)

    def asFloat64(self) -> float:
        """As a number."""
        return as_float(self._value)

    def asString(self) -> str:
        """As a text."""
        return as_string(self._value)

    def asVocab32(self) -> int:
        """As the number of a vocab."""
        return int(as_vocab(self._value))

    def asList(self) -> LuaBottle | None:
        """As a list, which is that of the message."""
        return LuaBottle(self._value) if isinstance(self._value, Bottle) else None

    def toString(self) -> str:
        """As it is written."""
        return "" if self._value is None else to_string(self._value)

    isInt = isInt64 = isInt32
    isDouble = isFloat64
    isVocab = isVocab32
    asInt = asInt64 = asInt32
    asDouble = asFloat64
    asVocab = asVocab32


class LuaBottle(LuaObject):
    """A bottle."""

    __slots__ = ("_bottle",)

    def __init__(self, bottle: Bottle | None = None) -> None:
        self._bottle = Bottle() if bottle is None else bottle

    def _append(self, value: Value | Bottle) -> None:
        if len(self._bottle) >= _MOST:
            raise ValueError(f"a script makes no list of more than {_MOST} elements")
        self._bottle.append(value)

    def size(self) -> int:
        """The number of elements."""
        return len(self._bottle)

    def get(self, index: int) -> LuaValue:
        """An element; the first has the index 0."""
        return LuaValue(self._bottle.get(int(index)))

    def find(self, key: str) -> LuaValue:
        """What follows a key."""
        return LuaValue(self._bottle.find(str(key)))

    def check(self, key: str) -> bool:
        """Whether there is a key."""
        return self._bottle.check(str(key))

    def findGroup(self, key: str) -> LuaBottle:
        """The list of a key; an empty one if there is none."""
        return LuaBottle(self._bottle.find_group(str(key)))

    def tail(self) -> LuaBottle:
        """All but the first element."""
        return LuaBottle(self._bottle.tail())

    def clear(self) -> None:
        """Take all elements out."""
        del self._bottle[:]

    def addInt32(self, value: float) -> None:
        """Append an integer."""
        self._append(int(value))

    def addInt64(self, value: float) -> None:
        """Append an integer of 64 bits."""
        self._append(Int64(int(value)))

    def addFloat64(self, value: float) -> None:
        """Append a number."""
        self._append(float(value))

    def addString(self, value: str) -> None:
        """Append a text."""
        self._append(str(value))

    def addVocab32(self, value: str | float) -> None:
        """Append a vocab."""
        self._append(Vocab(value if isinstance(value, str) else int(value)))

    def addList(self) -> LuaBottle:
        """Append a list, and return it."""
        self._append(Bottle())
        added = self._bottle[-1]
        assert isinstance(added, Bottle)
        return LuaBottle(added)

    def add(self, value: LuaValue | LuaBottle) -> None:
        """Append a value, or a list."""
        self._append(_plain(value))

    def append(self, other: LuaBottle) -> None:
        """Append all elements of another bottle."""
        for value in other._bottle.elements():
            self._append(value)

    def copy(self, other: LuaBottle) -> None:
        """Become a copy of another bottle."""
        elements = [*other._bottle.elements()]
        self.clear()
        for value in elements:
            self._append(value)

    def pop(self) -> LuaValue:
        """Take the last element out."""
        value = self._bottle.get(len(self._bottle) - 1) if len(self._bottle) else None
        del self._bottle[-1:]
        return LuaValue(value)

    def fromString(self, text: str) -> None:
        """Read a text."""
        self.copy(LuaBottle(Bottle.parse(str(text))))

    def toString(self) -> str:
        """As it is written."""
        return self._bottle.to_text()

    addInt = addInt32
    addDouble = addFloat64
    addVocab = addVocab32


class LuaProperty(LuaObject):
    """A property."""

    __slots__ = ("_property",)

    def __init__(self, found: Property | None = None) -> None:
        self._property = Property() if found is None else found

    def put(self, key: str, value: object) -> None:
        """Set a key."""
        self._property.put(str(key), _plain(value))

    def find(self, key: str) -> LuaValue:
        """The value of a key."""
        return LuaValue(self._property.find(str(key)))

    def check(self, key: str) -> bool:
        """Whether there is a key."""
        return self._property.check(str(key))

    def clear(self) -> None:
        """Take all keys out."""
        self._property = Property()

    def fromString(self, text: str) -> None:
        """Read a text such as ``(a 1) (b 2)``."""
        self._property = Property.from_bottle(Bottle.parse(str(text)))

    def toString(self) -> str:
        """As it is written."""
        return self._property.to_text()


class LuaVector(LuaObject):
    """A vector of numbers."""

    __slots__ = ("_numbers",)

    def __init__(self, numbers: float | list[float] = 0) -> None:
        self._numbers = numbers if isinstance(numbers, list) else [0.0] * min(int(numbers), _MOST)

    def size(self) -> int:
        """The number of elements."""
        return len(self._numbers)

    def get(self, index: int) -> float:
        """An element; the first has the index 0."""
        return self._numbers[int(index)]

    def set(self, index: int, value: float) -> None:
        """Set an element."""
        self._numbers[int(index)] = float(value)

    def push_back(self, value: float) -> None:
        """Append an element."""
        if len(self._numbers) >= _MOST:
            raise ValueError(f"a script makes no vector of more than {_MOST} elements")
        self._numbers.append(float(value))

    def resize(self, size: int) -> None:
        """Cut it, or fill it with zeros."""
        self._numbers = (self._numbers + [0.0] * min(int(size), _MOST))[: int(size)]

    def toString(self) -> str:
        """As it is written."""
        return to_text(Bottle(self._numbers))


#: What a script makes is not longer.
_MOST = 10_000


class LuaThings(LuaObject):
    """A message: YARP's Things. What a script reads it as, or sets as its writer, is what goes on.

    One that a script makes is empty until its writer is set.
    """

    __slots__ = ("_message", "_writer")

    def __init__(self, message: MonitoredMessage | None = None) -> None:
        self._message = message
        self._writer: LuaBottle | LuaProperty | LuaVector | None = None

    def asBottle(self) -> LuaBottle:
        """As a bottle, a copy of what arrived."""
        if not isinstance(self._writer, LuaBottle):
            self._writer = LuaBottle(Bottle([*self._arrived()]))
        return self._writer

    def asProperty(self) -> LuaProperty:
        """As a property."""
        if not isinstance(self._writer, LuaProperty):
            self._writer = LuaProperty(Property.from_bottle(self._arrived()))
        return self._writer

    def asVector(self) -> LuaVector | None:
        """As a vector; nil for what is none, such as integers."""
        if not isinstance(self._writer, LuaVector):
            numbers = [value for value in self._arrived() if isinstance(value, float)]
            if len(numbers) < len(self._arrived()):
                return None
            self._writer = LuaVector(numbers)
        return self._writer

    def _arrived(self) -> Bottle:
        return Bottle() if self._message is None else self._message.bottle

    def setPortWriter(self, writer: Any) -> None:
        """Replace the message."""
        if not isinstance(writer, (LuaBottle, LuaProperty, LuaVector)):
            raise TypeError("a message is a Bottle, a Property or a Vector")
        self._writer = writer

    def toString(self) -> str:
        """As it is written."""
        return self._arrived().to_text() if self._writer is None else self._writer.toString()


def result_of(things: LuaThings) -> object | None:
    """Return what a message has become; None if the script did not look at it."""
    writer = things._writer
    if isinstance(writer, LuaVector):
        import numpy as np

        return np.array(writer._numbers)
    return None if writer is None else _plain(writer)


def property_of(found: LuaProperty) -> Property:
    """Return the property behind one of Lua."""
    return found._property


def _plain(value: object) -> Value:
    match value:
        case LuaValue():
            return coerce(value._value)
        case LuaBottle():
            return value._bottle
        case LuaProperty():
            return value._property
        case _:
            return coerce(value)
