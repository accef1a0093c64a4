"""Axes: the selection of joints, the values for them, and the information about them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from enum import IntEnum
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rtf.bottle import Vocab
from rtf.robot.errors import RefusedError

FloatArray: TypeAlias = NDArray[np.float64]
#: The selection of axes. None: all; a number: one; a sequence: these, in its order.
AxisSelection: TypeAlias = int | Sequence[int] | None
#: One value for each selected axis; a single number for a single axis.
Values: TypeAlias = float | Sequence[float] | FloatArray


class JointType(IntEnum):
    """The type of a joint; the value is the packed word that is sent."""

    REVOLUTE = Vocab("atrv").value
    PRISMATIC = Vocab("atpr").value
    UNKNOWN = Vocab("unkn").value


class IAxisInfo(ABC):
    """The number of axes, their names and types."""

    @abstractmethod
    def axes(self) -> int:
        """Return the number of joints."""

    @abstractmethod
    def axis_name(self, joint: int) -> str:
        """Return the name of a joint, such as ``l_elbow``."""

    @abstractmethod
    def joint_type(self, joint: int) -> JointType:
        """Return whether a joint is revolute or prismatic."""

    def axis_names(self) -> tuple[str, ...]:
        """Return the names of all joints in order."""
        return tuple(self.axis_name(joint) for joint in range(self.axes()))


def selected(axes: int, chosen: AxisSelection, what: str = "joint") -> list[int]:
    """Return the numbers of selected axes out of ``axes``. Raises RefusedError, naming one that does not exist."""
    if chosen is None:
        return list(range(axes))
    numbers = [chosen] if isinstance(chosen, (int, np.integer)) else [int(number) for number in chosen]
    for number in numbers:
        if not 0 <= number < axes:
            raise RefusedError(f"there is no {what} {number}; they are numbered from 0 to {axes - 1}")
    return [int(number) for number in numbers]


def values_for(count: int, values: Values) -> FloatArray:
    """Return values as an array of ``count``. Raises RefusedError for another number, and unless all are finite."""
    given = np.atleast_1d(np.asarray(values, dtype=np.float64))
    if given.shape != (count,):
        raise RefusedError(f"{count} values are needed, not {given.size}")
    if not np.isfinite(given).all():
        raise RefusedError(f"{given.tolist()} are not all finite numbers")
    return given
