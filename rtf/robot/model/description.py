"""What a robot's description, URDF or MJCF, says of its joints, and its text without shapes and package schemes.

A path ``package://NAME/…`` means the folder NAME above the description: descriptions lie in the packages they name.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rtf.robot.errors import ConfigurationError
from rtf.robot.model.engine import mujoco

if TYPE_CHECKING:
    from pathlib import Path

#: Elements of a URDF with the shapes of a link.
_SHAPE = re.compile(r"<(visual|collision)\b.*?</\1>", re.DOTALL)
_PACKAGE = re.compile(r"package://([\w.-]+)")


@dataclass(frozen=True, slots=True)
class JointDescription:
    """A joint: limits in degrees, or metres of a prismatic one; None for what the description does not say."""

    name: str
    body: str  # which it moves
    limits: tuple[float, float] | None
    effort: float | None  # Nm, or N
    max_velocity: float | None  # deg/s, or m/s
    prismatic: bool
    armature: float
    friction: float
    damping: float


def load_description(path: Path, *, shapes: bool) -> Any:
    """Return an MjSpec of a description. Without ``shapes`` a URDF needs no mesh files.

    Raises ConfigurationError, which names the file, for one that cannot be read, and MissingPackageError.
    """
    try:
        text = path.read_text(encoding="utf-8")
        if path.suffix.lower() != ".urdf":
            return mujoco().MjSpec.from_file(str(path))
        if not shapes:
            text = _SHAPE.sub("", text)
        return mujoco().MjSpec.from_string(_PACKAGE.sub(lambda match: str(_package(path, match[1])), text))
    except (OSError, UnicodeDecodeError, ValueError) as error:
        raise ConfigurationError(f"{path}: cannot read a robot description (URDF or MJCF): {error}") from error


def read_joints(path: Path) -> dict[str, JointDescription]:
    """Return the hinges and slides of a description by their names, in the order of its tree.

    Raises as :func:`load_description`.
    """
    engine = mujoco()
    spec = load_description(path, shapes=False)
    try:
        model = spec.compile()
    except ValueError as error:
        raise ConfigurationError(f"{path}: the physics engine refuses this description: {error}") from error
    velocities, efforts = _velocities(path), _efforts(model)
    found = {}
    for number in range(model.njnt):
        joint = model.joint(number)
        if joint.type[0] not in (engine.mjtJoint.mjJNT_HINGE, engine.mjtJoint.mjJNT_SLIDE):
            continue
        slides = bool(joint.type[0] == engine.mjtJoint.mjJNT_SLIDE)
        scale = 1.0 if slides else math.degrees(1.0)
        dof = int(joint.dofadr[0])
        speed = velocities.get(joint.name)
        found[joint.name] = JointDescription(
            name=joint.name,
            body=model.body(int(joint.bodyid[0])).name,
            limits=(float(joint.range[0]) * scale, float(joint.range[1]) * scale) if joint.limited[0] else None,
            effort=efforts.get(joint.name),
            max_velocity=None if speed is None else speed * scale,
            prismatic=slides,
            armature=float(model.dof_armature[dof]),
            friction=float(model.dof_frictionloss[dof]),
            damping=float(model.dof_damping[dof]),
        )
    return found


def _efforts(model: Any) -> dict[str, float]:
    """Return the greatest torque (Nm) or force (N) of the joints that have one: their own, else of their actuator."""
    found = {}
    for number in range(model.nu):
        actuator = model.actuator(number)
        limits = actuator.forcerange if actuator.forcelimited[0] else actuator.ctrlrange
        if actuator.trntype[0] == mujoco().mjtTrn.mjTRN_JOINT and (actuator.forcelimited[0] or actuator.ctrllimited[0]):
            joint = model.joint(int(actuator.trnid[0]))
            found[joint.name] = abs(float(limits[1] * actuator.gear[0]))
    for number in range(model.njnt):
        joint = model.joint(number)
        if model.jnt_actfrclimited[number]:
            found[joint.name] = float(model.jnt_actfrcrange[number][1])
    return {name: effort for name, effort in found.items() if effort > 0.0}


def _velocities(path: Path) -> dict[str, float]:
    """Return the velocity limits of a URDF, which the engine does not keep (rad/s, m/s)."""
    if path.suffix.lower() != ".urdf":
        return {}
    from lxml import etree

    found = {}
    for joint in etree.parse(path, etree.XMLParser(resolve_entities=False, no_network=True)).iter("joint"):
        limit = joint.find("limit")
        if limit is not None and limit.get("velocity"):
            found[str(joint.get("name"))] = float(limit.get("velocity") or 0.0)
    return {name: speed for name, speed in found.items() if speed > 0.0}


def _package(path: Path, name: str) -> Path:
    for folder in path.parents:
        if folder.name == name:
            return folder
        if (folder / name).is_dir():
            return folder / name
    return path.parent
