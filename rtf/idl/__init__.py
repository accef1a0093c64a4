"""Interfaces by IDL: messages and services that are described in ``.thrift`` files, as YARP's programs have them.

:func:`load` makes the classes of a file at once; ``rtf idl py`` writes them as a module. Messages are dataclasses that
every port writes and reads, a service is a class to implement, and its client calls one over the network. The modules
``reading`` and ``resolving`` find what a file says; this package exports what generated modules need.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from rtf.errors import Location, did_you_mean
from rtf.idl.editor import Editor
from rtf.idl.errors import CallError, IdlError, MissingPackageError
from rtf.idl.service import Client, RemoteFunction, Service, serve
from rtf.idl.types import (
    BINARY,
    BOOL,
    DOUBLE,
    FLOAT,
    I8,
    I16,
    I32,
    I64,
    SIZE,
    STRING,
    U8,
    U16,
    U32,
    U64,
    VOCAB,
    EnumType,
    Field,
    ListType,
    MapType,
    Message,
    StructType,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.idl.program import Program
    from rtf.idl.types import NativeType

#: The interface files of YARP 4's devices and of robot interfaces, which are found by their names alone.
SERVICES = Path(__file__).parent / "services"

__all__ = [
    "BINARY",
    "BOOL",
    "DOUBLE",
    "FLOAT",
    "I8",
    "I16",
    "I32",
    "I64",
    "SERVICES",
    "SIZE",
    "STRING",
    "U8",
    "U16",
    "U32",
    "U64",
    "VOCAB",
    "CallError",
    "Client",
    "Editor",
    "EnumType",
    "Field",
    "IdlError",
    "ListType",
    "MapType",
    "Message",
    "MissingPackageError",
    "RemoteFunction",
    "Service",
    "StructType",
    "default_of",
    "load",
    "native",
    "read",
    "serve",
]


def read(path: str | Path, folders: Sequence[str | Path] = ()) -> Program:
    """Read an interface file, and those that it includes: beside it, above it, or in one of ``folders``.

    A name without an ending, such as ``control_board``, is a file of :data:`SERVICES`. Raises IdlError with file, line
    and column, and MissingPackageError.
    """
    try:
        from rtf.idl.resolving import read_program
    except ImportError as error:
        raise MissingPackageError(f"interface files need the package lark: pip install 'rtf[idl]' ({error})") from error
    return read_program(_found(Path(path)), [*map(Path, folders)])


def _found(path: Path) -> Path:
    """Return the file of a name. Raises IdlError for a name alone that is no file."""
    if path.suffix or path.name != str(path) or path.exists():
        return path
    known = [one.stem for one in SERVICES.glob("*.thrift")]
    if path.name not in known:
        hint = did_you_mean(path.name, known)
        raise IdlError(f"there is no file, and no interface file of RTF, with this name{hint}", Location(str(path)))
    return SERVICES / f"{path}.thrift"


def load(path: str | Path, folders: Sequence[str | Path] = ()) -> Any:
    """Return a module with the classes of an interface file: ``load("adder.thrift").Adder``.

    The client of a service ``Adder`` is ``AdderClient``. Any: the names are those of the file. Raises as :func:`read`.
    """
    from rtf.idl.python import python_module

    return python_module(read(path, folders))


def native(name: str) -> NativeType:
    """Return the type of a class of YARP, such as ``yarp::sig::Vector``."""
    from rtf.idl.natives import native as found

    return found(name)


def default_of(name: str) -> Any:
    """Return an empty value of a class of YARP."""
    from rtf.idl.natives import default_of as found

    return found(name)
