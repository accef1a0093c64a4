"""Base class of a control board's interfaces: its axes among those of the motor board, and commands to them."""

from __future__ import annotations

import math
from abc import abstractmethod
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.device import Device
from rtf.robot.errors import StaleStateError
from rtf.robot.interfaces import selected, values_for

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from rtf.robot.control_modes import ControlMode
    from rtf.robot.devices.motor_board import MotorBoard
    from rtf.robot.extended_state import Field
    from rtf.robot.interfaces import AxisSelection, FloatArray, Values


#: A state of so many periods is never too old.
_PERIODS = 10


class BoardBase(Device):
    """Some neighbouring axes of a motor board, ``own``. Reading takes no lock; commands take it, between two cycles."""

    own: slice = slice(0, 0)
    size: int = 0

    @property
    @abstractmethod
    def board(self) -> MotorBoard:
        """The motor board. Raises DeviceError while there is none."""

    def axes(self) -> int:
        return self.size

    def _chosen(self, joints: AxisSelection) -> list[int]:
        return selected(self.size, joints)

    def _places(self, joints: AxisSelection, what: str = "joint") -> NDArray[np.intp]:
        """Return the columns of the chosen joints among all axes."""
        if joints is None:
            return np.arange(self.own.start, self.own.stop)
        if type(joints) is int:
            return np.array((self._axis(joints, what),), dtype=np.intp)
        places: NDArray[np.intp] = np.array(selected(self.size, joints, what), dtype=np.intp) + self.own.start
        return places

    def _axis(self, joint: int, what: str = "joint") -> int:
        if type(joint) is int and 0 <= joint < self.size:  # a fast path, as it is called often
            return joint + int(self.own.start)
        return selected(self.size, joint, what)[0] + int(self.own.start)

    def _update(self) -> None:
        """Bring the state up to date. Raises StaleStateError if the hardware has not answered for some periods."""
        self.board.update()
        driver = self.board.driver
        if driver.period is not None:
            age = driver.time() - self.board.read_at
            if age > max(_PERIODS * driver.period, driver.max_age):
                since = f"has not answered for {age:.2g} s" if math.isfinite(age) else "does not answer"
                raise StaleStateError(f"{self.name}: the hardware {since}")

    @contextmanager
    def _between_cycles(self) -> Iterator[MotorBoard]:
        """Hold the lock of the motor board, whose state is up to date."""
        with self.board.lock:
            self.board.update()
            yield self.board

    # Values of axes: ``what`` is joint or motor, for messages -----------------------------------------------------

    def _read(self, values: FloatArray, joints: AxisSelection, what: str = "joint") -> FloatArray:
        """Return a copy of the values of the chosen joints."""
        return values[self.own].copy() if joints is None else values[self._places(joints, what)]

    def _measured(self, field: Field, joints: AxisSelection, what: str = "joint") -> FloatArray:
        """Return the measurements of the chosen joints."""
        places = None if joints is None else self._places(joints, what)
        self._update()
        values = self.board.measured(field)
        return values[self.own].copy() if places is None else values[places]

    def _setting(self, values: FloatArray, joint: int, what: str = "joint") -> float:
        return float(values[self._axis(joint, what)])

    def _write(self, values: Values, joints: AxisSelection, into: FloatArray, what: str = "joint") -> None:
        """Set the values of the chosen joints, and apply them."""
        axes = self._places(joints, what)
        given = values_for(len(axes), values)
        with self.board.lock:
            into[axes] = given
            for axis in axes.tolist():
                self.board.driver.configure(axis)

    def _command(
        self,
        what: str,
        values: Values,
        joints: AxisSelection,
        modes: frozenset[ControlMode],
        execute: Callable[[NDArray[np.intp], FloatArray], None],
    ) -> None:
        """Pass a command to those of the chosen axes that are in a mode which accepts it."""
        axes = self._places(joints, "motor" if what in ("current", "duty") else "joint")
        given = values_for(len(axes), values)
        board = self.board
        with board.lock:  # not by _between_cycles, as it is called often
            board.update()
            taken = board.accept(what, axes.tolist(), modes)
            if taken:
                execute(axes[taken], given[taken])
