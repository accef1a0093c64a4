"""Messages of ROS 1 as bytes, by the package rosbags: definitions to its types, and objects that fit them."""

from __future__ import annotations

import keyword
import struct
import threading
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from rtf.ros1.definitions import ANY_LENGTH, NUMBERS
from rtf.ros1.errors import MessageError, MissingPackageError

try:
    from rosbags.interfaces import Nodetype
    from rosbags.serde import SerdeError
    from rosbags.typesys import Stores, get_typestore
    from rosbags.typesys.base import TypesysError
except ImportError as missing:
    raise MissingPackageError(f"ROS 1 needs the package rosbags: pip install 'rtf[ros]' ({missing})") from missing

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rosbags.interfaces.typing import BaseDesc, Basename, FieldDesc, NameDesc, Typesdict
    from rosbags.typesys.store import Typestore

    from rtf.ros1.definitions import Definition, Field

_TIMES = {"time": "builtin_interfaces/msg/Time", "duration": "builtin_interfaces/msg/Duration"}
_DTYPES = {name: np.dtype({"bool": "?", "byte": "i1", "char": "u1"}.get(name, name)) for name in NUMBERS}
_WRONG = (SerdeError, struct.error, AttributeError, TypeError, ValueError, OverflowError, IndexError)
#: rosbags makes classes in a module whose name is known to the whole process.
_making = threading.Lock()


class Codec:
    """Encodes and decodes the messages of definitions; with ``standard`` those of ROS Noetic are known."""

    def __init__(self, *, standard: bool) -> None:
        self._store: Typestore = get_typestore(Stores.ROS1_NOETIC if standard else Stores.EMPTY)
        self._fields: dict[str, list[Field]] = {}

    def standard_text(self, name: str) -> str | None:
        """Return the definitions of a type that rosbags has, and of all that it needs; None if it has none."""
        key = _key(name)
        return self._store.generate_msgdef(key)[0] if key in self._store.fielddefs else None

    def standard_names(self) -> Iterable[str]:
        """Return the names of the types that rosbags has."""
        return (name.replace("/msg/", "/") for name in self._store.fielddefs)

    def add(self, definitions: Iterable[Definition]) -> None:
        """Add types; all that they need is among them, or there already. Raises TypesysError for names that collide."""
        new: Typesdict = {}
        for one in definitions:
            self._fields[one.name] = one.fields
            if _key(one.name) not in self._store.fielddefs:
                constants = [(constant.name, _base(constant.type), constant.value) for constant in one.constants]
                new[_key(one.name)] = constants, [(field.name, _description(field)) for field in one.fields]
        if new:
            with _making:
                self._store.register(new)

    def make(self, name: str, values: dict[str, Any]) -> Any:
        """Return a message with these values of its fields, and zeros and empty texts in the others."""
        fields = self._fields[name]
        found = [values[field.name] if field.name in values else self._default(field) for field in fields]
        return self._fitted(self._store.types[_key(name)](*found), name)

    def encode(self, message: Any, name: str) -> memoryview:
        """Return the bytes of a message. Lists of numbers are converted. Raises MessageError."""
        try:
            return self._store.serialize_ros1(self._fitted(message, name), _key(name))
        except _WRONG as error:
            raise MessageError(f"{_short(message)} is no {name}: {error}") from None

    def decode(self, data: bytes | memoryview, name: str) -> Any:
        """Return the message of bytes, whose arrays refer to them. Raises MessageError."""
        try:
            return self._store.deserialize_ros1(data, _key(name))
        except _WRONG as error:
            raise MessageError(f"{len(data)} bytes are no {name}: {error}") from None

    def _default(self, field: Field) -> Any:
        if field.length is not None:
            size = max(field.length, 0)
            if field.type in _DTYPES:
                return np.zeros(size, _DTYPES[field.type])
            return [self._one(field.type) for _ in range(size)]
        return self._one(field.type)

    def _one(self, kind: str) -> Any:
        if kind in _TIMES:
            return self._store.types[_TIMES[kind]](0, 0)
        if kind in NUMBERS:
            return {"bool": False}.get(kind, 0.0 if kind.startswith("float") else 0)
        return "" if kind == "string" else self.make(kind, {})

    def _fitted(self, message: Any, name: str) -> Any:
        """Return a message whose arrays are what rosbags encodes: the same, or a copy."""
        changes: dict[str, Any] = {}
        for field in self._fields[name]:
            known = field.type in self._fields
            if not known and (field.length is None or field.type not in _DTYPES):
                continue
            attribute = attribute_of(field.name)
            value = getattr(message, attribute)
            if not known:
                fitted = _array(value, field)
            elif field.length is None:
                fitted = self._fitted(value, field.type)
            else:
                fitted = [self._fitted(one, field.type) for one in value]
                fitted = value if all(new is old for new, old in zip(fitted, value, strict=True)) else fitted
            if fitted is not value:
                changes[attribute] = fitted
        return replace(message, **changes) if changes else message


def attribute_of(field: str) -> str:
    """Return the attribute of a field: words of Python have ``_`` behind them."""
    return f"{field}_" if keyword.iskeyword(field) else field


def _array(value: Any, field: Field) -> Any:
    """Return numbers as an array of the type of their field. Raises ValueError."""
    dtype = _DTYPES[field.type]
    if isinstance(value, np.ndarray) and value.dtype == dtype and value.flags.c_contiguous and value.ndim == 1:
        return value
    if isinstance(value, bytes | bytearray | memoryview):
        return np.frombuffer(value, dtype)
    found = np.asarray(value)
    if found.ndim != 1:
        raise ValueError(f"{field.name} is a list of numbers, and has {found.ndim} dimensions")
    fits = dtype.kind == "f" or found.dtype.kind in "bui" or not found.size
    if found.dtype.kind not in "buif" or not fits:
        raise ValueError(f"{field.name} has {found.dtype} instead of {field.type}")
    converted = np.ascontiguousarray(found, dtype)
    if dtype.kind in "bui" and found.size and not np.array_equal(converted, found):
        raise ValueError(f"{field.name} has numbers that do not fit into {field.type}")
    return converted


def _key(name: str) -> str:
    return name.replace("/", "/msg/")


def _base(kind: str) -> Basename:
    return kind  # type: ignore[return-value]  # the definitions have been checked


def _description(field: Field) -> FieldDesc:
    base: BaseDesc | NameDesc
    if field.type in NUMBERS or field.type == "string":
        base = Nodetype.BASE, (_base(field.type), 0)
    else:
        base = Nodetype.NAME, _TIMES.get(field.type) or _key(field.type)
    if field.length is None:
        return base
    return (Nodetype.SEQUENCE, (base, 0)) if field.length == ANY_LENGTH else (Nodetype.ARRAY, (base, field.length))


def _short(message: object) -> str:
    return f"{message!r:.80}"


__all__ = ["Codec", "TypesysError", "attribute_of"]
