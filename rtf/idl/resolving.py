"""Finds what names in an interface file mean, and checks its values. Includes are read here."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.errors import did_you_mean
from rtf.idl.errors import IdlError
from rtf.idl.program import BASE, INTEGERS, Const, Enum, Fields, Function, Member, Program, Service, Struct, Type
from rtf.idl.reading import read_file, read_text
from rtf.idl.syntax import ConstantDefinition, Enumeration, MapValue, Reference, ServiceDefinition, Structure, Typedef

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from rtf.errors import Location
    from rtf.idl import syntax
    from rtf.idl.program import Literal
    from rtf.idl.syntax import Definition, Document, TypeName

#: Files that include each other are not nested deeper.
MAX_INCLUDES = 20
#: The most elements of a structure in a message.
MAX_WIDTH = 10_000
_CONTAINERS = {"list": 1, "set": 1, "map": 2}


def read_program(path: Path, folders: Sequence[Path] = ()) -> Program:
    """Read a file, with those that it includes: beside it, or in one of ``folders``. Raises IdlError."""
    return _Files(folders).program(path, ())


def program_of(text: str, name: str = "text") -> Program:
    """Return what the text of a file means that includes none. Raises IdlError."""
    return _Resolver(read_text(text, name), name, {}).program


class _Files:
    """The files that have been read, each once."""

    def __init__(self, folders: Sequence[Path]) -> None:
        self._folders = folders
        self._read: dict[Path, Program] = {}

    def program(self, path: Path, above: tuple[Path, ...]) -> Program:
        real = path.resolve()
        if real not in self._read:
            document = read_file(path)
            includes = {}
            for include in document.includes:
                found = self._find(include, path)
                if found.resolve() in (real, *above):
                    raise IdlError(f"{include.path} includes this file, directly or not", include.where)
                if len(above) == MAX_INCLUDES:
                    raise IdlError(f"files are included more than {MAX_INCLUDES} deep", include.where)
                includes[found.stem] = self.program(found, (*above, real))
            self._read[real] = _Resolver(document, path.stem, includes).program
        return self._read[real]

    def _find(self, include: syntax.Include, path: Path) -> Path:
        """Return an included file. YARP's files name it from the root of their source, so folders above are tried."""
        for folder in (path.parent, *self._folders, *path.absolute().parent.parents):
            if (folder / include.path).is_file():
                return folder / include.path
        raise IdlError(
            f"{include.path} is neither beside the file nor in a folder above; name its folder with --include",
            include.where,
        )


class _Resolver:
    """Makes the program of a document."""

    def __init__(self, document: Document, name: str, includes: dict[str, Program]) -> None:
        self.program = Program(name, document.file, document.namespaces.get("yarp", ""), includes)
        self._open: list[str] = []
        self._definitions: dict[str, Definition] = {}
        for one in document.definitions:
            first = self._definitions.setdefault(one.name, one)
            if first is not one:
                raise IdlError(f"{one.name} is defined twice; the first is in line {first.where.line}", one.where)
            if one.name in BASE or one.name in _CONTAINERS:
                raise IdlError(f"{one.name} is a type of its own, and cannot be defined", one.where)
        for one in document.definitions:
            self._define(one)

    def _define(self, one: Definition) -> None:
        match one:
            case ConstantDefinition():
                self._constant(one)
            case ServiceDefinition():
                self._service(one)
            case _:
                self._type_of(one)

    # Types ------------------------------------------------------------------------------------------------------------

    def _type(self, name: TypeName) -> Type:
        native = name.annotations.get("yarp.type", name.annotations.get("yarp.name", ""))
        if name.name in BASE:
            return Type(name.name, native=native)
        if name.name in _CONTAINERS and name.items:
            return Type(name.name, tuple(map(self._type, name.items)), native=native)
        program, own, short = self._home(name.name)
        if own:
            definition = self._definitions.get(short)
            found = self.program.types.get(short) or (self._type_of(definition) if definition else None)
        else:
            found = program.types.get(short)
        if found is None:
            raise self._unknown("type", name.name, name.where, [*BASE, *self._definitions, *program.types])
        return found

    def _home(self, name: str) -> tuple[Program, bool, str]:
        """Return the file of a name, whether it is this one, and the name there: ``PointD.PointD`` is of an include."""
        prefix, _, short = name.rpartition(".")
        return (
            (self.program.includes[prefix], False, short)
            if prefix in self.program.includes
            else (self.program, True, name)
        )

    def _type_of(self, one: Definition) -> Type:
        if one.name in self.program.types:
            return self.program.types[one.name]
        if one.name in self._open:
            raise IdlError(f"{one.name} has itself as a part, which no message can", one.where)
        self._open.append(one.name)
        try:
            match one:
                case Typedef():
                    found = self._type(one.type)
                case Enumeration():
                    found = Type(one.name, definition=self._enum(one), native=one.annotations.get("yarp.name", ""))
                case Structure():
                    found = Type(one.name, definition=self._struct(one), native=one.annotations.get("yarp.name", ""))
                case _:
                    raise IdlError(f"{one.name} is not a type", one.where)
        finally:
            self._open.pop()
        self.program.types[one.name] = found
        return found

    def _enum(self, one: Enumeration) -> Enum:
        _distinct(one.values, f"a value of {one.name}")
        return Enum(one.name, self.program.name, one.doc, one.values, one.annotations.get("yarp.enumbase", ""))

    def _struct(self, one: Structure) -> Struct:
        _distinct(one.fields, f"a field of {one.name}")
        members = tuple(map(self._member, one.fields))
        width = sum(member.type.width for member in members)
        if width > MAX_WIDTH:
            raise IdlError(
                f"{one.name} has {width} elements with its inner structures, more than {MAX_WIDTH}", one.where
            )
        return Struct(one.name, self.program.name, one.doc, members, width)

    def _member(self, one: syntax.Field) -> Member:
        kind = self._type(one.type)
        default = None if one.default is None else self._value(one.default, kind, one.where)
        return Member(one.name, kind, default, one.doc)

    # Services ---------------------------------------------------------------------------------------------------------

    def _service(self, one: ServiceDefinition) -> Service:
        if one.name in self.program.services:
            return self.program.services[one.name]
        if one.name in self._open:
            raise IdlError(f"{one.name} extends itself", one.where)
        self._open.append(one.name)
        extends = self._extended(one) if one.extends else None
        self._open.pop()
        _distinct(one.functions, f"a function of {one.name}")
        for function in one.functions:
            _distinct(function.arguments, f"an argument of {function.name}")
        service = Service(one.name, self.program.name, one.doc, tuple(map(self._function, one.functions)), extends)
        self.program.services[one.name] = service
        return service

    def _extended(self, one: ServiceDefinition) -> Service:
        program, own, short = self._home(one.extends)
        definition = self._definitions.get(short) if own else None
        found = self._service(definition) if isinstance(definition, ServiceDefinition) else program.services.get(short)
        if found is None:
            raise self._unknown("service", one.extends, one.where, program.services)
        return found

    def _function(self, one: syntax.Function) -> Function:
        returns = None if one.returns is None else self._type(one.returns)
        return Function(one.name, returns, tuple(map(self._member, one.arguments)), one.oneway, one.doc)

    # Values -----------------------------------------------------------------------------------------------------------

    def _constant(self, one: ConstantDefinition) -> Const:
        if one.name in self.program.constants:
            return self.program.constants[one.name]
        if one.name in self._open:
            raise IdlError(f"the value of {one.name} is itself", one.where)
        self._open.append(one.name)
        kind = self._type(one.type)
        value = self._value(one.value, kind, one.where)
        self._open.pop()
        return self.program.constants.setdefault(one.name, Const(one.name, kind, value, one.doc))

    def _value(self, value: syntax.Constant, kind: Type, where: Location) -> Literal:
        """Check a value. Raises IdlError."""
        if isinstance(value, Reference):
            return self._referenced(value, kind)
        found: Literal | None = None
        if kind.name in INTEGERS:
            found = value if isinstance(value, int) and _fits(value, kind) else None
        elif kind.name == "bool":
            found = bool(value) if isinstance(value, int) and value in (0, 1) else None
        elif kind.name in ("double", "float"):
            found = float(value) if isinstance(value, (int, float)) else None
        elif kind.name in ("string", "binary"):
            found = value if isinstance(value, str) else None
        elif kind.name in _CONTAINERS:
            found = self._contained(value, kind, where)
        elif isinstance(kind.definition, Enum):
            found = value if value in [one.value for one in kind.definition.values] else None
        elif isinstance(kind.definition, Struct) and isinstance(value, MapValue):
            found = self._fields(value, kind.definition, where)
        if found is None:
            raise IdlError(f"{_shown(value)} is not a value of the type {kind.name}", where)
        return found

    def _contained(self, value: syntax.Constant, kind: Type, where: Location) -> Literal | None:
        if kind.name == "map" and isinstance(value, MapValue):
            key, item = kind.items
            return tuple((self._value(one, key, where), self._value(other, item, where)) for one, other in value.pairs)
        if kind.name == "map" or not isinstance(value, tuple):
            return None
        return tuple(self._value(one, kind.items[0], where) for one in value)

    def _fields(self, value: MapValue, struct: Struct, where: Location) -> Fields:
        types = {member.name: member.type for member in struct.members}
        found: dict[str, Literal] = {}
        for key, item in value.pairs:
            if not isinstance(key, str) or key not in types:
                raise IdlError(f"{struct.name} has no field {_shown(key)}; it has {', '.join(types)}", where)
            found[key] = self._value(item, types[key], where)
        return Fields(found)

    def _referenced(self, value: Reference, kind: Type) -> Literal:
        enum, _, short = value.name.rpartition(".")
        definition = kind.definition
        if isinstance(definition, Enum) and enum.rpartition(".")[2] == definition.name:
            for one in definition.values:
                if one.name == short:
                    return one.value
        program, own, name = self._home(value.name)
        defined = self._definitions.get(name) if own else None
        constant = self._constant(defined) if isinstance(defined, ConstantDefinition) else program.constants.get(name)
        if constant is None:
            values = (
                [f"{definition.name}.{one.name}" for one in definition.values] if isinstance(definition, Enum) else []
            )
            raise self._unknown("value", value.name, value.where, [*values, *program.constants])
        if constant.type != kind:
            raise IdlError(f"{value.name} is of the type {constant.type.name}, not {kind.name}", value.where)
        return constant.value

    @staticmethod
    def _unknown(what: str, name: str, where: Location, known: Iterable[str]) -> IdlError:
        return IdlError(f"there is no {what} {name}{did_you_mean(name, known)}", where)


def _distinct(items: Iterable[syntax.Field | syntax.Enumerator | syntax.Function], what: str) -> None:
    seen: dict[str, Location] = {}
    for one in items:
        if "." in one.name:
            raise IdlError(f"{one.name} is the name of {what}, but has a dot", one.where)
        if one.name in seen:
            raise IdlError(f"{one.name} is {what} twice; the first is in line {seen[one.name].line}", one.where)
        seen[one.name] = one.where


def _fits(value: int, kind: Type) -> bool:
    most = 1 << INTEGERS[kind.name]
    return 0 <= value < most if "uint" in kind.native else -most // 2 <= value < most // 2


def _shown(value: object) -> str:
    if isinstance(value, (MapValue, tuple)):
        return "{…}" if isinstance(value, MapValue) else "[…]"
    return repr(value)[:60]
