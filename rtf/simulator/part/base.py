"""Base class of a part's interfaces: its axes, and the way of commands to the boards."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.device import Device
from rtf.robot.interfaces import selected, values_for

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rtf.bottle import Property
    from rtf.robot.control_modes import ControlMode
    from rtf.robot.interfaces import AxisSelection, FloatArray, Values
    from rtf.robot.model import RobotModel
    from rtf.simulator.boards import Boards
    from rtf.simulator.fair_lock import FairLock


class PartBase(Device):
    """Some neighbouring axes of the boards. Reading takes no lock; commands take it, between two steps."""

    def __init__(self, part: str, boards: Boards, lock: FairLock) -> None:
        super().__init__(part)
        self.part = part
        self.boards = boards
        self.lock = lock
        self._choose(boards.plant.robot)

    def _choose(self, robot: RobotModel) -> None:
        """Find the part among the robot's axes. Raises RefusedError for a part that it does not have."""
        self.description = robot.part(self.part)
        self.own = robot.part_slice(self.part)
        self.size = len(self.description.axes)

    def open(self, configuration: Property) -> None:
        """Do nothing: the part lives as long as the simulation."""

    def close(self) -> None:
        """Do nothing: there are no resources."""

    def axes(self) -> int:
        return self.size

    def _places(self, joints: AxisSelection, what: str = "joint") -> NDArray[np.intp]:
        """Return the indices of the chosen joints among all axes."""
        if joints is None:
            return np.arange(self.own.start, self.own.stop)
        if type(joints) is int:
            return np.array((self._axis(joints, what),), dtype=np.intp)
        places: NDArray[np.intp] = np.array(selected(self.size, joints, what), dtype=np.intp) + self.own.start
        return places

    def _read(self, values: FloatArray, joints: AxisSelection, what: str = "joint") -> FloatArray:
        """Return a copy of the values of the chosen joints."""
        return values[self.own].copy() if joints is None else values[self._places(joints, what)]

    def _axis(self, joint: int, what: str = "joint") -> int:
        if type(joint) is int and 0 <= joint < self.size:  # a fast path, as it is called often
            return joint + int(self.own.start)
        return selected(self.size, joint, what)[0] + int(self.own.start)

    def _write(self, values: Values, joints: AxisSelection, into: FloatArray, what: str = "joint") -> None:
        """Set the values of the chosen joints."""
        axes = self._places(joints, what)
        with self.lock:
            into[axes] = values_for(len(axes), values)

    def _command(
        self,
        what: str,
        values: Values,
        joints: AxisSelection,
        modes: frozenset[ControlMode],
        execute: Callable[[NDArray[np.intp], FloatArray], None],
    ) -> None:
        """Pass a command to those of the chosen axes that are in a mode which accepts it."""
        axes = self._places(joints)
        given = values_for(len(axes), values)
        with self.lock:
            taken = self.boards.accept(what, axes.tolist(), modes)
            if taken:
                execute(axes[taken], given[taken])
