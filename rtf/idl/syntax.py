"""What an interface file says, as it is written: names are not looked up yet."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from rtf.errors import Location

#: Annotations by name, such as ``yarp.name``.
Annotations: TypeAlias = "dict[str, str]"


@dataclass(frozen=True, slots=True)
class Reference:
    """The name of a constant, or of a value of an enumeration, where a value is expected."""

    name: str
    where: Location


@dataclass(frozen=True, slots=True)
class MapValue:
    """The pairs of a map or of a structure."""

    pairs: tuple[tuple[Constant, Constant], ...]


#: The value of a constant or a default; lists are tuples.
Constant: TypeAlias = "int | float | str | Reference | MapValue | tuple[Constant, ...]"


@dataclass(frozen=True, slots=True)
class TypeName:
    """A type: ``i32``, ``list`` of something, or the name of a definition."""

    name: str
    where: Location
    items: tuple[TypeName, ...] = ()
    annotations: Annotations = field(default_factory=dict)

    def __str__(self) -> str:
        """As it is written, without annotations."""
        return f"{self.name}<{', '.join(map(str, self.items))}>" if self.items else self.name


@dataclass(frozen=True, slots=True)
class Field:
    """A field of a structure, or an argument of a function."""

    name: str
    where: Location
    type: TypeName
    default: Constant | None
    annotations: Annotations
    doc: str


@dataclass(frozen=True, slots=True)
class Definition:
    """What all definitions have."""

    name: str
    where: Location
    annotations: Annotations
    doc: str


@dataclass(frozen=True, slots=True)
class ConstantDefinition(Definition):
    """``const``."""

    type: TypeName
    value: Constant


@dataclass(frozen=True, slots=True)
class Typedef(Definition):
    """``typedef``."""

    type: TypeName


@dataclass(frozen=True, slots=True)
class Enumerator:
    """A value of an enumeration."""

    name: str
    where: Location
    value: int
    doc: str


@dataclass(frozen=True, slots=True)
class Enumeration(Definition):
    """``enum``."""

    values: tuple[Enumerator, ...]


@dataclass(frozen=True, slots=True)
class Structure(Definition):
    """``struct``, or ``exception``, which has the same form."""

    fields: tuple[Field, ...]


@dataclass(frozen=True, slots=True)
class Function(Definition):
    """A function of a service; ``returns`` is None for ``void``."""

    returns: TypeName | None
    arguments: tuple[Field, ...]
    oneway: bool


@dataclass(frozen=True, slots=True)
class ServiceDefinition(Definition):
    """``service``."""

    extends: str
    functions: tuple[Function, ...]


@dataclass(frozen=True, slots=True)
class Include:
    """``include``: the path as it is written."""

    path: str
    where: Location


@dataclass(frozen=True, slots=True)
class Document:
    """A file. ``namespaces`` are by the language, such as ``yarp``."""

    file: str
    includes: tuple[Include, ...]
    namespaces: dict[str, str]
    definitions: tuple[Definition, ...]
