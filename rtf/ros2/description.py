"""The description of a robot (URDF) as it is sent on ``robot_description``: the joints that move, and their limits."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from lxml import etree

from rtf.robot.errors import NotSupportedError, RefusedError
from rtf.robot.interfaces import IAxisInfo, IControlLimits, ITorqueControl, JointType
from rtf.ros2.errors import DescriptionError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from lxml.etree import _Element

    from rtf.robot.device import Device

#: Kinds of joints of a URDF that are axes of a robot.
_KINDS = {"revolute": JointType.REVOLUTE, "continuous": JointType.REVOLUTE, "prismatic": JointType.PRISMATIC}
_LONGEST = 16 * 2**20


@dataclass(frozen=True, slots=True)
class DescribedJoint:
    """A joint, in the units of ROS: rad, rad/s and Nm, or m, m/s and N; what is not said, or not above 0, is None."""

    name: str
    kind: JointType
    limits: tuple[float, float] | None
    velocity: float | None
    effort: float | None

    @property
    def unit(self) -> float:
        """How many units of a board, deg or m, one of ROS has."""
        return 1.0 if self.kind is JointType.PRISMATIC else 180.0 / math.pi


def read_joints(text: str) -> dict[str, DescribedJoint]:
    """Return the joints that move by themselves, by name. Raises DescriptionError, with the line."""
    if len(text) > _LONGEST:
        raise DescriptionError(f"a description of {len(text)} characters is too long; {_LONGEST} are the most")
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)
    try:
        root = etree.fromstring(text.encode(), parser)
    except etree.XMLSyntaxError as error:
        raise DescriptionError(f"the description is no XML: {error}") from None
    if root.tag != "robot":
        raise DescriptionError(f"the description is no URDF: its root is <{root.tag}>, not <robot>")
    found = [
        _joint(one) for one in root.iterchildren("joint") if one.get("type") in _KINDS and one.find("mimic") is None
    ]
    return {joint.name: joint for joint in found}


def _joint(element: _Element) -> DescribedJoint:
    kind, limit = str(element.get("type")), element.find("limit")
    lower, upper, velocity, effort = (_number(limit, key) for key in ("lower", "upper", "velocity", "effort"))
    limits = None if kind == "continuous" else (lower or 0.0, upper or 0.0)
    if limits is not None and not limits[0] < limits[1]:
        raise DescriptionError(
            f"line {element.sourceline}: {element.get('name')} has no range: {limits[0]} to {limits[1]}"
        )
    return DescribedJoint(
        str(element.get("name")),
        _KINDS[kind],
        limits,
        velocity if velocity and velocity > 0 else None,
        effort if effort and effort > 0 else None,
    )


def _number(limit: _Element | None, key: str) -> float | None:
    if limit is None or limit.get(key) is None:
        return None
    try:
        value = float(str(limit.get(key)))
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise DescriptionError(f"line {limit.sourceline}: {key}={limit.get(key)!r} is no number")
    return value


def make_description(name: str, joints: Iterable[DescribedJoint]) -> str:
    """Return a URDF of joints with their limits, one behind the other, without shapes and places: it is no model."""
    root = etree.Element("robot", name=name)
    etree.SubElement(root, "link", name="base_link")
    before = "base_link"
    for joint in joints:
        link = f"{joint.name}_link"
        etree.SubElement(root, "link", name=link)
        kind = "prismatic" if joint.kind is JointType.PRISMATIC else "revolute" if joint.limits else "continuous"
        element = etree.SubElement(root, "joint", name=joint.name, type=kind)
        etree.SubElement(element, "parent", link=before)
        etree.SubElement(element, "child", link=link)
        lower, upper = joint.limits or (0.0, 0.0)
        values = {"lower": lower, "upper": upper, "velocity": joint.velocity or 0.0, "effort": joint.effort or 0.0}
        etree.SubElement(element, "limit", {key: repr(value) for key, value in values.items()})
        before = link
    return etree.tostring(root, encoding="unicode", pretty_print=True)


def described(board: Device) -> list[DescribedJoint]:
    """Return the axes of a board as joints, with its limits. Raises RobotError."""
    axes, ranges, torques = board.view(IAxisInfo), board.view(IControlLimits), board.view(ITorqueControl)  # type: ignore[type-abstract]  # they are only looked for
    found = []
    for joint, name in enumerate(axes.axis_names()):
        kind = axes.joint_type(joint)
        bare = DescribedJoint(name, kind, None, None, None)
        low, high = ranges.limits(joint)
        try:
            effort = torques.torque_range(joint)[1]
        except (NotSupportedError, RefusedError):
            effort = 0.0
        limits = (low / bare.unit, high / bare.unit)
        speed = ranges.velocity_limits(joint)[1] / bare.unit
        found.append(replace(bare, limits=limits, velocity=speed or None, effort=effort or None))
    return found
