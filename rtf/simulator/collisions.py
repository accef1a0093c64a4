"""Collision shapes of the links, and the pairs of links that are excluded.

Two sets of shapes. *Capsules* are a hand-made outline, slightly within the covers of the robot: quick, nothing to load.
*Hulls* are the convex hulls of the published meshes: exact where the links are convex, and slow to load.

Links that are neighbours in the robot's tree never collide, in both sets: the outlines overlap at every joint, and
hulls of covers that reach around a joint would limit its range.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rtf.simulator.engine import mujoco

#: Links with at most this number of joints between them are not tested against each other.
NEAR = 4
#: Groups in a viewer: the collision shapes, and the shapes that the cameras show.
COLLISION_GROUP = 3
VISUAL_GROUP = 1

#: Collision bits: two shapes collide if the type of one and the affinity of the other share a bit.
_BODY, _LEFT_FINGERS, _RIGHT_FINGERS = 1, 2, 4

_Point = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class _Capsule:
    """A capsule in the frame of a link: two ends and a radius (m)."""

    link: str
    start: _Point
    end: _Point
    radius: float


@dataclass(frozen=True, slots=True)
class _Box:
    """A box along the axes of a link's frame: its centre and half its edges (m)."""

    link: str
    centre: _Point
    half: _Point


_MIDDLE: tuple[_Capsule | _Box, ...] = (
    _Box("root_link", (0.035, 0.0, -0.070), (0.055, 0.075, 0.070)),
    _Capsule("torso_2", (0.0, 0.010, 0.050), (0.0, 0.080, 0.050), 0.040),
    _Capsule("chest", (-0.040, 0.090, 0.0), (0.040, 0.090, 0.0), 0.070),
    _Capsule("chest", (-0.020, 0.030, 0.0), (0.020, 0.030, 0.0), 0.060),
    _Capsule("chest", (-0.045, 0.105, -0.135), (0.045, 0.105, -0.135), 0.060),
    _Capsule("neck_2", (0.0, 0.0, -0.016), (0.0, 0.060, -0.016), 0.020),
    _Capsule("head", (0.0, 0.120, -0.045), (0.0, 0.120, 0.0), 0.078),
    # The one link whose frame is not where its twin's is.
    _Capsule("r_elbow_1", (-0.020, 0.0195, -0.003), (-0.005, 0.0195, -0.003), 0.028),
    _Capsule("l_elbow_1", (0.020, 0.0310, -0.003), (0.005, 0.0310, -0.003), 0.028),
)
#: The right side. The left one is its mirror image, see :func:`_mirrored`.
_RIGHT: tuple[_Capsule | _Box, ...] = (
    _Capsule("r_hip_1", (0.0, -0.038, 0.0), (0.0, -0.019, 0.0), 0.036),
    _Capsule("r_hip_2", (0.0, 0.0, -0.080), (0.0, 0.0, -0.020), 0.030),
    _Capsule("r_upper_leg", (0.004, -0.002, -0.120), (0.004, -0.002, 0.010), 0.055),
    _Capsule("r_lower_leg", (0.0, -0.002, -0.180), (0.005, -0.002, -0.025), 0.048),
    _Capsule("r_ankle_1", (0.0, -0.006, 0.0), (0.0, 0.006, 0.0), 0.032),
    _Box("r_ankle_2", (0.0265, -0.005, -0.062), (0.080, 0.036, 0.013)),
    _Capsule("r_shoulder_2", (-0.035, 0.0, -0.030), (0.0, 0.0, -0.005), 0.028),
    _Capsule("r_shoulder_3", (-0.115, 0.0, 0.015), (-0.025, 0.0, 0.015), 0.042),
    _Capsule("r_forearm", (-0.078, 0.0, 0.003), (-0.005, 0.0, 0.003), 0.037),
    _Capsule("r_hand", (-0.060, 0.006, 0.028), (-0.014, 0.005, 0.006), 0.023),
)


def _mirrored(point: _Point, link: str) -> _Point:
    """Return the position on the left side for a position on the right side.

    The frames of the legs' links are parallel on both sides; those of the arms' are half a turn apart.
    """
    x, y, z = point
    arm = any(word in link for word in ("shoulder", "forearm", "hand"))
    return (-x, y, z) if arm else (x, -y, z)


def _left(shape: _Capsule | _Box) -> _Capsule | _Box:
    link = "l_" + shape.link[2:]
    if isinstance(shape, _Capsule):
        return _Capsule(link, _mirrored(shape.start, link), _mirrored(shape.end, link), shape.radius)
    return _Box(link, _mirrored(shape.centre, link), shape.half)


_SHAPES = (*_MIDDLE, *_RIGHT, *(_left(shape) for shape in _RIGHT))


def add_capsules(spec: Any) -> list[Any]:
    """Add the hand-made outlines to the robot's links; they are massless, as the description has the links' inertia."""
    return [_add(spec.body(shape.link), shape, index) for index, shape in enumerate(_SHAPES)]


def _add(body: Any, shape: _Capsule | _Box, index: int) -> Any:
    types = mujoco().mjtGeom
    name = f"{shape.link}_c{index}"
    if isinstance(shape, _Box):
        return body.add_geom(name=name, type=types.mjGEOM_BOX, pos=shape.centre, size=shape.half, mass=0)
    ends = [*shape.start, *shape.end]
    return body.add_geom(name=name, type=types.mjGEOM_CAPSULE, fromto=ends, size=[shape.radius, 0, 0], mass=0)


def make_solid(geom: Any) -> None:
    """Let ``geom`` collide with other solid shapes."""
    geom.group = COLLISION_GROUP
    geom.contype = geom.conaffinity = _BODY


def make_solid_finger(geom: Any, side: str) -> None:
    """Let ``geom`` collide with everything but the fingers of its own hand, whose nominal shapes are too coarse."""
    own, other = (_LEFT_FINGERS, _RIGHT_FINGERS) if side == "l" else (_RIGHT_FINGERS, _LEFT_FINGERS)
    geom.group = COLLISION_GROUP
    geom.contype = own
    geom.conaffinity = _BODY | other


def make_visual(geom: Any) -> None:
    """Make ``geom`` visible without collisions."""
    geom.group = VISUAL_GROUP
    geom.contype = geom.conaffinity = 0


def exclude_near(spec: Any, links: set[str]) -> None:
    """Exclude all pairs of ``links`` with at most :data:`NEAR` joints between them.

    A link that is named here is kept by the compiler although it may have no joint of its own.
    """
    ways = {body.name: _joints_to(body) for body in spec.bodies if body.name in links}
    names = list(ways)
    for index, first in enumerate(names):
        for second in names[index + 1 :]:
            if len(ways[first] ^ ways[second]) <= NEAR:
                spec.add_exclude(bodyname1=first, bodyname2=second)


def _joints_to(body: Any) -> frozenset[str]:
    """Return the names of the joints between the world and a body."""
    names: set[str] = set()
    while body is not None and body.name != "world":
        names.update(joint.name for joint in body.joints)
        body = body.parent
    return frozenset(names)
