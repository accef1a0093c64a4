"""Types of messages and services of ROS 1: their hashes (``md5sum``), definitions and bytes.

The hash is that of all ROS 1 programs: of the definition without comments, with the hash of each message in the place
of its name (http://wiki.ros.org/ROS/Technical%20Overview). What a definition can make a reader do is bounded.
"""

from __future__ import annotations

import hashlib
import threading
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from rtf.errors import did_you_mean
from rtf.ros1.codec import Codec, TypesysError, attribute_of
from rtf.ros1.definitions import NUMBERS, read_full_text, read_message, read_service
from rtf.ros1.errors import DefinitionError, MessageError, Ros1Error

if TYPE_CHECKING:
    from rtf.ros1.definitions import Definition, Field

#: Types are not nested deeper, and a message has no more fields than this, those of its fields included.
_DEEPEST, _MOST_FIELDS = 50, 100_000
#: The longest array of texts or messages whose length is in its type: its code is written out.
_LONGEST_ARRAY = 1000
#: Fields that a message may have for each of its bytes: a list of many empty ones would be read for hours.
_MOST_FIELDS_A_BYTE = 1000
_SERVICES = {
    "std_srvs/Empty": "---\n",
    "std_srvs/SetBool": "bool data\n---\nbool success\nstring message\n",
    "std_srvs/Trigger": "---\nbool success\nstring message\n",
}
_RULE = "=" * 80


class _Resolved(NamedTuple):
    """A definition with what it needs: what is hashed, its least number of bytes, its fields, its depth."""

    definition: Definition
    hashed: str
    least: int
    fields: int
    depth: int
    needs: dict[str, None]

    @property
    def md5sum(self) -> str:
        return _md5(self.hashed)


class MessageType:
    """A type of messages. Calling it makes one: ``String("hello")``; what is not given is zero or empty."""

    __slots__ = ("_codec", "_fields", "definition", "md5sum", "name")

    def __init__(self, codec: Codec, resolved: _Resolved, definition: str) -> None:
        self.name, self.md5sum, self.definition = resolved.definition.name, resolved.md5sum, definition
        self._codec = codec
        self._fields = [field.name for field in resolved.definition.fields]

    def __call__(self, *values: Any, **fields: Any) -> Any:  # its class is made at run time
        """Return a message, with values in the order of the fields, or by name. Raises MessageError."""
        named = {attribute_of(name): name for name in self._fields}
        given = dict(zip(self._fields, values, strict=False)) | {named.get(key, key): fields[key] for key in fields}
        for unknown in given.keys() - self._fields:
            raise MessageError(f"{self.name} has no field {unknown}{did_you_mean(unknown, self._fields)}")
        if len(values) > len(self._fields):
            raise MessageError(f"{self.name} has {len(self._fields)} fields, not {len(values)}")
        try:
            return self._codec.make(self.name, given)
        except (AttributeError, TypeError, ValueError, OverflowError) as error:
            raise MessageError(f"no {self.name}: {error}") from None

    def __repr__(self) -> str:
        return f"<message type {self.name}>"

    def encode(self, message: Any) -> memoryview:
        """Return the bytes of a message; lists of numbers are converted. Raises MessageError."""
        return self._codec.encode(message, self.name)

    def decode(self, data: bytes | memoryview) -> Any:
        """Return the message of bytes, whose arrays refer to them. Raises MessageError."""
        return self._codec.decode(data, self.name)


class ServiceType(NamedTuple):
    """A type of services: those of its requests and responses."""

    name: str
    md5sum: str
    request: MessageType
    response: MessageType


class Types:
    """Types by their names, such as ``std_msgs/String``: the standard ones, and those that are added.

    It may be used by any thread.
    """

    def __init__(self, *, standard: bool = True) -> None:
        """Without ``standard`` it is empty."""
        self._codec = Codec(standard=standard)
        self._definitions: dict[str, Definition] = {}
        self._resolved: dict[str, _Resolved] = {}
        self._messages: dict[str, MessageType] = {}
        self._services = dict.fromkeys(_SERVICES, "") if standard else {}
        self._lock = threading.RLock()
        for name, text in _SERVICES.items() if standard else ():
            self.add_service(name, text)

    def message(self, name: str) -> MessageType:
        """Return a type of messages. Raises Ros1Error for one that is unknown, and DefinitionError."""
        with self._lock:
            if name not in self._messages:
                if self._find(name) is None:
                    known = {*self._definitions, *self._codec.standard_names()}
                    raise Ros1Error(f"there is no type of messages {name[:80]!r}{did_you_mean(name, known)}{_ADD}")
                self._messages[name] = self._make(name)
            return self._messages[name]

    def service(self, name: str) -> ServiceType:
        """Return a type of services. Raises as above."""
        with self._lock:
            if name not in self._services:
                near = did_you_mean(name, self._services)
                raise Ros1Error(f"there is no type of services {name[:80]!r}{near}{_ADD}")
            request, response = self.message(f"{name}Request"), self.message(f"{name}Response")
            hashed = self._resolved[request.name].hashed + self._resolved[response.name].hashed
            return ServiceType(name, _md5(hashed), request, response)

    def add_message(self, name: str, text: str, file: str = "") -> None:
        """Add the definition of a message. Raises DefinitionError, also if there is a different one."""
        self._add(read_message(text, name, file))

    def add_service(self, name: str, text: str, file: str = "") -> None:
        """Add the definition of a service. Raises DefinitionError."""
        for definition in read_service(text, name, file):
            self._add(definition)
        self._services[name] = file

    def add_full_text(self, name: str, text: str) -> None:
        """Add a message and all that it needs, from the text that nodes send. Raises DefinitionError."""
        for definition in read_full_text(text, name):
            self._add(definition)

    def add_package(self, folder: Path | str) -> None:
        """Add ``msg/*.msg`` and ``srv/*.srv`` of a package's folder, which has its name.

        Raises DefinitionError, and Ros1Error if nothing is there.
        """
        home = Path(folder)
        files = sorted([*home.glob("msg/*.msg"), *home.glob("srv/*.srv")])
        if not files:
            raise Ros1Error(f"{home} has no msg/*.msg and no srv/*.srv")
        for file in files:
            add = self.add_message if file.suffix == ".msg" else self.add_service
            try:
                text = file.read_text(encoding="utf-8")
            except (OSError, UnicodeDecodeError) as error:
                raise Ros1Error(f"{file} cannot be read: {error}") from None
            add(f"{home.resolve().name}/{file.stem}", text, str(file))

    def _add(self, definition: Definition) -> None:
        with self._lock:
            known = self._find(definition.name)
            if known is None:
                self._definitions[definition.name] = definition
            elif _contents(known) != _contents(definition):
                raise DefinitionError(f"{definition.name} is known, with another definition", definition.where())

    def _find(self, name: str) -> Definition | None:
        """Return the definition of a type; a standard one is added with all that it needs."""
        if name not in self._definitions:
            text = self._codec.standard_text(name)
            for one in () if text is None else read_full_text(text, name):
                self._definitions.setdefault(one.name, one)
        return self._definitions.get(name)

    def _make(self, name: str) -> MessageType:
        resolved = self._resolve(name, ())
        needed = [self._resolved[one].definition for one in resolved.needs]
        try:
            self._codec.add([*needed, resolved.definition])
        except TypesysError as error:
            raise DefinitionError(str(error), resolved.definition.where()) from None
        parts = [resolved.definition.text, *(f"{_RULE}\nMSG: {one.name}\n{one.text}" for one in needed)]
        return MessageType(self._codec, resolved, "\n".join(parts))

    def _resolve(self, name: str, path: tuple[str, ...]) -> _Resolved:
        """Return a type with all that it needs; ``path`` has the types in which it is a field."""
        if name in self._resolved:
            return self._resolved[name]
        definition = self._find(name)
        assert definition is not None  # callers have checked it
        if len(path) >= _DEEPEST:
            raise DefinitionError(f"types are nested more than {_DEEPEST} deep", definition.where())
        parts = {need: self._need(definition, need, (*path, name)) for need in definition.needs}
        hashed = [f"{one.type} {one.name}={one.text}" for one in definition.constants]
        least = fields = 0
        for field in definition.fields:
            part = parts.get(field.type)
            hashed.append(f"{part.md5sum if part else field.written} {field.name}")
            size, count = _measure(field, part, definition)
            least, fields = least + size, fields + count
        depth = 1 + max((part.depth for part in parts.values()), default=0)
        _check(definition, least, fields, depth)
        needs = {deep: None for need, part in parts.items() for deep in (need, *part.needs)}
        self._resolved[name] = _Resolved(definition, "\n".join(hashed), least, fields, depth, needs)
        return self._resolved[name]

    def _need(self, owner: Definition, name: str, path: tuple[str, ...]) -> _Resolved:
        line = next(field.line for field in owner.fields if field.type == name)
        if name in path:
            raise DefinitionError(f"{owner.name} contains itself, by {name}", owner.where(line))
        if self._find(name) is None:
            raise DefinitionError(f"there is no type {name}{_ADD}", owner.where(line))
        return self._resolve(name, path)


_ADD = " (add its package, or its text)"


def _measure(field: Field, part: _Resolved | None, owner: Definition) -> tuple[int, int]:
    """Return the least number of bytes of a field, and the number of its fields."""
    size = part.least if part else NUMBERS.get(field.type, 4 if field.type == "string" else 8)
    count = part.fields + 1 if part else 1
    if field.length is None:
        return size, count
    if not size:
        raise DefinitionError(f"a list of {field.type}, which has no bytes", owner.where(field.line))
    if field.length < 0:
        return 4, 1
    if field.type in NUMBERS:
        return size * field.length, 1
    if field.length > _LONGEST_ARRAY:
        what = f"an array of {field.length} {field.type}; at most {_LONGEST_ARRAY} are possible"
        raise DefinitionError(what, owner.where(field.line))
    return size * field.length, count * field.length


def _check(definition: Definition, least: int, fields: int, depth: int) -> None:
    if depth > _DEEPEST:
        raise DefinitionError(f"types are nested more than {_DEEPEST} deep", definition.where())
    most = min(_MOST_FIELDS, _MOST_FIELDS_A_BYTE * max(least, 1))
    if fields > most:
        raise DefinitionError(f"a message has {fields} fields; at most {most} are possible", definition.where())


def _contents(one: Definition) -> tuple[list[tuple[str, str, str]], list[tuple[str, str]]]:
    constants = [(constant.type, constant.name, constant.text) for constant in one.constants]
    return constants, [(field.written, field.name) for field in one.fields]


def _md5(text: str) -> str:
    return hashlib.md5(text.encode(), usedforsecurity=False).hexdigest()


@cache
def standard_types() -> Types:
    """Return the types of this process that are used where none are given; packages may be added."""
    return Types()


def message_type(name: str) -> MessageType:
    """Return a type of messages of :func:`standard_types`. Raises Ros1Error."""
    return standard_types().message(name)


def service_type(name: str) -> ServiceType:
    """Return a type of services of :func:`standard_types`. Raises Ros1Error."""
    return standard_types().service(name)
