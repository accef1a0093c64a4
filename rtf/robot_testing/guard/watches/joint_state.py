"""The state of the joints of a part as the watches judge it, and the bounds of the robot's profile."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.errors import NotSupportedError, RefusedError
from rtf.robot.model.file import GuardTable
from rtf.robot_testing.slides import in_metres

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from rtf.robot.boards.client import RemoteBoard
    from rtf.robot.interfaces import FloatArray
    from rtf.robot.model import RobotModel

FULL = 100.0  # per cent of duty cycle


@dataclass(slots=True)
class JointState:
    """The joints of a part at one moment: arrays (joints,). NaN: not measured, or not asked for."""

    following: NDArray[np.bool_]  # its controller follows a position: it presses when the joint cannot
    torquing: NDArray[np.bool_]  # it is in torque mode
    commanded: NDArray[np.bool_]  # its output is what a test commands: a duty cycle or a current
    stiff: NDArray[np.bool_]  # a compliant joint is away from its target without pressing
    still: NDArray[np.bool_]  # it has not moved for a moment
    duties: FloatArray  # per cent
    resting: FloatArray  # the duty cycle with which it last rested at its target
    currents: FloatArray  # A
    errors: FloatArray  # setpoint minus position, deg

    @property
    def effort(self) -> FloatArray:
        """The output beyond that of the joint at rest: what presses, or overcomes friction (per cent)."""
        effort: FloatArray = np.abs(self.duties - self.resting)
        return effort


@dataclass(frozen=True, slots=True)
class JointBounds:
    """The bounds of the joints of a part: arrays (joints,), and the times and shares of the robot's profile."""

    nominal: FloatArray  # A, infinite if unknown
    peak: FloatArray  # A
    profile: GuardTable
    metres: tuple[float | None, ...]  # that stand for a degree of a prismatic joint; None of one that turns

    @classmethod
    def of(cls, board: RemoteBoard, names: Sequence[str], robot: RobotModel | None) -> JointBounds:
        """Return the bounds of a part: the currents of the robot's model, else those that its board reports."""
        count, profile = len(names), GuardTable() if robot is None else robot.guard
        if robot is not None and all(name in robot.index for name in names):
            axes = [robot.axis(name) for name in names]
            nominal = np.array([axis.nominal_current for axis in axes])
            peak = np.array([axis.peak_current for axis in axes])
        else:
            nominal, peak = _asked(board.nominal_current, count), _asked(board.peak_current, count)
        known = (nominal > 0) & (peak > nominal)
        metres = tuple(in_metres(board, joint) for joint in range(count))
        return cls(np.where(known, nominal, np.inf), np.where(known, peak, np.inf), profile, metres)


def _asked(request: Callable[[int], float], count: int) -> FloatArray:
    try:
        return np.array([request(motor) for motor in range(count)])
    except (NotSupportedError, RefusedError):
        return np.zeros(count)
