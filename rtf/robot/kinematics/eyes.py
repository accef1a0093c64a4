"""Two eyes on a head: where they look together, and what angles and points belong to each other.

Positions are those of a gaze controller: the joints of torso and neck in the order of the chain, then tilt, version and
vergence of the eyes (deg). The left eye turns by the version plus half the vergence, the right one minus half of it.
An eye looks along its z axis; x is to the robot's right, y is down. Angles are azimuth (to the right), elevation (up)
and vergence (deg), seen from the middle of the eyes.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.errors import RefusedError
from rtf.robot.kinematics.poses import rotation_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from rtf.robot.kinematics.chain import Chain

#: Joints of both eyes: tilt, version, vergence.
EYE_JOINTS = 3
#: 1 minus the cosine between the axes of eyes below which they look at no point.
_PARALLEL = 1e-12
#: Steps (deg) in which the smallest vergence is sought, and the largest that is tried.
_STEP, _LARGEST = 0.5, 90.0


class Eyes:
    """Chains of a left and a right eye, which have tilt and pan as their last joints, and of the middle between them.

    Poses of cameras that were calibrated are tips of the chains (:meth:`Chain.with_tip`). ``smallest`` is the smallest
    vergence (deg) that the joint can have. Methods raise RefusedError for positions of another number.
    """

    def __init__(self, left: Chain, right: Chain, head: Chain, smallest: float = 0.0) -> None:
        if not len(left) == len(right) == len(head) + 2:
            raise RefusedError(
                f"eyes have two joints more than the head ({', '.join(head.joints)}), "
                f"not {', '.join(left.joints)} and {', '.join(right.joints)}"
            )
        self.left, self.right, self.head = left, right, head
        #: The pose of the middle of the eyes with all joints at 0: azimuth and elevation are seen from there.
        self.centre = head.pose(np.zeros(len(head)))
        left_eye, right_eye = self.poses(np.zeros(len(self)))
        #: Half the distance of the eyes (m).
        self.half_baseline = float(np.linalg.norm(left_eye[:3, 3] - right_eye[:3, 3])) / 2.0
        #: The smallest vergence (deg) with which they look at a point in front.
        self.smallest = self._smallest(smallest)

    def __len__(self) -> int:
        return len(self.head) + EYE_JOINTS

    def poses(self, positions: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the poses of the left and the right eye (4, 4)."""
        left, right = self._by_eye(positions)
        return self.left.pose(left), self.right.pose(right)

    def head_pose(self, positions: ArrayLike) -> NDArray[np.float64]:
        """Return the pose of the middle of the eyes, as they look straight ahead (4, 4)."""
        return self.head.pose(self._checked(positions)[: len(self.head)])

    def fixation_point(self, positions: ArrayLike) -> NDArray[np.float64]:
        """Return the point (m) where the axes of the eyes come nearest to each other.

        Raises RefusedError where they are parallel.
        """
        left, right = self.poses(positions)
        (begin, along), (other, across) = ((pose[:3, 3], pose[:3, 2]) for pose in (left, right))
        cosine = float(along @ across)
        if 1.0 - abs(cosine) < _PARALLEL:
            raise RefusedError("the axes of the eyes are parallel: they look at no point")
        apart = begin - other
        first = (along - cosine * across) @ apart / (cosine**2 - 1.0)
        second = (cosine * along - across) @ apart / (cosine**2 - 1.0)
        point: NDArray[np.float64] = (begin + first * along + other + second * across) / 2.0
        return point

    def fixation_jacobian(self, positions: ArrayLike) -> NDArray[np.float64]:
        """Return how the fixation point moves with each position, m/rad (3, joints)."""
        left, right = self._by_eye(positions)
        (pose, turns), (other, others) = self.left.pose_and_jacobian(left), self.right.pose_and_jacobian(right)
        z, w = pose[:3, 2], other[:3, 2]
        p, dz = _by_positions(turns, z, 0.5)
        r, dw = _by_positions(others, w, -0.5)
        c, dc = float(z @ w), w @ dz + z @ dw
        if 1.0 - abs(c) < _PARALLEL:
            raise RefusedError("the axes of the eyes are parallel: they look at no point")
        d, dd, below = pose[:3, 3] - other[:3, 3], p - r, c**2 - 1.0
        first = (z - c * w) @ d / below
        second = (c * z - w) @ d / below
        dfirst = (d @ (dz - np.outer(w, dc) - c * dw) + (z - c * w) @ dd - 2.0 * c * first * dc) / below
        dsecond = (d @ (np.outer(z, dc) + c * dz - dw) + (c * z - w) @ dd - 2.0 * c * second * dc) / below
        moves = p + np.outer(z, dfirst) + first * dz + r + np.outer(w, dsecond) + second * dw
        jacobian: NDArray[np.float64] = moves / 2.0
        return jacobian

    def angles_of(self, point: ArrayLike) -> NDArray[np.float64]:
        """Return azimuth, elevation and vergence (deg) at which a point (m) is.

        The elevation is that of the point's shadow straight ahead, as the original controller computes it. So beside
        the middle it is greater than the elevation that :meth:`point_of` turns by: ``tan`` of it is divided by ``cos``
        of the azimuth.
        """
        x, y, z = self.centre[:3, :3].T @ (np.asarray(point, dtype=np.float64) - self.centre[:3, 3])
        away = math.sqrt(x * x + y * y + z * z)
        angles = (math.atan2(x, z), -math.atan2(y, abs(z)), 2.0 * math.atan2(self.half_baseline, away))
        return np.degrees(angles)

    def point_of(self, angles: ArrayLike, positions: ArrayLike | None = None) -> NDArray[np.float64]:
        """Return the point (m) at azimuth, elevation and vergence (deg).

        With positions, the angles are relative to where head and eyes look with these.
        """
        azimuth, elevation, vergence = (float(value) for value in np.asarray(angles, dtype=np.float64))
        base = np.zeros(len(self)) if positions is None else self._checked(positions).copy()
        base[-1] = max(base[-1] + vergence, self.smallest)
        pose = self.centre if positions is None else self.head_pose(base)
        ahead = pose[:3, :3].T @ (self.fixation_point(base) - pose[:3, 3])
        turned = rotation_of((0.0, 1.0, 0.0), math.radians(azimuth)) @ rotation_of(
            (1.0, 0.0, 0.0), math.radians(elevation)
        )
        point: NDArray[np.float64] = pose[:3, :3] @ (turned @ ahead) + pose[:3, 3]
        return point

    def distance(self, vergence: float) -> float:
        """Return how far (m) a point straight ahead is from an eye, by the vergence (deg)."""
        return self.half_baseline / math.sin(math.radians(max(vergence, self.smallest)) / 2.0)

    def _checked(self, positions: ArrayLike) -> NDArray[np.float64]:
        values = np.asarray(positions, dtype=np.float64)
        if values.shape != (len(self),) or not np.isfinite(values).all():
            names = ", ".join([*self.head.joints, "tilt", "version", "vergence"])
            raise RefusedError(f"head and eyes have {len(self)} positions ({names}), not {positions!r}")
        return values

    def _by_eye(self, positions: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        values = self._checked(positions)
        (*shared, version), vergence = values[:-1], values[-1]
        return np.array([*shared, version + vergence / 2.0]), np.array([*shared, version - vergence / 2.0])

    def _smallest(self, lowest: float) -> float:
        """Seek the smallest vergence from the lowest on with which the point is in front."""
        self.smallest = vergence = lowest
        while vergence < _LARGEST:
            try:
                ahead = self.fixation_point([*np.zeros(len(self) - 1), vergence]) - self.centre[:3, 3]
            except RefusedError:  # parallel
                ahead = np.zeros(3)
            if ahead @ self.centre[:3, 2] > 0.0:
                return vergence
            vergence += _STEP
        raise RefusedError(f"{self.left.name} and {self.right.name}: with no vergence they look at a point in front")


def _by_positions(
    jacobian: NDArray[np.float64], axis: NDArray[np.float64], share: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return how origin and axis of an eye move with the positions; ``share`` is that of the vergence in its pan."""
    whole = np.hstack([jacobian, share * jacobian[:, -1:]])
    return whole[:3], np.cross(whole[3:].T, axis).T
