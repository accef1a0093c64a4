"""A chain of links from the root of a robot to a tip: its poses, its Jacobian and its limits, as immutable data.

Positions of joints are in degrees, or metres of slides, as everywhere at a robot; the Jacobian is per radian, or metre,
as the equations of controllers and solvers have it. Poses are those of :mod:`rtf.robot.kinematics.poses`, in the frame
of the root.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from rtf.errors import did_you_mean
from rtf.robot.errors import RefusedError
from rtf.robot.kinematics.poses import checked_pose, skew

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    from rtf.robot.model import Axis

Z_AXIS = (0.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Link:
    """A joint and the link that it moves."""

    joint: str
    minimum: float  # deg, or m
    maximum: float
    #: From the frame that the joint moves to that of the next joint (4, 4).
    frame: NDArray[np.float64]
    axis: tuple[float, float, float] = Z_AXIS  # of length 1
    prismatic: bool = False

    @property
    def internal(self) -> float:
        """Radians, or metres, a unit of its positions."""
        return 1.0 if self.prismatic else math.pi / 180.0


@dataclass(frozen=True, slots=True)
class LinearConstraint:
    """A sum of joints (deg, m) that stays between two values. It holds where all joints that it names are free."""

    name: str
    factors: Mapping[str, float]
    lower: float = -math.inf
    upper: float = math.inf


@dataclass(frozen=True, eq=False)
class Chain:
    """A chain. ``tip`` is what comes after the last link, such as a tool.

    All methods raise RefusedError for positions of another number than it has joints, or that are no numbers, and for
    joints that it does not have; the message says which it has.
    """

    name: str
    links: tuple[Link, ...]
    base: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    tip: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    constraints: tuple[LinearConstraint, ...] = ()

    # Data ------------------------------------------------------------------------------------------------------------

    def __len__(self) -> int:
        return len(self.links)

    @cached_property
    def joints(self) -> tuple[str, ...]:
        """The names of its joints, from the root."""
        return tuple(link.joint for link in self.links)

    @cached_property
    def minima(self) -> NDArray[np.float64]:
        """The lower limits (deg, m)."""
        return np.array([link.minimum for link in self.links], dtype=np.float64)

    @cached_property
    def maxima(self) -> NDArray[np.float64]:
        """The upper limits (deg, m)."""
        return np.array([link.maximum for link in self.links], dtype=np.float64)

    @cached_property
    def internal(self) -> NDArray[np.float64]:
        """Radians, or metres, a unit of each position."""
        return np.array([link.internal for link in self.links], dtype=np.float64)

    @cached_property
    def _turning(self) -> NDArray[np.bool_]:
        return np.array([not link.prismatic for link in self.links], dtype=np.bool_)

    @cached_property
    def _axes(self) -> NDArray[np.float64]:
        return np.array([link.axis for link in self.links], dtype=np.float64).reshape(-1, 3)

    @cached_property
    def _parts(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """What the motion of each link is a sum of, by 1, sine, cosine and position: four arrays (joints, 4, 4)."""
        constant, sine, cosine, slide = (np.zeros((len(self), 4, 4)) for _ in range(4))
        for place, link in enumerate(self.links):
            constant[place] = np.eye(4)
            if link.prismatic:
                slide[place, :3, 3] = link.axis
            else:
                cross = skew(np.array(link.axis))
                sine[place, :3, :3], cosine[place, :3, :3] = cross, -cross @ cross
                constant[place, :3, :3] += cross @ cross
        frames = np.array([link.frame for link in self.links]).reshape(-1, 4, 4)
        return constant @ frames, sine @ frames, cosine @ frames, slide @ frames

    def index(self, joint: str) -> int:
        """Return the place of a joint by its name."""
        if joint not in self.joints:
            near = did_you_mean(joint, self.joints)
            raise RefusedError(f"{self.name} has no joint {joint!r}; its joints are {', '.join(self.joints)}{near}")
        return self.joints.index(joint)

    # Other chains ----------------------------------------------------------------------------------------------------

    def limited(self, limits: Mapping[str, tuple[float, float]]) -> Chain:
        """Return it with other limits (deg, m) of some joints."""
        links = list(self.links)
        for joint, (low, high) in limits.items():
            if not low <= high:
                raise RefusedError(f"{joint}: limits are a smaller and a greater number, not {low:g} and {high:g}")
            place = self.index(joint)
            links[place] = replace(links[place], minimum=float(low), maximum=float(high))
        return replace(self, links=tuple(links))

    def limited_by(self, axes: Iterable[Axis]) -> Chain:
        """Return it with the limits that a robot's axes have, for the joints of their names."""
        return self.limited({axis.name: (axis.minimum, axis.maximum) for axis in axes if axis.name in self.joints})

    def blocked(self, positions: Mapping[str, float]) -> Chain:
        """Return it without these joints, each held at a position (deg, m); limits do not matter."""
        for joint, position in positions.items():
            if not math.isfinite(position):
                raise RefusedError(f"{self.name}: {joint} cannot be held at {position}")
            self.index(joint)
        base, links = self.base, []
        for link in self.links:
            if link.joint not in positions:
                links.append(link)
                continue
            held = Chain(link.joint, (link,)).pose([positions[link.joint]])
            if links:
                links[-1] = replace(links[-1], frame=links[-1].frame @ held)
            else:
                base = base @ held
        return replace(self, links=tuple(links), base=base)

    def with_tip(self, tip: ArrayLike) -> Chain:
        """Return it with another tip (4, 4), such as a tool. Raises RefusedError for what is no pose."""
        return replace(self, tip=checked_pose(tip))

    # Poses -----------------------------------------------------------------------------------------------------------

    def pose(self, positions: ArrayLike) -> NDArray[np.float64]:
        """Return the pose of the tip. Positions are (…, joints); the result is (…, 4, 4)."""
        moved = self._moved(self.checked(positions))
        pose = np.broadcast_to(self.base, (*moved.shape[:-3], 4, 4))
        for place in range(len(self)):
            pose = pose @ moved[..., place, :, :]
        return pose @ self.tip

    def frames(self, positions: ArrayLike) -> NDArray[np.float64]:
        """Return the frames of all links at (joints,) positions, (joints, 4, 4). That of the last link is the tip's."""
        frames = self._frames(self.checked(positions, batched=False))[1:]
        if len(self):
            frames[-1] = frames[-1] @ self.tip
        return frames

    def jacobian(self, positions: ArrayLike, link: int | None = None) -> NDArray[np.float64]:
        """Return the geometric Jacobian (6, joints) at (joints,) positions, in the axes of the root.

        Its product with the speeds of the joints (rad/s, m/s) is the velocity (m/s) of the origin of the tip, or of a
        link's frame, and the angular velocity (rad/s). Joints beyond that link have columns of zeros.
        """
        return self.pose_and_jacobian(positions, link)[1]

    def pose_and_jacobian(
        self, positions: ArrayLike, link: int | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return pose and Jacobian of the tip, or of a link's frame, at (joints,) positions."""
        return self._pose_and_jacobian(self.checked(positions, batched=False), self._last(link))

    # Checks ----------------------------------------------------------------------------------------------------------

    def checked(self, positions: ArrayLike, *, batched: bool = True) -> NDArray[np.float64]:
        """Return positions (deg, m) as an array; ``batched`` allows many at once."""
        values = np.asarray(positions, dtype=np.float64)
        if values.shape[-1:] != (len(self),) or (values.ndim > 1 and not batched):
            given = "x".join(map(str, values.shape)) or "one"
            raise RefusedError(f"{self.name} has {len(self)} joints ({', '.join(self.joints)}), not {given}")
        if not np.isfinite(values).all():
            wrong = np.flatnonzero(~np.isfinite(values).reshape(-1, len(self)).all(axis=0))
            raise RefusedError(f"{self.name}: no position is given for {', '.join(self.joints[i] for i in wrong)}")
        return values

    def violations(self, positions: ArrayLike, tolerance: float = 1e-6) -> list[str]:
        """Return which limits and constraints positions (deg, m) do not keep, a sentence each."""
        values = self.checked(positions, batched=False)
        found = [
            f"{link.joint} at {value:.6g} is not within {link.minimum:g} and {link.maximum:g}"
            for link, value in zip(self.links, values, strict=True)
            if not link.minimum - tolerance <= value <= link.maximum + tolerance
        ]
        matrix, lower, upper, names = self.constraint_rows()
        sums = matrix @ values
        return found + [
            f"{name} is {total:.6g}, not within {low:g} and {high:g}"
            for name, total, low, high in zip(names, sums, lower, upper, strict=True)
            if not low - tolerance <= total <= high + tolerance
        ]

    def constraint_rows(
        self,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], Sequence[str]]:
        """Return the constraints that hold: ``lower <= matrix @ positions <= upper`` (deg, m), and their names."""
        rows = [one for one in self.constraints if set(one.factors) <= set(self.joints)]
        matrix = np.array([[one.factors.get(joint, 0.0) for joint in self.joints] for one in rows], dtype=np.float64)
        lower, upper = (np.array([getattr(one, key) for one in rows], dtype=np.float64) for key in ("lower", "upper"))
        return matrix.reshape(len(rows), len(self)), lower, upper, [one.name for one in rows]

    # Parts -----------------------------------------------------------------------------------------------------------

    def _last(self, link: int | None) -> int:
        if link is None:
            return len(self)
        if not 0 <= link < len(self):
            raise RefusedError(f"{self.name} has links 0 to {len(self) - 1}, not {link}")
        return link + 1

    def _moved(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the transforms of all links, (…, joints, 4, 4)."""
        internal = (values * self.internal)[..., np.newaxis, np.newaxis]
        constant, sine, cosine, slide = self._parts
        moved: NDArray[np.float64] = constant + np.sin(internal) * sine + np.cos(internal) * cosine + internal * slide
        return moved

    def _frames(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the frames that the joints move in, then that of the last link without the tip."""
        moved = self._moved(values)
        frames = np.empty((len(self) + 1, 4, 4))
        frames[0] = self.base
        for place in range(len(self)):
            np.matmul(frames[place], moved[place], out=frames[place + 1])
        return frames

    def _pose_and_jacobian(
        self, values: NDArray[np.float64], last: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        frames = self._frames(values)
        pose = frames[last] @ self.tip if last == len(self) else frames[last]
        axes = np.einsum("nij,nj->ni", frames[:last, :3, :3], self._axes[:last])
        arms = pose[:3, 3] - frames[:last, :3, 3]
        turning = self._turning[:last, np.newaxis]
        jacobian = np.zeros((6, len(self)))
        jacobian[:3, :last] = np.where(turning, _cross(axes, arms), axes).T
        jacobian[3:, :last] = np.where(turning, axes, 0.0).T
        return pose, jacobian


def _cross(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the cross products of rows; several times faster than that of numpy for a few of them."""
    return one[:, [1, 2, 0]] * other[:, [2, 0, 1]] - one[:, [2, 0, 1]] * other[:, [1, 2, 0]]
