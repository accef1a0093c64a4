"""What an interface file means: its definitions with their types found and their values checked."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.idl.syntax import Enumerator

INTEGERS = {"i8": 8, "byte": 8, "i16": 16, "i32": 32, "i64": 64}
BASE = frozenset({*INTEGERS, "bool", "double", "float", "string", "binary"})


@dataclass(frozen=True, slots=True)
class Type:
    """A type: a base type or a container of ``items`` by name, or what is defined.

    ``native`` is the class of YARP that is on the wire instead, such as ``yarp::sig::Vector``, or the kind of integer.
    """

    name: str
    items: tuple[Type, ...] = ()
    definition: Enum | Struct | None = None
    native: str = ""

    @property
    def width(self) -> int:
        """The number of elements of a message that it takes."""
        return self.definition.width if isinstance(self.definition, Struct) and not self.native else 1


@dataclass(frozen=True, slots=True)
class Fields:
    """The value of a structure: some of its fields."""

    values: dict[str, Literal]


#: A value that fits its type. Lists are tuples, maps are tuples of pairs.
Literal: TypeAlias = "bool | int | float | str | bytes | tuple[Literal, ...] | Fields"


@dataclass(frozen=True, slots=True)
class Member:
    """A field of a structure, or an argument of a function; ``default`` is None where none is given."""

    name: str
    type: Type
    default: Literal | None
    doc: str


@dataclass(frozen=True, slots=True)
class Enum:
    """An enumeration of the file ``module``; ``base`` is the type of its numbers in C++, if it is given."""

    name: str
    module: str
    doc: str
    values: tuple[Enumerator, ...]
    base: str


@dataclass(frozen=True, slots=True)
class Struct:
    """A structure of the file ``module``; ``width`` is the number of its elements in a message."""

    name: str
    module: str
    doc: str
    members: tuple[Member, ...]
    width: int


@dataclass(frozen=True, slots=True)
class Const:
    """A constant."""

    name: str
    type: Type
    value: Literal
    doc: str


@dataclass(frozen=True, slots=True)
class Function:
    """A function of a service; ``returns`` is None if it returns nothing."""

    name: str
    returns: Type | None
    arguments: tuple[Member, ...]
    oneway: bool
    doc: str


@dataclass(frozen=True, slots=True)
class Service:
    """A service of the file ``module``, and the one that it extends."""

    name: str
    module: str
    doc: str
    functions: tuple[Function, ...]
    extends: Service | None


@dataclass(frozen=True, slots=True)
class Program:
    """A file. All that it defines is in an order in which nothing comes before what it needs."""

    name: str
    file: str
    namespace: str
    includes: dict[str, Program]
    types: dict[str, Type] = field(default_factory=dict)
    constants: dict[str, Const] = field(default_factory=dict)
    services: dict[str, Service] = field(default_factory=dict)

    @property
    def enums(self) -> list[Enum]:
        """The enumerations that it defines."""
        return [
            one.definition for name, one in self.types.items() if isinstance(one.definition, Enum) and name == one.name
        ]

    @property
    def structs(self) -> list[Struct]:
        """The structures that it defines, but not those that are classes of YARP."""
        return [
            one.definition
            for name, one in self.types.items()
            if isinstance(one.definition, Struct) and name == one.name and not one.native
        ]

    def with_included(self) -> Iterator[Program]:
        """Yield each file once: those that are included before the others, and this one at last."""
        seen: dict[str, Program] = {}
        for program in self.includes.values():
            seen |= {one.file: one for one in program.with_included()}
        yield from seen.values()
        yield self
