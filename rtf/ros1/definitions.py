"""Definitions of ROS 1, ``.msg`` and ``.srv``: text to :class:`Definition`, with the place of everything.

The hash of a type (``md5sum``) is computed elsewhere, from the texts that are kept here: constants have the value as it
was written. The format is http://wiki.ros.org/msg.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TypeAlias

from rtf.errors import Location
from rtf.ros1.errors import DefinitionError

#: A longer text is refused, in characters; so is a message with more lines.
MAX_SIZE, _MOST_LINES = 1 << 20, 10_000
#: The longest array whose length is in its type.
_LONGEST_ARRAY = 1_000_000
#: The number of bytes of each type of numbers.
NUMBERS = {
    "bool": 1, "byte": 1, "char": 1, "int8": 1, "uint8": 1, "int16": 2, "uint16": 2, "int32": 4, "uint32": 4,
    "int64": 8, "uint64": 8, "float32": 4, "float64": 8,
}  # fmt: skip
#: Types that need no definition.
BUILT_IN = frozenset({*NUMBERS, "string", "time", "duration"})
#: The length of an array whose messages say how long it is.
ANY_LENGTH = -1

Value: TypeAlias = "bool | int | float | str"
_NAME = re.compile(r"[A-Za-z]\w*", re.ASCII)
_TYPE_NAME = re.compile(r"[A-Za-z]\w*/[A-Za-z]\w*", re.ASCII)
_FIELD = re.compile(r"\s*(?P<type>[\w/]+)(?:\[(?P<length>\d*)\])?\s+(?P<name>\w+)\s*", re.ASCII)
_CONSTANT = re.compile(r"\s*(?P<type>\w+)\s+(?P<name>\w+)\s*=(?P<value>.*)", re.ASCII)
_STRING = re.compile(r"\s*string\s+\w+\s*=", re.ASCII)
_BETWEEN_TYPES = re.compile(r"(?:\A|\n)={80}\r?\nMSG:[ \t]*(\S+)[ \t]*\r?(?=\n|\Z)")
_BETWEEN_CALLS = re.compile(r"^---[^\n]*\n?", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Field:
    """A field: ``type`` is built in, or ``package/Name``; ``length`` that of an array, ANY_LENGTH, or None."""

    type: str
    name: str
    length: int | None
    line: int

    @property
    def written(self) -> str:
        """The type as it is written, with its array."""
        return self.type + {None: "", ANY_LENGTH: "[]"}.get(self.length, f"[{self.length}]")


@dataclass(frozen=True, slots=True)
class Constant:
    """A constant: ``text`` is its value as it is written."""

    type: str
    name: str
    text: str
    value: Value


@dataclass(frozen=True, slots=True)
class Definition:
    """A type of message, and the text that defines it, which is from ``file``."""

    name: str
    constants: list[Constant]
    fields: list[Field]
    text: str
    file: str = ""

    @property
    def needs(self) -> list[str]:
        """The types of messages that it has as fields."""
        return [*dict.fromkeys(one.type for one in self.fields if one.type not in BUILT_IN)]

    def where(self, line: int = 0, column: int = 0) -> Location:
        """Return a place in its text, or that of all of it."""
        return Location(self.file or f"<{self.name[:80]}>", line, column)


def read_message(text: str, name: str, file: str = "", first: int = 1) -> Definition:
    """Return the definition of a message, ``package/Name``, from line ``first`` of a file. Raises DefinitionError."""
    found = Definition(name, [], [], text, file)
    if not _TYPE_NAME.fullmatch(name):
        raise DefinitionError(f"{name[:80]!r} is no type; write it as in std_msgs/String", found.where())
    names: set[str] = set()
    for number, line in enumerate(_lines(text, found), first):
        item = _item(line, found.where(number), name.partition("/")[0])
        if item is None:
            continue
        if item.name in names:
            raise DefinitionError(f"{item.name[:80]} is there twice", found.where(number))
        names.add(item.name)
        if isinstance(item, Constant):
            found.constants.append(item)
        else:
            found.fields.append(item)
    return found


def read_service(text: str, name: str, file: str = "") -> tuple[Definition, Definition]:
    """Return the definitions of a service's request and response. Raises DefinitionError."""
    parts = _BETWEEN_CALLS.split(text)
    if len(parts) != 2:  # noqa: PLR2004 - request and response
        where = Location(file or f"<{name}>")
        raise DefinitionError(f"a service has one line '---' between request and response, not {len(parts) - 1}", where)
    first = parts[0].count("\n") + 2
    return read_message(parts[0], f"{name}Request", file), read_message(parts[1], f"{name}Response", file, first)


def read_full_text(text: str, name: str) -> list[Definition]:
    """Return the definitions of a message and of all that it needs, as nodes send them. Raises DefinitionError."""
    if len(text) > MAX_SIZE:
        raise DefinitionError(f"{len(text)} characters; at most {MAX_SIZE} are read", Location(f"<{name[:80]}>"))
    parts = _BETWEEN_TYPES.split(text)
    parts[2::2] = [part.removeprefix("\n") for part in parts[2::2]]
    return [read_message(part, one) for one, part in zip([name, *parts[1::2]], parts[::2], strict=True)]


def _lines(text: str, found: Definition) -> list[str]:
    if len(text) > MAX_SIZE:
        raise DefinitionError(f"{len(text)} characters; at most {MAX_SIZE} are read", found.where())
    lines = text.split("\n")
    if len(lines) > _MOST_LINES:
        raise DefinitionError(f"{len(lines)} lines; at most {_MOST_LINES} are read", found.where())
    return lines


def _item(line: str, where: Location, package: str) -> Field | Constant | None:
    """Return what a line defines; None if it is empty or a comment."""
    is_string = _STRING.match(line) is not None  # all that follows is the value: there are no comments
    code = line if is_string else line.partition("#")[0]
    if not code.strip():
        return None
    if found := _CONSTANT.fullmatch(code):
        return _constant(found, Location(where.file, where.line, found.start("type") + 1))
    found = _FIELD.fullmatch(code)
    if found is None or not _NAME.fullmatch(found["name"]):
        column = len(code) - len(code.lstrip()) + 1
        place = Location(where.file, where.line, column)
        raise DefinitionError(f"{code.strip()[:80]!r} is neither 'type name' nor 'type NAME=value'", place)
    place = Location(where.file, where.line, found.start("type") + 1)
    return Field(_full_type(found["type"], package, place), found["name"], _length(found["length"], place), where.line)


def _full_type(name: str, package: str, where: Location) -> str:
    if name in BUILT_IN:
        return name
    if name == "Header":
        return "std_msgs/Header"
    full = name if "/" in name else f"{package}/{name}"
    if not _TYPE_NAME.fullmatch(full):
        raise DefinitionError(f"{name[:80]!r} is no type", where)
    return full


def _length(text: str | None, where: Location) -> int | None:
    if not text:
        return None if text is None else ANY_LENGTH
    if len(text) > len(str(_LONGEST_ARRAY)) or int(text) > _LONGEST_ARRAY:
        raise DefinitionError(f"an array of {text[:20]}; at most {_LONGEST_ARRAY} are possible", where)
    return int(text)


def _constant(found: re.Match[str], where: Location) -> Constant:
    kind, name, text = found["type"], found["name"], found["value"].strip()
    if kind not in NUMBERS and kind != "string":
        raise DefinitionError(f"a constant is a number or a string, not {kind[:80]}", where)
    if not _NAME.fullmatch(name):
        raise DefinitionError(f"{name[:80]!r} is no name", where)
    try:
        return Constant(kind, name, text, _value(kind, text))
    except (ValueError, OverflowError):
        raise DefinitionError(f"{text[:80]!r} is no {kind}", where) from None


def _value(kind: str, text: str) -> Value:
    if kind == "string":
        return text
    if kind.startswith("float"):
        return float(text)
    if kind == "bool":
        return text == "True" if text in ("True", "False") else bool(int(text))
    value = int(text)
    bits = 8 * NUMBERS[kind]
    low, high = (0, 1 << bits) if kind.startswith("u") or kind == "char" else (-1 << (bits - 1), 1 << (bits - 1))
    if not low <= value < high:
        raise ValueError(text)
    return value
