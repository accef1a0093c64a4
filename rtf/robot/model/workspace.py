"""The workspace of a robot: half-spaces in the frame of its root, and the points of its links that stay within.

It is plain data. Where the points are in a pose is known to what has the kinematics of the robot, such as
:func:`rtf.simulator.workspace.points`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.robot.model.file import Vector, WorkspaceTable

#: The determinant of normals of planes that have no point in common, the planes that an edge is on, and rounding (m).
_PARALLEL, _OF_AN_EDGE, _CLOSE = 1e-9, 2, 1e-9
#: The faces of a box: name, outward normal, and whether its place is that of the upper corner.
_FACES = tuple(
    (f"{'greatest' if upper else 'least'} {letter}", place, upper)
    for place, letter in enumerate("xyz")
    for upper in (False, True)
)


@dataclass(frozen=True, slots=True)
class HalfSpace:
    """A half-space: the points with ``normal @ point <= offset``."""

    name: str  # as messages call its plane, such as "table" or "greatest x"
    normal: Vector  # of length 1, pointing out of the workspace
    offset: float  # m


@dataclass(frozen=True, slots=True)
class WorkspacePoint:
    """A ball about a point of a link, all of which has to stay in the workspace."""

    name: str
    link: str  # a body of the description
    position: Vector  # m, in the frame of the link
    radius: float  # m


@dataclass(frozen=True)
class Workspace:
    """What the robot may reach: what all half-spaces have in common; in m, in the frame of the robot's root.

    The root is the base link of a URDF, the world of an MJCF. Without ``points`` those that count are the origins of
    all links that an axis moves.
    """

    half_spaces: tuple[HalfSpace, ...]
    points: tuple[WorkspacePoint, ...] = ()

    @cached_property
    def normals(self) -> NDArray[np.float64]:
        """The normals as rows, (half-spaces, 3)."""
        return np.array([one.normal for one in self.half_spaces], dtype=np.float64)

    @cached_property
    def offsets(self) -> NDArray[np.float64]:
        """The offsets, (half-spaces,)."""
        return np.array([one.offset for one in self.half_spaces], dtype=np.float64)

    def edges(self, centre: Vector, size: float) -> list[tuple[Vector, Vector]]:
        """Return the edges of the workspace as pairs of points (m), cut off by a cube of this ``size`` (m).

        The cube is about ``centre``. An edge that only the cube has is left out: a single plane has the four sides of a
        square.
        """
        cube = np.vstack([np.eye(3), -np.eye(3)])
        normals = np.vstack([self.normals, cube])
        offsets = np.concatenate([self.offsets, cube @ centre + size / 2])
        corners: dict[Vector, set[int]] = {}  # with the planes that they are on
        for three in combinations(range(len(offsets)), 3):
            rows = normals[list(three)]
            if abs(np.linalg.det(rows)) < _PARALLEL:
                continue
            corner = np.linalg.solve(rows, offsets[list(three)])
            if (normals @ corner <= offsets + _CLOSE).all():
                corners.setdefault(_vector(corner.round(6)), set()).update(three)
        return [
            (one, other)
            for (one, of_one), (other, of_other) in combinations(corners.items(), 2)
            if len(shared := of_one & of_other) >= _OF_AN_EDGE and min(shared) < len(self.offsets)
        ]

    def beyond(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how far points are beyond each plane (m), negative within; (…, 3) gives (…, half-spaces)."""
        distances: NDArray[np.float64] = np.asarray(places) @ self.normals.T - self.offsets
        return distances


def workspace_of(table: WorkspaceTable) -> Workspace:
    """Return the workspace of a file. Raises ValueError, with what is wrong, for one that contains nothing."""
    spaces: list[HalfSpace] = []
    if table.box is not None:
        if not all(low < high for low, high in zip(table.box.low, table.box.high, strict=True)):
            raise ValueError(f"each number of low is less than that of high, not {table.box.low} and {table.box.high}")
        for name, place, upper in _FACES:
            normal = np.zeros(3)
            normal[place] = 1.0 if upper else -1.0
            corner = table.box.high if upper else table.box.low
            spaces.append(HalfSpace(name, _vector(normal), float(normal @ corner)))
    for name, plane in table.planes.items():
        length = float(np.linalg.norm(plane.normal))
        if not (0.0 < length < np.inf):
            raise ValueError(f"the normal of the plane {name} is {plane.normal}; it points into the workspace")
        outward = -np.array(plane.normal) / length
        spaces.append(HalfSpace(name, _vector(outward), float(outward @ plane.point)))
    if not spaces:
        raise ValueError("write a box, or planes")
    if not np.isfinite([one.offset for one in spaces]).all():
        raise ValueError("its numbers are finite; leave out the box, and write the planes that there are")
    points = (WorkspacePoint(name, one.link, one.position, one.radius) for name, one in table.points.items())
    return Workspace(tuple(spaces), tuple(points))


def _vector(values: NDArray[np.float64]) -> Vector:
    x, y, z = (float(value) + 0.0 for value in values)  # + 0.0: no -0
    return x, y, z
