"""The bodies of a robot's description, and those that its robot.toml attaches to them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rtf.robot.model.engine import mujoco
from rtf.robot.model.errors import RobotModelError

if TYPE_CHECKING:
    from rtf.robot.model.values import RobotModel


def link_of(spec: Any, robot: RobotModel, link: str, what: str, *keys: str) -> Any:
    """Return the body of a link. ``keys`` are those of ``what`` in robot.toml.

    Raises RobotModelError, with the line, for a link that the description does not have.
    """
    body = spec.body(link)
    if body is None:
        links = ", ".join(one.name for one in spec.bodies if one.name != "world")
        raise RobotModelError(
            f"{robot.place(*keys)}: {what} is on {link!r}, which {robot.description.name} does not have; its links are "
            f"{links}"
        )
    return body


def attach_bodies(spec: Any, robot: RobotModel) -> None:
    """Add the bodies that the description lacks. Raises RobotModelError, with the line, for what cannot be added."""
    for number, attachment in enumerate(robot.body.attach):
        keys = ("body", "attach", str(number))
        body = link_of(spec, robot, attachment.body, f"the attached {attachment.file}", *keys, "body")
        path = robot.folder / attachment.file
        try:
            child = mujoco().MjSpec.from_file(str(path))
        except (OSError, ValueError) as error:
            place = robot.place(*keys, "file")
            raise RobotModelError(f"{place}: {path} cannot be read: {error}") from None
        spec.attach(child, prefix=attachment.prefix, suffix="", frame=body.add_frame())
