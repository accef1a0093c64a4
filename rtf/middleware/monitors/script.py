"""Scripts of monitors: found by name in contexts, in Python or Lua.

A peer may ask for a connection with a script, so the name of a script is a name: no path, and no folder above.
"""

from __future__ import annotations

import re
import runpy
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Property, as_string, to_string
from rtf.errors import RtfError
from rtf.middleware.errors import ConnectError
from rtf.middleware.monitors.monitor import PortMonitor
from rtf.resources import ResourceFinder

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.bottle import Value

_SHIPPED = Path(__file__).parent / "scripts"
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_\-]*(\.(lua|py))?")
_SUFFIXES = {"lua": ".lua", "py": ".py"}
_WORDS = ("type", "file", "context", "constraint")
_KNOWN = (*_WORDS, "recv", "send", "ack")


@dataclass(frozen=True, slots=True)
class ScriptName:
    """What a connection says of its monitor: language, file, context and constraint, and what else it sets."""

    type: str
    file: str
    context: str = ""
    constraint: str = ""
    settings: Mapping[str, Value] = field(default_factory=dict)

    @classmethod
    def of(cls, found: Mapping[str, Bottle]) -> ScriptName:
        """Read the modifiers of a connection. Raises ConnectError."""
        words = {key: " ".join(map(to_string, found.get(key, Bottle()))) for key in _WORDS}
        settings = {
            key: values[0] if len(values) == 1 else values for key, values in found.items() if key not in _KNOWN
        }
        return cls._checked(cls(**words, settings=settings))

    @classmethod
    def of_property(cls, found: Property) -> ScriptName:
        """Read the argument of the admin command ``[atch]``, as in ``(type lua) (file limit)``. Raises ConnectError."""
        settings = {key: value for key in found if key not in _KNOWN and (value := found.find(key)) is not None}
        return cls._checked(cls(**{key: as_string(found.find(key)) for key in _WORDS}, settings=settings))

    @classmethod
    def _checked(cls, name: ScriptName) -> ScriptName:
        if name.type not in _SUFFIXES:
            raise ConnectError(f"a port monitor has the type lua or py, not {name.type or 'none'!r}")
        for part in filter(None, (name.file, name.context)):
            if not _NAME.fullmatch(part):
                raise ConnectError(f"{part!r} is not the name of a script or context: letters, digits, '_' and '-'")
        if not name.file:
            raise ConnectError("a port monitor has a file, as in type.lua+file.limit")
        return name

    def find(self) -> Path:
        """Return the file: in the context, else in the current folder and those of YARP, else shipped.

        Raises ConnectError.
        """
        suffix = _SUFFIXES[self.type]
        file = self.file if self.file.endswith(suffix) else f"{self.file}{suffix}"
        found = ResourceFinder(contexts=[self.context]).search(file).path or _SHIPPED / file
        if not found.is_file():
            where = f"the context {self.context}" if self.context else "the contexts"
            raise ConnectError(f"the port monitor {file} is neither in {where} nor among the shipped ones")
        return found

    def load(self) -> PortMonitor:
        """Return the monitor that the script defines. Raises ConnectError."""
        path = self.find()
        try:
            monitor = _lua(path) if self.type == "lua" else _python(path)
            if self.constraint:
                monitor.constraint = self.constraint
        except RtfError as error:
            raise ConnectError(f"the port monitor {path}: {error}") from None
        return monitor


def _lua(path: Path) -> PortMonitor:
    from rtf.middleware.monitors.lua import LuaMonitor

    return LuaMonitor(path)


def _python(path: Path) -> PortMonitor:
    try:
        found = runpy.run_path(str(path)).get("Monitor")
        made = found() if isinstance(found, type) and issubclass(found, PortMonitor) else None
    except RtfError:
        raise
    except (Exception, SystemExit) as error:  # of the script, whatever it is
        raise ConnectError(f"{type(error).__name__}: {error}") from error
    if made is None:
        raise ConnectError("it defines no class Monitor of PortMonitor")
    return made
