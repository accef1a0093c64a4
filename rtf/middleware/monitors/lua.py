"""Monitors in Lua: scripts as YARP's ``portmonitor`` runs them, without access to files, programs or Python.

A script defines functions in the table ``PortMonitor``, and has the classes Bottle, Property and Vector in ``yarp``.
Instructions of a call and the memory of a script are limited.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rtf.bottle import Bottle, Property
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.monitors.lua_values import (
    LuaBottle,
    LuaObject,
    LuaProperty,
    LuaThings,
    LuaValue,
    LuaVector,
    property_of,
    result_of,
)
from rtf.middleware.monitors.monitor import PortMonitor

if TYPE_CHECKING:
    from rtf.middleware.monitors.monitor import MonitoredMessage

#: The interpreters of lupa, best first; LuaJIT's compiled loops could not be stopped.
_INTERPRETERS = ("lua54", "lua55", "lua53")
#: The most memory of a script, in bytes, and instructions of a call.
MEMORY, INSTRUCTIONS = 32 << 20, 2_000_000
_PRELUDE = Path(__file__).with_name("prelude.lua")
_LARGEST = 1 << 20


class LuaError(MiddlewareError, RuntimeError):
    """An error of a script; the message begins with its line."""


class LuaMonitor(PortMonitor):
    """The monitor that a script defines. Raises LuaError for one that cannot be loaded."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        lua = _interpreter()(
            register_eval=False,
            register_builtins=False,
            unpack_returned_tuples=True,
            attribute_filter=_opened,
            max_memory=MEMORY,
        )
        with path.open(encoding="utf-8") as file:
            code = file.read(_LARGEST)
        host = lua.table_from({"monitor": lua.table_from(self._functions()), "yarp": lua.table_from(_CLASSES)})
        done, found, *rest = lua.eval("load")(_PRELUDE.read_text(), "=[rtf]", "t")(
            host, f"={path.name}", code, INSTRUCTIONS
        )
        if not done:
            raise LuaError(str(found))
        self._has, self._invoke = found, rest[0]

    def _functions(self) -> dict[str, Any]:
        return {
            "setEvent": lambda name, lifetime=None: self.set_event(str(name), lifetime),
            "unsetEvent": lambda name: self.unset_event(str(name)),
            "setConstraint": lambda text: setattr(self, "constraint", str(text)),
            "getConstraint": lambda: self.constraint,
            "setTrigInterval": lambda seconds: setattr(self, "trig_interval", float(seconds)),
        }

    def _call(self, name: str, *arguments: object) -> Any:
        """Call a function of the script; None if it has none of the name. Raises LuaError."""
        if not self._has(name):
            return None
        done, found = self._invoke(name, *arguments)
        if not done:
            raise LuaError(str(found))
        return found

    def create(self, info: Property) -> bool:
        return self._call("create", LuaProperty(info)) is not False

    def destroy(self) -> None:
        self._call("destroy")

    def accept(self, message: MonitoredMessage) -> bool:
        return self._call("accept", LuaThings(message)) is not False

    def update(self, message: MonitoredMessage) -> object:
        return self._changed("update", message)

    def update_reply(self, reply: MonitoredMessage) -> object:
        return self._changed("update_reply", reply)

    def _changed(self, name: str, message: MonitoredMessage) -> object:
        found = self._call(name, LuaThings(message))
        changed = result_of(found) if isinstance(found, LuaThings) else None
        return message if changed is None else changed

    def trig(self) -> None:
        self._call("trig")

    def setparam(self, settings: Bottle) -> None:
        self._call("setparam", LuaProperty(Property.from_bottle(settings)))

    def getparam(self) -> Property:
        found = self._call("getparam")
        return property_of(found) if isinstance(found, LuaProperty) else Property()


_CLASSES = {"Bottle": LuaBottle, "Property": LuaProperty, "Value": LuaValue, "Vector": LuaVector, "Things": LuaThings}


def _interpreter() -> Any:  # lupa has no types
    for name in _INTERPRETERS:
        try:
            return import_module(f"lupa.{name}").LuaRuntime
        except ImportError:
            continue
    raise LuaError("port monitors in Lua need the package lupa: pip install 'rtf[lua]'")


def _opened(found: object, name: object, setting: bool) -> object:
    """Return which attribute of an object Lua may use. Raises AttributeError."""
    if setting or not isinstance(found, LuaObject) or not isinstance(name, str) or name.startswith("_"):
        raise AttributeError(f"{name} is closed to scripts")
    return name
