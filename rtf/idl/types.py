"""The types of interface files on the wire: how values become elements of a message, and elements values.

A type writes what a :class:`~rtf.middleware.types.record.Record` takes, and reads elements of a received bottle. It
accepts what YARP's own readers accept: smaller integers for larger ones, any number for a floating-point one, a vocab
for an integer or a text. It raises BottleError for anything else.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar, cast

from rtf.bottle import Bottle, BottleError, Dialect, Float32, Int8, Int16, Int64, Vocab, coerce
from rtf.bottle.binary import decode_from, encode_element
from rtf.middleware.types.codecs import Codec, TextCodec
from rtf.middleware.types.record import FAILED, Record

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from enum import IntEnum

    from rtf.bottle import Value
    from rtf.middleware.types.codecs import Buffer

M = TypeVar("M", bound="Message")


class WireType(ABC):
    """A type. ``yarp`` is its name in C++, as in YARP's help texts; ``width`` how many elements it takes."""

    yarp: str
    width: int = 1

    @abstractmethod
    def put(self, value: Any) -> object:
        """Return what a record writes for a value. Raises BottleError for a value of another type."""

    @abstractmethod
    def take(self, elements: Sequence[Value], at: int) -> Any:
        """Return the value of ``width`` elements from ``at`` on, which are there. Raises BottleError."""

    def take_nested(self, element: Value) -> Any:
        """Return the value of an item of a list: a structure is then a list of its own."""
        return self.take((element,), 0)


def _refused(value: object, yarp: str) -> BottleError:
    return BottleError(f"{str(value)[:80]!r} is not of the type {yarp}")


class Boolean(WireType):
    """``bool``: ``[ok]`` or ``[fail]``."""

    yarp = "bool"

    def put(self, value: Any) -> object:
        if isinstance(value, bool):
            return value
        raise _refused(value, self.yarp)

    def take(self, elements: Sequence[Value], at: int) -> bool:
        value = elements[at]
        if isinstance(value, Vocab):
            return bool(value) and value != FAILED
        if isinstance(value, int):
            return value != 0
        raise _refused(value, self.yarp)


class Integer(WireType):
    """``i8`` to ``i64``. Unsigned ones have the same bits as signed ones; a vocab has a type of its own."""

    def __init__(self, bits: int, yarp: str, *, unsigned: bool = False, vocab: bool = False) -> None:
        self.yarp = yarp
        self._most, self._size = 1 << bits if unsigned else 1 << bits - 1, 1 << bits
        self._least = 0 if unsigned else -self._most
        self._half = 1 << bits - 1
        self._write: Callable[[int], object] = Vocab if vocab else {8: Int8, 16: Int16, 32: int, 64: Int64}[bits]

    def put(self, value: Any) -> object:
        if not isinstance(value, int) or isinstance(value, bool) or not self._least <= value < self._most:
            raise _refused(value, self.yarp)
        return self._write(value - self._size if value >= self._half else int(value))

    def take(self, elements: Sequence[Value], at: int) -> int:
        value = elements[at]
        if isinstance(value, int) or type(value) is Vocab:
            number = int(value)
            if number < 0 and self._least == 0:
                number += self._size
            if self._least <= number < self._most:
                return number
        raise _refused(value, self.yarp)


class Number(WireType):
    """``double``, and ``float``, which YARP adds: of 64 and 32 bits."""

    def __init__(self, yarp: str, make: type[float]) -> None:
        self.yarp = yarp
        self._make = make

    def put(self, value: Any) -> object:
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            return self._make(value)
        raise _refused(value, self.yarp)

    def take(self, elements: Sequence[Value], at: int) -> float:
        value = elements[at]
        if isinstance(value, (int, float)):
            return float(value)
        raise _refused(value, self.yarp)


class Text(WireType):
    """``string``."""

    yarp = "std::string"

    def put(self, value: Any) -> object:
        if isinstance(value, str):
            return value
        raise _refused(value, self.yarp)

    def take(self, elements: Sequence[Value], at: int) -> str:
        value = elements[at]
        if isinstance(value, str):
            return value
        if isinstance(value, Vocab):
            return value.text
        raise _refused(value, self.yarp)


class Binary(WireType):
    """``binary``: a blob."""

    yarp = "std::string"

    def put(self, value: Any) -> object:
        if isinstance(value, (bytes, bytearray, memoryview)):
            return bytes(value)
        raise _refused(value, "binary")

    def take(self, elements: Sequence[Value], at: int) -> bytes:
        value = elements[at]
        if isinstance(value, bytes):
            return value
        raise _refused(value, "binary")


BOOL = Boolean()
I8, I16, I32, I64 = (Integer(bits, f"std::int{bits}_t") for bits in (8, 16, 32, 64))
U8, U16, U32, U64 = (Integer(bits, f"std::uint{bits}_t", unsigned=True) for bits in (8, 16, 32, 64))
SIZE = Integer(32, "size_t")
VOCAB = Integer(32, "yarp::conf::vocab32_t", vocab=True)
DOUBLE, FLOAT = Number("double", float), Number("yarp::conf::float32_t", Float32)
STRING, BINARY = Text(), Binary()


class EnumType(WireType):
    """An enumeration: its number. ``base`` is another integer than one of 32 bits."""

    def __init__(self, of: type[IntEnum], base: Integer = I32) -> None:
        self.yarp = of.__name__
        self._of = of
        self._base = base

    def put(self, value: Any) -> object:
        try:
            return self._base.put(int(self._of(value)))
        except ValueError:
            raise _refused(value, self.yarp) from None

    def take(self, elements: Sequence[Value], at: int) -> IntEnum:
        try:
            return self._of(self._base.take(elements, at))
        except ValueError:
            raise _refused(elements[at], self.yarp) from None


class ListType(WireType):
    """``list`` and ``set``; ``make`` is the class of the value."""

    def __init__(self, item: WireType, make: type[list[Any] | set[Any]] = list) -> None:
        self.yarp = f"std::{'vector' if make is list else 'set'}<{item.yarp}>"
        self._item = item
        self._make = make

    def put(self, value: Any) -> object:
        if not isinstance(value, (list, tuple, set, frozenset)):
            raise _refused(value, self.yarp)
        items = sorted(value) if isinstance(value, (set, frozenset)) else value
        return [self._item.put(item) for item in items]

    def take(self, elements: Sequence[Value], at: int) -> Any:
        value = elements[at]
        if isinstance(value, Bottle):
            take = self._item.take_nested
            return self._make(take(item) for item in value)
        raise _refused(value, self.yarp)


class MapType(WireType):
    """``map``: a list of lists of key and value."""

    def __init__(self, key: WireType, value: WireType) -> None:
        self.yarp = f"std::map<{key.yarp}, {value.yarp}>"
        self._key, self._value = key, value

    def put(self, value: Any) -> object:
        if not isinstance(value, dict):
            raise _refused(value, self.yarp)
        return {self._key.put(key): _nested(self._value.put(item)) for key, item in value.items()}

    def take(self, elements: Sequence[Value], at: int) -> dict[Any, Any]:
        pairs = elements[at]
        if not isinstance(pairs, Bottle):
            raise _refused(pairs, self.yarp)
        found = {}
        for pair in pairs:
            if not isinstance(pair, Bottle) or len(pair) != 2:  # noqa: PLR2004 - a key and a value
                raise _refused(pair, f"a pair of {self.yarp}")
            found[self._key.take(pair, 0)] = self._value.take_nested(pair[1])
        return found


def _nested(value: object) -> object:
    """Return a structure as a list of its own."""
    return Record(*value) if isinstance(value, tuple) else value


class NativeType(WireType):
    """A class of YARP, such as a matrix, which is one element. Without a codec its values are those of bottles."""

    def __init__(self, yarp: str, codec: Codec[Any] | None = None, make: Callable[[Any], object] = coerce) -> None:
        self.yarp = yarp
        self.codec = codec
        self._make = make

    def put(self, value: Any) -> object:
        try:
            return self._make(value)
        except (TypeError, ValueError):
            raise _refused(value, self.yarp) from None

    def take(self, elements: Sequence[Value], at: int) -> Any:
        if self.codec is None:
            return elements[at]
        return self.codec.decode(encode_element(elements[at], Dialect.YARP3), Dialect.YARP3)


# Structures -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Field:
    """A field of a message, or an argument of a function: its name in the file, the attribute, and its type."""

    name: str
    type: WireType
    doc: str = ""
    attribute: str = ""

    @property
    def place(self) -> str:
        """The name of the attribute; another one where the name is a word of Python."""
        return self.attribute or self.name


class Message:
    """Base class of the structures of interface files, which are dataclasses. Ports write and read them.

    A message is a list of its fields, those of inner structures in between, as YARP's generated classes write it.
    """

    FIELDS: ClassVar[tuple[Field, ...]] = ()
    codec: ClassVar[Codec[Any]]  # of the class itself

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        cls.codec = MessageCodec(cls)


class StructType(WireType):
    """A structure: the elements of its fields, one after the other; in a list a list of its own."""

    def __init__(self, of: type[Message]) -> None:
        self.yarp = of.__name__
        self.width = sum(field.type.width for field in of.FIELDS)
        self._of = of
        self._fields = [(field.place, field.type, field.type.width) for field in of.FIELDS]

    def put(self, value: Any) -> object:
        if not isinstance(value, self._of):
            raise _refused(value, self.yarp)
        try:
            return tuple([kind.put(getattr(value, name)) for name, kind, _ in self._fields])
        except BottleError as error:
            raise BottleError(f"{self.yarp}: {error}") from None

    def take(self, elements: Sequence[Value], at: int) -> Any:
        values = []
        for _, kind, width in self._fields:
            values.append(kind.take(elements, at))
            at += width
        return self._of(*values)

    def take_nested(self, element: Value) -> Any:
        if not isinstance(element, Bottle) or len(element) != self.width:
            raise BottleError(f"{str(element)[:80]!r} is not {self.yarp}, a list of {self.width}")
        return self.take(element.elements(), 0)


class MessageCodec(TextCodec[M], Generic[M]):
    """Codec of messages. What is received must have exactly their elements, else BottleError is raised."""

    def __init__(self, of: type[M]) -> None:
        self._type = StructType(of)

    def encode(self, value: M, dialect: Dialect) -> Sequence[Buffer]:
        """One block, or several if there are large arrays."""
        return Record.codec.encode(Record(*cast("tuple[object, ...]", self._type.put(value))), dialect)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[M, int]:
        bottle, end = decode_from(data, 0, dialect)
        return self._type.take_nested(bottle), end
