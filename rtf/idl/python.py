"""Python modules from interface files: text, written to files or executed."""

from __future__ import annotations

import keyword
import re
import sys
import textwrap
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from rtf.idl.program import INTEGERS, Enum, Fields, Struct

if TYPE_CHECKING:
    from jinja2 import Template

    from rtf.idl.program import Function, Literal, Member, Program, Service, Type

_PYTHON = dict.fromkeys(INTEGERS, "int") | {
    "bool": "bool",
    "double": "float",
    "float": "float",
    "string": "str",
    "binary": "bytes",
}
_ZEROS = {"int": "0", "bool": "False", "float": "0.0", "str": '""', "bytes": 'b""', "Any": "None"}
_WIRE = {name: name.upper() for name in (*_PYTHON, "size_t")} | {"byte": "I8"}
#: What ``yarp.type`` may say of an integer or a number.
_KINDS = {
    "uint8_t": "U8", "uint16_t": "U16", "uint32_t": "U32", "uint64_t": "U64", "size_t": "SIZE",
    "yarp::conf::vocab32_t": "VOCAB", "vocab32_t": "VOCAB", "yarp::conf::float32_t": "FLOAT", "float32_t": "FLOAT",
    "yarp::conf::float64_t": "DOUBLE", "int8_t": "I8", "int16_t": "I16", "int32_t": "I32", "int64_t": "I64",
}  # fmt: skip
#: Names that the generated text uses itself.
_TAKEN = frozenset({
    "Any", "ClassVar", "FIELDS", "FUNCTIONS", "IntEnum", "Mapping", "abstractmethod", "annotations", "bool", "bytes",
    "codec", "connection", "dataclass", "dict", "field", "float", "idl", "int", "list", "result", "self", "set", "str",
})  # fmt: skip
_WIDTH = 100


def python_source(program: Program) -> str:
    """Return the text of a module with all that a file defines and includes."""
    return _template().render(_Writer(program).values())


def python_module(program: Program) -> ModuleType:
    """Return a module with all that a file defines and includes. It is in ``sys.modules``, where dataclasses look."""
    module = ModuleType(f"rtf_idl.{program.name}", f"The interfaces of {program.file}.")
    sys.modules[module.__name__] = module
    # Names are identifiers, and texts and values are written by repr, so that a file defines nothing but classes.
    exec(compile(python_source(program), f"<{program.file}>", "exec"), module.__dict__)  # noqa: S102
    return module


@cache
def _template() -> Template:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    templates = Environment(  # noqa: S701 - Python, not a page
        loader=FileSystemLoader(Path(__file__).parent), undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return templates.get_template("module.py.j2")


def _name(name: str) -> str:
    """Return a name as Python may use it."""
    return f"{name}_" if keyword.iskeyword(name) or keyword.issoftkeyword(name) or name in _TAKEN else name


class _Writer:
    """What the template needs to know of a file."""

    def __init__(self, program: Program) -> None:
        self._program = program
        self._files = [*program.with_included()]
        self._names: dict[tuple[str, str], str] = {}
        for one in reversed(self._files):
            definitions: list[Enum | Struct | Service] = [*one.enums, *one.structs, *one.services.values()]
            for definition in definitions:
                plain = _name(definition.name)
                taken = plain in self._names.values()
                self._names[one.name, definition.name] = f"{one.name}_{definition.name}" if taken else plain

    def values(self) -> dict[str, object]:
        """Return the variables of the template."""
        structs = [self._struct(struct) for one in self._files for struct in one.structs]
        services = [self._service(service) for one in self._files for service in one.services.values()]
        shown = f"{structs} {services}"
        return {
            "uses_field": "field(default_factory" in shown,
            "uses_any": "Any" in re.findall(r"\w+", shown),
            "title": f"The interfaces of {self._program.name}.thrift.",
            "source": f"{self._program.name}.thrift",
            "enums": [self._enum(enum) for one in self._files for enum in one.enums],
            "structs": structs,
            "constants": [
                {
                    "name": _name(constant.name),
                    "python": self._python(constant.type),
                    "value": self._literal(constant.value, constant.type),
                    "comment": constant.doc.split("\n") if constant.doc else (),
                }
                for one in self._files
                for constant in one.constants.values()
            ],
            "services": services,
        }

    def _enum(self, enum: Enum) -> dict[str, object]:
        return {
            "name": self._names[enum.module, enum.name],
            "doc": _docstring(enum.doc or f"The values of {enum.name}.", 4),
            "members": [
                {"name": _name(one.name), "value": one.value, "comment": one.doc.split("\n") if one.doc else ()}
                for one in enum.values
            ],
        }

    def _struct(self, struct: Struct) -> dict[str, object]:
        return {
            "name": self._names[struct.module, struct.name],
            "doc": _docstring(struct.doc or f"The structure {struct.name}.", 4),
            "members": [
                {
                    "name": _name(member.name),
                    "python": self._python(member.type),
                    "default": self._default(member),
                    "row": self._row(member),
                    "comment": member.doc.split("\n") if member.doc else (),
                }
                for member in struct.members
            ],
        }

    def _row(self, member: Member) -> str:
        parts = [repr(member.name), self._wire(member.type)]
        if member.doc:
            parts.append(f"doc={member.doc!r}")
        if _name(member.name) != member.name:
            parts.append(f"attribute={_name(member.name)!r}")
        return f"idl.Field({', '.join(parts)})"

    def _service(self, service: Service) -> dict[str, object]:
        name = self._names[service.module, service.name]
        base = self._names[service.extends.module, service.extends.name] if service.extends else ""
        return {
            "name": name,
            "client": f"{name}Client",
            "base": base,
            "base_client": f"{base}Client",
            "doc": _docstring(service.doc or f"The service {service.name}.", 4),
            "functions": [self._function(function) for function in service.functions],
        }

    def _function(self, function: Function) -> dict[str, object]:
        optional = 0
        for argument in reversed(function.arguments):
            if argument.default is None:
                break
            optional += 1
        parameters = ["self"]
        for place, argument in enumerate(function.arguments):
            given = f"{_name(argument.name)}: {self._python(argument.type)}"
            has_default = place >= len(function.arguments) - optional and argument.default is not None
            default = self._literal(argument.default, argument.type) if has_default else ""  # type: ignore[arg-type]
            parameters.append(f"{given} = {default}" if has_default else given)
        row = [repr(function.name), f"({''.join(f'{self._row(one)}, ' for one in function.arguments)})"]
        if function.returns is not None:
            row.append(f"returns={self._wire(function.returns)}")
        row += [f"optional={optional}"] * bool(optional) + ["oneway=True"] * function.oneway
        row += [f"doc={function.doc!r}"] * bool(function.doc)
        if _name(function.name) != function.name:
            row.append(f"attribute={_name(function.name)!r}")
        return {
            "name": _name(function.name),
            "key": repr(function.name),
            "row": f"idl.RemoteFunction({', '.join(row)})",
            "parameters": ", ".join(parameters),
            "python": "None" if function.returns is None else self._python(function.returns),
            "doc": _docstring(function.doc or f"The function {function.name}.", 8),
            "call": ", ".join([f"self.FUNCTIONS[{function.name!r}]", *[_name(one.name) for one in function.arguments]]),
        }

    # Types ------------------------------------------------------------------------------------------------------------

    def _python(self, kind: Type) -> str:
        """Return the annotation of a type."""
        if kind.definition is not None:
            return "Any" if _is_native(kind) else self._names[kind.definition.module, kind.definition.name]
        if kind.name in _PYTHON:
            return "Any" if _is_native(kind) else _PYTHON[kind.name]
        container = "dict" if kind.name == "map" else kind.name
        return f"{container}[{', '.join(map(self._python, kind.items))}]"

    def _wire(self, kind: Type) -> str:
        """Return the expression of a type on the wire."""
        if _is_native(kind):
            return f"idl.native({kind.native!r})"
        match kind.definition:
            case Enum(module=module, name=name, base=base):
                of = self._names[module, name]
                number = _KINDS.get(base.removeprefix("std::"), "I32")
                return f"idl.EnumType({of}{'' if number == 'I32' else f', idl.{number}'})"
            case Struct(module=module, name=name):
                return f"idl.StructType({self._names[module, name]})"
        if kind.name in _PYTHON:
            return f"idl.{_KINDS.get(kind.native.removeprefix('std::'), _WIRE[kind.name])}"
        items = ", ".join(map(self._wire, kind.items))
        return (
            f"idl.MapType({items})" if kind.name == "map" else f"idl.ListType({items}{', set' * (kind.name == 'set')})"
        )

    def _default(self, member: Member) -> str:
        """Return the default of a field, which every field has, as in C++."""
        kind = member.type
        if member.default is not None and not _is_native(kind):
            value = self._literal(member.default, kind)
            return (
                value
                if kind.name in _PYTHON or isinstance(kind.definition, Enum)
                else f"field(default_factory=lambda: {value})"
            )
        if _is_native(kind):
            return f"field(default_factory=lambda: idl.default_of({kind.native!r}))"
        match kind.definition:
            case Enum(module=module, name=name, values=values):
                return f"{self._names[module, name]}.{_name(values[0].name)}" if values else "0"
            case Struct(module=module, name=name):
                return f"field(default_factory={self._names[module, name]})"
        return (
            _ZEROS[_PYTHON[kind.name]]
            if kind.name in _PYTHON
            else f"field(default_factory={self._python(kind).split('[')[0]})"
        )

    def _literal(self, value: Literal, kind: Type) -> str:
        """Return the expression of a value."""
        if isinstance(value, Fields):
            assert isinstance(kind.definition, Struct)
            types = {member.name: member.type for member in kind.definition.members}
            given = (f"{_name(name)}={self._literal(one, types[name])}" for name, one in value.values.items())
            return f"{self._python(kind)}({', '.join(given)})"
        if isinstance(kind.definition, Enum):
            return f"{self._python(kind)}({value!r})"
        if kind.name == "binary":
            return repr(str(value).encode())
        if not isinstance(value, tuple):
            return repr(value)
        if kind.name == "map":
            return f"{{{', '.join(self._pair(pair, kind) for pair in value)}}}"
        items = ", ".join(self._literal(one, kind.items[0]) for one in value)
        return f"[{items}]" if kind.name == "list" else f"{{{items}}}" if value else "set()"

    def _pair(self, pair: Literal, kind: Type) -> str:
        assert isinstance(pair, tuple)
        return ": ".join(self._literal(one, of) for one, of in zip(pair, kind.items, strict=True))


def _is_native(kind: Type) -> bool:
    """Return whether a class of YARP is on the wire, and not only another integer."""
    return bool(kind.native) and kind.native.removeprefix("std::") not in _KINDS


def _docstring(text: str, indent: int) -> str:
    """Return a docstring as a literal, of lines behind ``indent`` blanks."""
    lines = [line for part in text.split("\n") for line in (textwrap.wrap(part, _WIDTH) or [""])]
    quoted = [line.replace("\\", "\\\\").replace('"', '\\"') for line in lines]
    if len(quoted) == 1:
        return f'"""{quoted[0]}"""'
    space = "\n" + " " * indent
    return f'"""{space.join(quoted)}{space}"""'
