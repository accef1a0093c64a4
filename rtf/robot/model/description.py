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
    from collections.abc import Iterable
    from pathlib import Path

    from lxml.etree import _Element
    from numpy.typing import NDArray

#: Elements of a URDF with the shapes of a link.
_SHAPE = re.compile(r"<(visual|collision)\b.*?</\1>", re.DOTALL)
#: The mass of a moving link for which the description has none (kg), and below which it counts as none.
LEAST_MASS, _TINY = 0.05, 1e-6
#: The radius of the ball in place of an impossible inertia (m).
_BALL = 0.05
_PACKAGE = re.compile(r"package:/{2,3}([\w.-]+)")
_MESH = re.compile(r"<mesh\b[^>]*\bfilename\s*=\s*[\"']([^\"']+)")
_LINK = re.compile(r"<link\b[^>]*\bname\s*=\s*[\"']([^\"']+)")
#: Bytes of a binary STL file: before the number of faces, and of each face.
_STL_HEADER, _STL_FACET = 80, 50
#: The shortest bone that is drawn (m), and the colour of all.
_SHORTEST, _BONE = 0.01, (0.6, 0.6, 0.65, 1.0)


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

    Links of a URDF with meshes that are missing, or in a format that the engine does not read, get capsules along
    their bones in place of them. Raises ConfigurationError, which names the file, for a description that cannot be
    read, and MissingPackageError.
    """
    try:
        if path.suffix.lower() != ".urdf":
            return mujoco().MjSpec.from_file(str(path))
        text = path.read_text(encoding="utf-8")
        if not shapes:
            text = _SHAPE.sub("", text)
        text = _PACKAGE.sub(lambda match: str(_package(path, match[1])), text)
        bare: list[str] = []
        if shapes:
            text = _SHAPE.sub(lambda match: _usable(path, match[0], text, match.start(), bare), text)
        spec = mujoco().MjSpec.from_string(text)
        for link in dict.fromkeys(bare):
            _add_bones(spec.body(link))
        if repaired:
            repair(spec)
    except (OSError, UnicodeDecodeError, ValueError) as error:
        raise ConfigurationError(f"{path}: cannot read a robot description (URDF or MJCF): {error}") from error
    return spec


def unusable_meshes(path: Path) -> list[str]:
    """Return the links of a URDF whose meshes are missing or cannot be read by the engine."""
    if path.suffix.lower() != ".urdf":
        return []
    bare: list[str] = []
    text = _PACKAGE.sub(lambda match: str(_package(path, match[1])), path.read_text(encoding="utf-8"))
    for match in _SHAPE.finditer(text):
        _usable(path, match[0], text, match.start(), bare)
    return list(dict.fromkeys(bare))


def _usable(path: Path, shape: str, text: str, start: int, bare: list[str]) -> str:
    """Return the text of a shape, or nothing if its mesh cannot be used; its link is added to ``bare`` then."""
    mesh = _MESH.search(shape)
    if mesh is None or _is_readable(path.parent / mesh[1].removeprefix("file://")):
        return shape
    links = _LINK.findall(text[:start])
    bare.append(links[-1] if links else "")
    return ""


def _is_readable(mesh: Path) -> bool:
    if not mesh.is_file():
        return False
    if mesh.suffix.lower() != ".stl":
        return mesh.suffix.lower() == ".obj"
    with mesh.open("rb") as file:
        count = int.from_bytes(file.read(_STL_HEADER + 4)[_STL_HEADER:], "little")
    return mesh.stat().st_size == _STL_HEADER + 4 + count * _STL_FACET


def _add_bones(body: Any) -> None:
    """Add a massless capsule from a link's frame to each link below it, or a ball to the last one."""
    types = mujoco().mjtGeom
    if body is None:
        return
    tips = [child.pos for child in body.bodies if np.linalg.norm(child.pos) > _SHORTEST]
    look = {"contype": 0, "conaffinity": 0, "mass": 0, "rgba": _BONE}
    for tip in tips:
        radius = min(max(0.15 * float(np.linalg.norm(tip)), 0.01), 0.05)
        body.add_geom(type=types.mjGEOM_CAPSULE, fromto=[0, 0, 0, *tip], size=[radius, 0, 0], **look)
    if not tips:
        body.add_geom(type=types.mjGEOM_SPHERE, size=[0.02, 0, 0], **look)


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
    return {name: effort for name, effort in found.items() if 0.0 < effort < math.inf}


def urdf_joints(path: Path) -> Iterable[_Element]:
    """Return the elements of the joints of a URDF file; none of another description."""
    if path.suffix.lower() != ".urdf":
        return ()
    from lxml import etree

    return etree.parse(path, etree.XMLParser(resolve_entities=False, no_network=True)).iter("joint")


def fix_root(spec: Any) -> None:
    """Remove what drives a robot and moves it as a whole: actuators, key frames, and free joints."""
    for element in [*spec.actuators, *spec.keys]:
        spec.delete(element)
    for joint in list(spec.joints):
        if joint.type == mujoco().mjtJoint.mjJNT_FREE:
            spec.delete(joint)


def _velocities(path: Path) -> dict[str, float]:
    """Return the velocity limits of a URDF, which the engine does not keep (rad/s, m/s)."""
    found = {}
    for joint in urdf_joints(path):
        limit = joint.find("limit")
        if limit is not None and limit.get("velocity"):
            found[str(joint.get("name"))] = float(limit.get("velocity") or 0.0)
    return {name: speed for name, speed in found.items() if 0.0 < speed < math.inf}


def _package(path: Path, name: str) -> Path:
    for folder in path.parents:
        if folder.name == name:
            return folder
        if (folder / name).is_dir():
            return folder / name
    return path.parent
