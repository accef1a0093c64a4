"""The variables of configuration files: ``$name``, ``${name}`` and ``$(name)``."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from rtf.bottle import Property, to_string
from rtf.resources.errors import ResourceLimitError

if TYPE_CHECKING:
    from collections.abc import Mapping

_VARIABLE = re.compile(r"\\.|\$([({]*)((?:[A-Za-z0-9_]|\\.)*)([)}]?)", re.DOTALL)


class Variables:
    """Looks up names in the environment, then in the given variables, then in the keys already read.

    A source with an empty value is skipped. ``__YARP__`` is 1 unless it is defined.
    """

    __slots__ = ("_environment", "_given")

    def __init__(self, environment: Mapping[str, str], given: Property) -> None:
        self._environment = environment
        self._given = given

    def value(self, name: str, read: Property) -> str | None:
        """Return the value of ``name``; ``None`` if it is not defined."""
        value = self._environment.get(name)
        for source in (self._given, read):
            if not value and source.check(name):
                value = to_string(source.find(name))
        if not value and name == "__YARP__":
            value = "1"
        return value

    def expand(self, text: str, read: Property, limit: int) -> tuple[str, list[str]]:
        """Replace the variables in ``text``; return it with the names of undefined ones, which become empty.

        A backslash escapes the next character. Backslashes in values are doubled, so that parsing the line restores
        them. Values are not expanded again. More than ``limit`` characters raise :class:`ResourceLimitError`.
        """
        if "$" not in text:
            return text, []
        undefined: list[str] = []
        room = limit

        def replace(match: re.Match[str]) -> str:
            nonlocal room
            if match[1] is None:
                return match[0]
            name = match[2].replace("\\", "")
            value = self.value(name, read)
            if value is None:
                undefined.append(name)
            value = (value or "").replace("\\", "\\\\") + ("" if match[1] else match[3])
            room -= len(value)
            if room < 0:
                raise ResourceLimitError(f"${name} makes the text longer than {limit} characters")
            return value

        return _VARIABLE.sub(replace, text), undefined
