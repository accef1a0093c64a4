"""The points of a robot's workspace in the simulator's model: sites on their links, and where they are in a pose."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rtf.robot.model.bodies import link_of
from rtf.robot.model.engine import mujoco

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.robot.model import RobotModel

_PREFIX = "workspace/"
_UNSEEN = 4  # a group that cameras do not show
_COLOUR = (0.9, 0.1, 0.1, 0.6)


def add_points(spec: Any, robot: RobotModel) -> None:
    """Add a site for each point of the robot's workspace, or at the origin of each moving link if it names none.

    Raises RobotModelError for a link that the description does not have.
    """
    if robot.workspace is None:
        return
    for point in robot.workspace.points:
        what = f"the point {point.name} of the workspace"
        body = link_of(spec, robot, point.link, what, "workspace", "points", point.name, "link")
        body.add_site(name=f"{_PREFIX}{point.name}", pos=point.position, group=_UNSEEN)
    if not robot.workspace.points:
        for body in [body for body in spec.bodies if body.joints]:
            body.add_site(name=f"{_PREFIX}{body.name}", group=_UNSEEN)


def draw(spec: Any, robot: RobotModel, size: float) -> None:
    """Make the workspace visible: its edges, as far as a cube of this size (m) about the robot, and its points."""
    if robot.workspace is None:
        return
    types, look = mujoco().mjtGeom, {"rgba": _COLOUR, "mass": 0.0, "contype": 0, "conaffinity": 0}
    for start, end in robot.workspace.edges(robot.scene.centre, size):
        spec.worldbody.add_geom(type=types.mjGEOM_CAPSULE, fromto=[*start, *end], size=[size / 400, 0, 0], **look)
    for point in robot.workspace.points:
        radius = max(point.radius, size / 150)
        spec.body(point.link).add_geom(type=types.mjGEOM_SPHERE, pos=point.position, size=[radius, 0, 0], **look)


def points(model: Any, data: Any) -> dict[str, NDArray[np.float64]]:
    """Return where the points of the workspace are in the root's frame (m). ``data`` must have been forwarded."""
    names = [model.site(number).name for number in range(model.nsite)]
    found = {name: data.site_xpos[number].copy() for number, name in enumerate(names) if name.startswith(_PREFIX)}
    return {name.removeprefix(_PREFIX): place for name, place in found.items()}


def outside(robot: RobotModel, model: Any, data: Any) -> list[str]:
    """Return which points are outside of the robot's workspace, a sentence each; none if nothing is known of it."""
    workspace = robot.workspace
    if workspace is None:
        return []
    radii = {point.name: point.radius for point in workspace.points}
    found = []
    for name, place in points(model, data).items():
        depth = workspace.beyond(place) + radii.get(name, 0.0)
        deepest = int(np.argmax(depth))
        if depth[deepest] > 0.0:
            plane = workspace.half_spaces[deepest].name
            found.append(f"{name} is {depth[deepest] * 1e3:.0f} mm beyond {plane} of the workspace")
    return found
