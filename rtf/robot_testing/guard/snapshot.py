"""Snapshot of a part: the state and the settings that a test may change, for restoring them afterwards."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.errors import NotSupportedError, RefusedError
from rtf.robot.interfaces import JointType, Pid, PidType

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from rtf.robot.boards.client import RemoteBoard
    from rtf.robot.interfaces import FloatArray

_T = TypeVar("_T")


@dataclass(slots=True)
class Snapshot:
    """The state and settings that a test may change. Unsupported ones are an empty list, or None for a joint."""

    positions: FloatArray
    modes: tuple[ControlMode, ...]
    interactions: tuple[InteractionMode, ...] = ()
    speeds: FloatArray | None = None
    accelerations: FloatArray | None = None
    limits: list[tuple[float, float]] = field(default_factory=list)
    max_currents: list[float | None] = field(default_factory=list)
    pids: list[Pid | None] = field(default_factory=list)
    impedances: list[tuple[float, float] | None] = field(default_factory=list)

    @classmethod
    def take(cls, board: RemoteBoard) -> Snapshot:
        """Read everything from a board. Raises RobotError if it does not even report positions and modes."""
        joints = range(board.axes())
        pids = answered(partial(board.pids, PidType.POSITION))
        return cls(
            positions=board.encoders(),
            modes=board.control_modes(),
            interactions=answered(board.interaction_modes) or (),
            speeds=answered(board.reference_speeds),
            accelerations=answered(board.reference_accelerations),
            limits=answered(lambda: [board.limits(joint) for joint in joints]) or [],
            max_currents=[answered(partial(board.max_current, joint)) for joint in joints],
            pids=[answered(partial(board.pid, PidType.POSITION, j)) for j in joints] if pids is None else [*pids],
            impedances=[answered(partial(board.impedance, joint)) for joint in joints],
        )

    def to_record(self) -> dict[str, Any]:
        """Return a JSON-compatible representation."""
        return {
            "positions": self.positions.tolist(),
            "modes": [int(mode) for mode in self.modes],
            "interactions": [int(mode) for mode in self.interactions],
            "speeds": None if self.speeds is None else self.speeds.tolist(),
            "accelerations": None if self.accelerations is None else self.accelerations.tolist(),
            "limits": self.limits,
            "max_currents": self.max_currents,
            "pids": self.pids,
            "impedances": self.impedances,
        }

    @classmethod
    def from_record(cls, record: Mapping[str, Any]) -> Snapshot:
        """Return the snapshot of a ``to_record`` result. Raises KeyError, TypeError or ValueError for anything else."""
        speeds, accelerations = record["speeds"], record["accelerations"]
        return cls(
            positions=np.array(record["positions"], dtype=np.float64),
            modes=tuple(ControlMode(number) for number in record["modes"]),
            interactions=tuple(InteractionMode(number) for number in record["interactions"]),
            speeds=None if speeds is None else np.array(speeds, dtype=np.float64),
            accelerations=None if accelerations is None else np.array(accelerations, dtype=np.float64),
            limits=[(low, high) for low, high in record["limits"]],
            max_currents=list(record["max_currents"]),
            pids=[None if gains is None else Pid(*gains) for gains in record["pids"]],
            impedances=[None if pair is None else (pair[0], pair[1]) for pair in record["impedances"]],
        )


def answered(request: Callable[[], _T]) -> _T | None:
    """Return the answer of a board, or None if it does not support the request.

    Over the network an unsupported request is also answered by a refusal.
    """
    try:
        return request()
    except (NotSupportedError, RefusedError):
        return None


def sliding_joints(board: RemoteBoard) -> frozenset[int]:
    """Return the prismatic joints, by their board; joints of unknown type count as revolute."""
    return frozenset(
        joint for joint in range(board.axes()) if answered(partial(board.joint_type, joint)) is JointType.PRISMATIC
    )
