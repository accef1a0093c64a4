"""Collision shapes of the links, and the pairs of links that are excluded.

Two sets of shapes. *Capsules* are the outlines in a robot's robot.toml: quick, nothing to load. *Hulls* are the convex
hulls of the published meshes: exact where the links are convex, and slow to load. A description in MJCF and attached
bodies have shapes of their own, which say themselves what they touch.

Links that are neighbours in the robot's tree never collide, in both sets: the outlines overlap at every joint, and
hulls of covers that reach around a joint would limit its range.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rtf.robot.model.bodies import link_of
from rtf.robot.model.engine import mujoco

if TYPE_CHECKING:
    from rtf.robot.model import RobotModel
    from rtf.robot.model.file import Outline

#: Groups in a viewer: the collision shapes, and the shapes that the cameras show.
COLLISION_GROUP = 3
VISUAL_GROUP = 1


def add_outlines(spec: Any, robot: RobotModel) -> list[Any]:
    """Add outlines to the robot's links; they are massless, as the description has the links' inertia.

    Raises RobotModelError for a link that the description does not have.
    """
    return [
        _add(
            link_of(spec, robot, shape.link, f"the outline {index}", "body", "outlines", str(index), "link"),
            shape,
            index,
        )
        for index, shape in enumerate(robot.body.outlines)
    ]


def _add(body: Any, shape: Outline, index: int) -> Any:
    types = mujoco().mjtGeom
    name = f"{shape.link}_c{index}"
    if shape.start is None or shape.end is None:
        return body.add_geom(name=name, type=types.mjGEOM_BOX, pos=shape.centre, size=shape.half, mass=0)
    ends = [*shape.start, *shape.end]
    return body.add_geom(name=name, type=types.mjGEOM_CAPSULE, fromto=ends, size=[shape.radius, 0, 0], mass=0)


def make_solid(geom: Any, kind: int = 1, affinity: int = 1) -> None:
    """Let ``geom`` collide: two shapes do if the kind of one and the affinity of the other share a bit."""
    geom.group = COLLISION_GROUP
    geom.contype, geom.conaffinity = kind, affinity


def make_visual(geom: Any) -> None:
    """Make ``geom`` visible without collisions."""
    geom.group = VISUAL_GROUP
    geom.contype = geom.conaffinity = 0


def exclude_near(spec: Any, links: set[str], near: int) -> None:
    """Exclude all pairs of ``links`` with at most :data:`NEAR` joints between them.

    A link that is named here is kept by the compiler although it may have no joint of its own.
    """
    ways = {body.name: _joints_to(body) for body in spec.bodies if body.name in links}
    names = list(ways)
    for index, first in enumerate(names):
        for second in names[index + 1 :]:
            if len(ways[first] ^ ways[second]) <= near:
                spec.add_exclude(bodyname1=first, bodyname2=second)


def _joints_to(body: Any) -> frozenset[str]:
    """Return the names of the joints between the world and a body."""
    names: set[str] = set()
    while body is not None and body.name != "world":
        names.update(joint.name for joint in body.joints)
        body = body.parent
    return frozenset(names)
