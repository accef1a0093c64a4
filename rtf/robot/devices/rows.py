"""Lists of a configuration with a number for each joint, as iCub files have them: ``key 1 2 3`` or ``key (1 2 3)``."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.bottle import Bottle, Property, Value, as_float, to_string
from rtf.robot.errors import ConfigurationError
from rtf.robot.parameters import group_of, wrong

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray


class Rows:
    """The lists of a group, or of the configuration itself. Names are case-insensitive.

    Errors are ConfigurationErrors with the location.
    """

    def __init__(self, configuration: Property, name: str | None, joints: int) -> None:
        self._configuration = configuration
        self._name = name
        self._joints = joints
        self._lists: dict[str, tuple[str, list[Value]]] = {}
        for key, group in (configuration if name is None else group_of(configuration, name)).items():
            inner = group.get(1)
            self._lists[key.lower()] = key, list(inner if isinstance(inner, Bottle) else group[1:])

    def values(self, *names: str) -> list[Value] | None:
        """Return the values of the list with one of these names, of any number and type; None without one."""
        found = next((self._lists[name.lower()] for name in names if name.lower() in self._lists), None)
        return None if found is None else found[1]

    def row(self, *names: str, default: float | None = None, single: bool = False) -> FloatArray:
        """Return the list with one of these names; without one the default for each joint.

        ``single``: one number may stand for all joints.
        """
        found = next((self._lists[name.lower()] for name in names if name.lower() in self._lists), None)
        if found is None:
            if default is None:
                raise self.wrong(names[0], f"it is missing; it has {self._joints} numbers, one for each joint")
            return np.full(self._joints, default)
        key, values = found
        given = values * self._joints if single and len(values) == 1 else values
        if len(given) != self._joints or not all(isinstance(value, int | float) for value in given):
            said = to_string(Bottle(values))[:60]
            raise self.wrong(key, f"{said} is not a list of {self._joints} numbers, one for each joint")
        numbers = np.array([as_float(value) for value in given])
        if not np.isfinite(numbers).all():
            raise self.wrong(key, "a number is infinite or NaN")
        return numbers

    def positive(self, *names: str, default: float | None = None) -> FloatArray:
        """Return the list with one of these names, whose numbers must not be negative."""
        numbers = self.row(*names, default=default)
        if (numbers < 0).any():
            raise self.wrong(names[0], f"joint {int((numbers < 0).argmax())} has a negative number")
        return numbers

    def scale(self, *names: str, default: float) -> FloatArray:
        """Return the list with one of these names, or one number for all joints; none of them is 0."""
        numbers = self.row(*names, default=default, single=True)
        if not numbers.all():
            raise self.wrong(names[0], f"the value of joint {int((numbers == 0).argmax())} is 0, and cannot be a scale")
        return numbers

    def wrong(self, key: str, sentence: str) -> ConfigurationError:
        """Return the error about a list."""
        if self._name is None:
            return wrong(self._configuration, key, sentence)
        return wrong_in(self._configuration, self._name, key, sentence)


def wrong_in(configuration: Property, group: str, key: str, sentence: str) -> ConfigurationError:
    """Return the error, with the location of the list, or of its group."""
    location = (configuration.location(group, key) if key else None) or configuration.location(group)
    what = f"{group} {key}".rstrip()
    return ConfigurationError(f"{what}: {sentence}" if location is None else f"{location}: {what}: {sentence}")
