"""What a robot's description, URDF or MJCF, says of its joints, and its text without shapes and package schemes.

A path ``package://NAME/…`` means the folder NAME above the description: descriptions lie in the packages they name.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rtf.robot.errors import ConfigurationError
from rtf.robot.model.engine import mujoco

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

#: Elements of a URDF with the shapes of a link.
_SHAPE = re.compile(r"<(visual|collision)\b.*?</\1>", re.DOTALL)
#: The mass of a moving link for which the description has none (kg), and below which it counts as none.
LEAST_MASS, _TINY = 0.05, 1e-6
#: The radius of the ball in place of an impossible inertia (m).
_BALL = 0.05
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


def load_description(path: Path, *, shapes: bool, repaired: bool = True) -> Any:
    """Return an MjSpec of a description. Without ``shapes`` a URDF needs no mesh files.

    Raises ConfigurationError, which names the file, for one that cannot be read, and MissingPackageError.
    """
    try:
        text = path.read_text(encoding="utf-8")
        if path.suffix.lower() != ".urdf":
            return mujoco().MjSpec.from_file(str(path))
        if not shapes:
            text = _SHAPE.sub("", text)
        spec = mujoco().MjSpec.from_string(_PACKAGE.sub(lambda match: str(_package(path, match[1])), text))
    except (OSError, UnicodeDecodeError, ValueError) as error:
        raise ConfigurationError(f"{path}: cannot read a robot description (URDF or MJCF): {error}") from error
    if repaired:
        repair(spec)
    return spec


def repair(spec: Any) -> list[str]:
    """Replace the masses and inertias that no body can have, so that the engine takes them; say which, a line each.

    Descriptions made for other programs have links without a mass, and inertias that are not positive or not those of
    any body. Such a link becomes a ball of its mass, at least ``LEAST_MASS`` if something moves it.
    """
    said = []
    for body in spec.bodies:
        moves = bool(body.joints)
        if not body.explicitinertial and not (moves and not body.geoms):
            continue
        inertia = _principal(body)
        sound = inertia is not None and inertia.min() > _TINY**2 and inertia.max() <= inertia.sum() / 2 + _TINY**2
        if sound and (body.mass >= _TINY or not moves):
            continue
        mass = max(float(body.mass), LEAST_MASS if moves else 0.0)
        body.mass = mass
        body.fullinertia = [math.nan] + [0.0] * 5
        body.inertia = [max(0.4 * mass * _BALL**2, 1e-9)] * 3
        body.iquat = [1.0, 0.0, 0.0, 0.0]
        body.explicitinertial = True
        if mass:
            said.append(f"{body.name}: no body has its inertia; it is that of a ball of {mass:g} kg and {_BALL:g} m")
    return said


def _principal(body: Any) -> NDArray[np.float64] | None:
    full = np.asarray(body.fullinertia, dtype=np.float64)
    if math.isnan(full[0]):
        return np.asarray(body.inertia, dtype=np.float64)
    xx, yy, zz, xy, xz, yz = full
    if not np.isfinite(full).all():
        return None
    values: NDArray[np.float64] = np.linalg.eigvalsh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    return values


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
        joint, limited = model.joint(number), bool(model.jnt_limited[number])
        kind = int(joint.type[0])
        if kind not in (int(engine.mjtJoint.mjJNT_HINGE), int(engine.mjtJoint.mjJNT_SLIDE)):
            continue
        slides = kind == int(engine.mjtJoint.mjJNT_SLIDE)
        scale = 1.0 if slides else math.degrees(1.0)
        dof = int(joint.dofadr[0])
        speed = velocities.get(joint.name)
        found[joint.name] = JointDescription(
            name=joint.name,
            body=model.body(int(joint.bodyid[0])).name,
            limits=(float(joint.range[0]) * scale, float(joint.range[1]) * scale) if limited else None,
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
        if int(actuator.trntype[0]) == int(mujoco().mjtTrn.mjTRN_JOINT) and (
            actuator.forcelimited[0] or actuator.ctrllimited[0]
        ):
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
