"""Axes: how joints are chosen, how values are given for them, and what a device says of them."""

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
#: None: all; a number: one; a sequence: these, in its order.
AxisSelection: TypeAlias = int | Sequence[int] | None
#: One value for each axis chosen; a single number for a single axis.
Values: TypeAlias = float | Sequence[float] | FloatArray


class JointType(IntEnum):
    """What an axis does; the value is the packed word that travels."""

    REVOLUTE = Vocab("atrv").value
    PRISMATIC = Vocab("atpr").value
    UNKNOWN = Vocab("unkn").value


class IAxisInfo(ABC):
    """How many axes there are, and what they are called."""

    @abstractmethod
    def axes(self) -> int:
        """How many joints the device has."""

    @abstractmethod
    def axis_name(self, joint: int) -> str:
        """The name of a joint, such as ``l_elbow``."""

    @abstractmethod
    def joint_type(self, joint: int) -> JointType:
        """Whether it turns or slides."""

    def axis_names(self) -> tuple[str, ...]:
        """The names of all joints in order."""
        return tuple(self.axis_name(joint) for joint in range(self.axes()))


def selected(axes: int, chosen: AxisSelection, what: str = "joint") -> list[int]:
    """The numbers of the axes chosen out of so many. Raises RefusedError, naming the one that does not exist."""
    if chosen is None:
        return list(range(axes))
    numbers = [chosen] if isinstance(chosen, (int, np.integer)) else [int(number) for number in chosen]
    for number in numbers:
        if not 0 <= number < axes:
            raise RefusedError(f"there is no {what} {number}; they go from 0 to {axes - 1}")
    return [int(number) for number in numbers]


def values_for(count: int, values: Values) -> FloatArray:
    """The values as an array of ``count``. Raises RefusedError for another number, and for what is not finite."""
    given = np.atleast_1d(np.asarray(values, dtype=np.float64))
    if given.shape != (count,):
        raise RefusedError(f"{count} values are needed, {given.size} were given")
    if not np.isfinite(given).all():
        raise RefusedError(f"{given.tolist()} are not all finite numbers")
    return given
