"""Reads interface files: text to :class:`Document`, with the place of everything, and the comments above it.

The package lark parses, by the grammar beside this file. A comment ``/** … */`` directly above something is its
documentation.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from lark import Lark, Token, Tree, v_args
from lark.exceptions import UnexpectedCharacters, UnexpectedInput, UnexpectedToken, VisitError
from lark.visitors import Transformer_NonRecursive

from rtf.errors import Location
from rtf.idl.errors import IdlError
from rtf.idl.syntax import (
    ConstantDefinition,
    Definition,
    Document,
    Enumeration,
    Enumerator,
    Field,
    Function,
    Include,
    MapValue,
    Reference,
    ServiceDefinition,
    Structure,
    Typedef,
    TypeName,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from lark.tree import Meta

    from rtf.idl.syntax import Annotations, Constant

#: A longer file is refused, in characters.
MAX_SIZE = 1 << 20
#: Types, values and blocks are not nested deeper than this.
MAX_NESTING = 40
_GRAMMAR = Path(__file__).with_name("thrift.lark")
_ESCAPE = re.compile(r"\\(.)", re.DOTALL)
_ESCAPES = {"n": "\n", "r": "\r", "t": "\t"}
_INT64 = range(-(1 << 63), 1 << 63)
_MOST_DIGITS = 30
#: What terminals are called in messages. Separators are possible nearly everywhere.
_TERMINALS = {
    "NAME": "a name", "WHOLE": "a whole number", "NUMBER": "a number", "TEXT": "a text",
    "LPAR": "(", "RPAR": ")", "LBRACE": "{", "RBRACE": "}", "LSQB": "[", "RSQB": "]",
    "LESSTHAN": "<", "MORETHAN": ">", "EQUAL": "=", "COLON": ":", "STAR": "*", "COMMA": "", "SEMICOLON": "",
    "$END": "the end of the file",
}  # fmt: skip


def read_file(path: Path) -> Document:
    """Read a file. Raises IdlError, also for a file that cannot be read."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            return read_text(file.read(MAX_SIZE + 1), str(path))
    except OSError as error:
        raise IdlError(f"the file cannot be read: {error.strerror}", Location(str(path))) from None
    except UnicodeDecodeError as error:
        raise IdlError(f"byte {error.start} is not UTF-8", Location(str(path))) from None


def read_text(text: str, file: str = "") -> Document:
    """Read the text of a file; ``file`` is its name in messages. Raises IdlError."""
    if len(text) > MAX_SIZE:
        raise IdlError(f"the file has more than {MAX_SIZE} characters", Location(file))
    try:
        tree = _parser().parse(text)
    except UnexpectedInput as error:
        raise IdlError(_unexpected(error, text), _where(error, text, file)) from None
    _check_nesting(tree, file)
    try:
        return _Reader(text, file).transform(tree)
    except VisitError as error:
        raise error.orig_exc from None


@cache
def _parser() -> Lark:
    return Lark(_GRAMMAR.read_text(encoding="utf-8"), parser="lalr", lexer="basic", propagate_positions=True)


def _check_nesting(tree: Tree[Token], file: str) -> None:
    level = [tree]
    for _ in range(MAX_NESTING):
        level = [child for node in level for child in node.children if isinstance(child, Tree)]
        if not level:
            return
    raise IdlError("types or values are nested too deeply", Location(file, level[0].meta.line, level[0].meta.column))


def _where(error: UnexpectedInput, text: str, file: str) -> Location:
    if isinstance(error, UnexpectedToken) and error.token.type == "$END":
        return Location(file, text.count("\n") + 1, len(text) - text.rfind("\n"))
    return Location(file, error.line, error.column)


def _unexpected(error: UnexpectedInput, text: str) -> str:
    if isinstance(error, UnexpectedCharacters):
        at = error.pos_in_stream or 0
        hint = "; the comment has no end" if text.startswith("/*", at) else ""
        return f"{text[at]!r} is not allowed here{hint}"
    assert isinstance(error, UnexpectedToken)
    found = "the end of the file" if error.token.type == "$END" else repr(str(error.token[:40]))
    names = {_TERMINALS.get(name, name.lower()) for name in error.accepts or error.expected}
    return f"{found} is not expected here; possible: {', '.join(sorted(names - {''}))}"


def _first(children: Sequence[object], kind: str) -> Token | None:
    """Return the first token of a kind."""
    return next((child for child in children if isinstance(child, Token) and child.type == kind), None)


def _annotations(children: Sequence[object]) -> Annotations:
    return next((child for child in children if isinstance(child, dict)), {})


@v_args(meta=True)
class _Reader(Transformer_NonRecursive[Token, Document]):
    """Makes the parts of a document, from the inside."""

    def __init__(self, text: str, file: str) -> None:
        super().__init__(visit_tokens=False)
        self._text = text
        self._file = file

    def _location(self, token: Token) -> Location:
        return Location(self._file, token.line or 0, token.column or 0)

    def _at(self, meta: Meta) -> Location:
        return Location(self._file, meta.line, meta.column)

    def _doc(self, meta: Meta) -> str:
        """Return the comment directly above, without its stars."""
        before = self._text[: meta.start_pos].rstrip()
        begin = before.rfind("/**")
        if not before.endswith("*/") or begin < 0 or "*/" in before[begin:-2]:
            return ""
        lines = [
            line.strip().removeprefix("*").removeprefix(" ").rstrip() for line in before[begin + 3 : -2].split("\n")
        ]
        return "\n".join(lines).strip().strip("*").strip()

    def start(self, _meta: Meta, children: Sequence[object]) -> Document:
        """The whole file."""
        return Document(
            self._file,
            tuple(child for child in children if isinstance(child, Include)),
            dict(child for child in children if isinstance(child, tuple)),
            tuple(child for child in children if isinstance(child, Definition)),
        )

    def include(self, meta: Meta, children: Sequence[Token]) -> Include:
        """A file that is included."""
        return Include(self._plain(children[0]), self._at(meta))

    def cpp_include(self, _meta: Meta, _children: Sequence[Token]) -> None:
        """A header of C++, which concerns nobody here."""

    def namespace(self, _meta: Meta, children: Sequence[Token]) -> tuple[str, str]:
        """A language, and its namespace."""
        return str(children[0]), str(children[1])

    # Definitions ------------------------------------------------------------------------------------------------------

    def const(self, meta: Meta, children: Sequence[object]) -> ConstantDefinition:
        """A constant."""
        kind, name, value = children[:3]
        assert isinstance(kind, TypeName)
        assert isinstance(name, Token)
        return ConstantDefinition(*self._named(name, meta, children[3:]), kind, value)  # type: ignore[arg-type]

    def typedef(self, meta: Meta, children: Sequence[object]) -> Typedef:
        """Another name for a type."""
        kind, name = children[:2]
        assert isinstance(kind, TypeName)
        assert isinstance(name, Token)
        return Typedef(*self._named(name, meta, children[2:]), kind)

    def enum(self, meta: Meta, children: Sequence[object]) -> Enumeration:
        """An enumeration: a value that is not given is one more than the one before; the first one is 0."""
        name, *rest = children
        assert isinstance(name, Token)
        values: list[Enumerator] = []
        for child in rest:
            if isinstance(child, tuple):
                item, given, doc = child
                value = given if given is not None else values[-1].value + 1 if values else 0
                values.append(Enumerator(str(item), self._location(item), value, doc))
        return Enumeration(*self._named(name, meta, rest), tuple(values))

    def enumerator(self, meta: Meta, children: Sequence[object]) -> tuple[Token, int | None, str]:
        """The name of a value, its number, and its documentation."""
        name, value = children[0], _first(children, "WHOLE")
        assert isinstance(name, Token)
        return name, None if value is None else self._int(value), self._doc(meta)

    def structure(self, meta: Meta, children: Sequence[object]) -> Structure:
        """A structure, or an exception."""
        kind, name, *rest = children
        assert isinstance(name, Token)
        if kind == "union":
            raise IdlError(
                f"{name} is a union, which YARP's messages do not have; make it a struct", self._location(name)
            )
        fields = tuple(child for child in rest if isinstance(child, Field))
        return Structure(*self._named(name, meta, rest), fields)

    def field(self, meta: Meta, children: Sequence[object]) -> Field:
        """A field, or an argument."""
        kind = next(child for child in children if isinstance(child, TypeName))
        name = _first(children, "NAME")
        assert name is not None
        after = children[children.index(name) + 1 :]
        value = next((child for child in after if not isinstance(child, dict)), None)
        return Field(str(name), self._location(name), kind, value, _annotations(after), self._doc(meta))  # type: ignore[arg-type]

    def service(self, meta: Meta, children: Sequence[object]) -> ServiceDefinition:
        """A service."""
        names = [child for child in children if isinstance(child, Token)]
        functions = tuple(child for child in children if isinstance(child, Function))
        extends = str(names[1]) if len(names) > 1 else ""
        return ServiceDefinition(*self._named(names[0], meta, children), extends, functions)

    def function(self, meta: Meta, children: Sequence[object]) -> Function:
        """A function of a service. Exceptions that it may throw are not part of YARP's messages."""
        name = _first(children, "NAME")
        assert name is not None
        returns = next((child for child in children if isinstance(child, TypeName)), None)
        arguments = tuple(child for child in children if isinstance(child, Field))
        oneway = _first(children, "ONEWAY") is not None
        return Function(*self._named(name, meta, children), returns, arguments, oneway)

    def throws(self, _meta: Meta, _children: Sequence[object]) -> None:
        """Exceptions of a function."""

    def _named(self, name: Token, meta: Meta, rest: Sequence[object]) -> tuple[str, Location, Annotations, str]:
        if "." in name:
            raise IdlError(f"{name} is defined, but a name of one's own has no dot", self._location(name))
        return str(name), self._location(name), _annotations(rest), self._doc(meta)

    # Types ------------------------------------------------------------------------------------------------------------

    def plain_type(self, _meta: Meta, children: Sequence[object]) -> TypeName:
        """A type without parts."""
        name = children[0]
        assert isinstance(name, Token)
        return TypeName(str(name), self._location(name), (), _annotations(children))

    def list_type(self, meta: Meta, children: Sequence[object]) -> TypeName:
        """A list."""
        return self._container("list", meta, children)

    def set_type(self, meta: Meta, children: Sequence[object]) -> TypeName:
        """A set."""
        return self._container("set", meta, children)

    def map_type(self, meta: Meta, children: Sequence[object]) -> TypeName:
        """A map."""
        return self._container("map", meta, children)

    def _container(self, name: str, meta: Meta, children: Sequence[object]) -> TypeName:
        items = tuple(child for child in children if isinstance(child, TypeName))
        return TypeName(name, self._at(meta), items, _annotations(children))

    # Values -----------------------------------------------------------------------------------------------------------

    def whole(self, _meta: Meta, children: Sequence[Token]) -> int:
        """A whole number."""
        return self._int(children[0])

    def number(self, _meta: Meta, children: Sequence[Token]) -> float:
        """Any other number."""
        return float(children[0])

    def text(self, _meta: Meta, children: Sequence[Token]) -> str:
        """A text in quotes."""
        return self._plain(children[0])

    def reference(self, _meta: Meta, children: Sequence[Token]) -> Constant:
        """A name: of a constant, or a truth value."""
        name = children[0]
        return name == "true" if name in ("true", "false") else Reference(str(name), self._location(name))

    def list_value(self, _meta: Meta, children: Sequence[Constant]) -> tuple[Constant, ...]:
        """A list."""
        return tuple(children)

    def map_value(self, _meta: Meta, children: Sequence[Constant]) -> MapValue:
        """A map, or a structure."""
        return MapValue(tuple(zip(children[::2], children[1::2], strict=True)))

    def _int(self, token: Token) -> int:
        value = int(token, 16 if "x" in token.lower() else 10) if len(token) < _MOST_DIGITS else _INT64.stop
        if value not in _INT64:
            raise IdlError(f"{token[:40]} does not fit into 64 bits", self._location(token))
        return value

    def _plain(self, token: Token) -> str:
        return _ESCAPE.sub(lambda found: _ESCAPES.get(found[1], found[1]), token[1:-1])

    # Annotations ------------------------------------------------------------------------------------------------------

    def annotations(self, _meta: Meta, children: Sequence[tuple[str, str]]) -> Annotations:
        """All of something."""
        return dict(children)

    def annotation(self, _meta: Meta, children: Sequence[Token | None]) -> tuple[str, str]:
        """A name and a text; a name alone says that something is so."""
        name, *value = children
        return str(name), self._plain(value[0]) if value and value[0] is not None else "1"
