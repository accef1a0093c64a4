"""What is asked of the tip of a chain: a position, a pose, or that it looks at a point."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.errors import RefusedError
from rtf.robot.kinematics.poses import POSITION, checked_pose, homogeneous, pose_error, pose_of, skew

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

#: To compare postures, a radian counts as these metres.
_ARM = 0.3
#: A point that is nearer (m) than this has no direction.
_NEAREST = 1e-6


@dataclass(frozen=True, slots=True)
class LookAt:
    """A target that is a direction: the z axis of the tip points to a point (m), as a camera does that looks at it."""

    point: ArrayLike


class Goal(ABC):
    """What is asked of the pose of a tip: errors, weighted by ``scale``, which are to be 0."""

    scale: NDArray[np.float64]

    @abstractmethod
    def error(self, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what is left from a pose to the target (m, rad)."""

    @abstractmethod
    def jacobian(self, pose: NDArray[np.float64], jacobian: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how much of the error each joint takes away, by the Jacobian of the tip."""

    @abstractmethod
    def missed(self, pose: NDArray[np.float64]) -> tuple[float, float]:
        """Return the errors of a pose (m, deg)."""

    @abstractmethod
    def distances(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how far many poses are from the target, to compare them."""


class _PoseGoal(Goal):
    def __init__(self, pose: NDArray[np.float64], scale: NDArray[np.float64]) -> None:
        self.pose, self.scale = pose, scale

    def error(self, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """See Goal."""
        if self.scale.size == POSITION:
            position: NDArray[np.float64] = self.pose[:3, 3] - pose[:3, 3]
            return position
        return pose_error(self.pose, pose)

    def jacobian(self, pose: NDArray[np.float64], jacobian: NDArray[np.float64]) -> NDArray[np.float64]:
        """See Goal."""
        del pose
        return jacobian[: self.scale.size]

    def missed(self, pose: NDArray[np.float64]) -> tuple[float, float]:
        """See Goal."""
        error = self.error(pose)
        return float(np.linalg.norm(error[:3])), math.degrees(float(np.linalg.norm(error[3:])))

    def distances(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """See Goal."""
        distances: NDArray[np.float64] = np.linalg.norm(poses[:, :3, 3] - self.pose[:3, 3], axis=1)
        if self.scale.size > POSITION:
            cosines = (np.einsum("nij,ij->n", poses[:, :3, :3], self.pose[:3, :3]) - 1.0) / 2.0
            distances = distances + _ARM * np.arccos(np.clip(cosines, -1.0, 1.0))
        return distances


class _AxisGoal(Goal):
    def __init__(self, point: NDArray[np.float64], weight: float) -> None:
        self.point, self.scale = point, np.full(3, weight)

    def error(self, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """See Goal: the rotation that turns the axis to the point."""
        axis, (direction, _) = pose[:3, 2], self._way(pose)
        cross = np.cross(axis, direction)
        sine = float(np.linalg.norm(cross))
        angle = math.atan2(sine, float(axis @ direction))
        turn: NDArray[np.float64] = (cross / sine if sine else pose[:3, 0]) * angle
        return turn

    def jacobian(self, pose: NDArray[np.float64], jacobian: NDArray[np.float64]) -> NDArray[np.float64]:
        """See Goal: turns across the axis, and those of the direction as the tip moves."""
        axis, (direction, distance) = pose[:3, 2], self._way(pose)
        across = jacobian[3:] - np.outer(axis, axis @ jacobian[3:])
        turns: NDArray[np.float64] = across + skew(direction) @ jacobian[:3] / distance
        return turns

    def missed(self, pose: NDArray[np.float64]) -> tuple[float, float]:
        """See Goal."""
        return 0.0, math.degrees(float(np.linalg.norm(self.error(pose))))

    def distances(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """See Goal."""
        ways = self.point - poses[:, :3, 3]
        lengths = np.maximum(np.linalg.norm(ways, axis=1), _NEAREST)
        distances: NDArray[np.float64] = -np.einsum("ni,ni->n", ways, poses[:, :3, 2]) / lengths
        return distances

    def _way(self, pose: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
        way = self.point - pose[:3, 3]
        distance = max(float(np.linalg.norm(way)), _NEAREST)
        return way / distance, distance


def goal_of(target: ArrayLike | LookAt, metre: float, radian: float) -> Goal:
    """Return what a target asks for, with the weights of a metre and a radian. Raises RefusedError for none."""
    if isinstance(target, LookAt):
        return _AxisGoal(_position(target.point), radian)
    values = np.asarray(target, dtype=np.float64)
    if values.shape == (POSITION,):
        return _PoseGoal(homogeneous(np.eye(3), _position(values)), np.full(3, metre))
    pose = pose_of(values) if values.ndim == 1 else checked_pose(values)
    return _PoseGoal(pose, np.repeat([metre, radian], 3))


def _position(values: ArrayLike) -> NDArray[np.float64]:
    point = np.asarray(values, dtype=np.float64)
    if point.shape != (POSITION,) or not np.isfinite(point).all():
        raise RefusedError(f"a position is three numbers, not {point.tolist()}")
    return point
