"""A first ``robot.toml`` from a description alone: what can be derived, and a list of what had to be assumed."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from rtf.robot.errors import RefusedError
from rtf.robot.model.description import fix_root, load_description, read_joints, repair, unusable_meshes, urdf_joints
from rtf.robot.model.engine import mujoco
from rtf.robot.model.reader import SHARE, STRIBECK
from rtf.simulator.position_gains import BANDWIDTH

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from rtf.robot.model.description import JointDescription

#: Random poses in which the loads of gravity and the inertias are computed.
_POSES = 200
#: The rotor's inertia, seen from the joint, as a share of the greatest inertia of the links that the joint moves:
#: behind a gear of 100 it is of this order, and the whole inertia then varies by less than a factor of three. But at
#: least that of a motor that needs this time (s) to reach its greatest speed by its greatest torque: data sheets of
#: small servo motors have mechanical time constants of 3 to 20 ms. With less, a per cent of duty cycle is a blow.
_ROTOR, _TIME_CONSTANT = 0.5, 0.005
#: Without an effort in the description, or with one that gravity takes most of: this many times the greatest torque of
#: gravity, and at least this (Nm, N).
_STRENGTH, _WEAKEST = 3.0, 0.1
#: The least effort, as a multiple of the greatest torque of gravity: the nominal current, half the peak current, holds
#: the joint in every pose, friction included.
_BEARING = 2.2
#: Dry friction as a share of the torque, and viscous friction as a share of the torque at the greatest speed.
_DRY, _VISCOUS = 0.02, 0.05
#: The position loop overcomes a dry friction with this error (rad), and a viscous one of this share of its damping.
_SLACK, _SHARE = 0.008, 0.1
#: Friction of a description that is this many times as great is that of another simulator; so is dry friction that is
#: at rest beyond this share of the torque: real drives have up to a tenth, with harmonic gears and cables.
_LOST, _MOST_DRY = 5.0, 0.1
#: Limits of a joint without any (deg, m), and the speed up to which a robot on a bench is moved (deg/s, m/s).
_TURN, _SLIDE, _FAST, _FAST_SLIDE = 180.0, 0.1, 180.0, 0.25
#: A minimum-jerk move over a way *d* with the peak speed *v* accelerates by up to ``_JERK v² / d``. At the greatest
#: speed, over half the range, that takes this share of the torque that gravity leaves: a controller that gives its
#: whole output in healthy moves cannot be told from one whose joint is blocked.
_JERK, _ACCELERATING = 10 / math.sqrt(3) / (15 / 8) ** 2, 0.5


@dataclass(slots=True)
class Draft:
    """A draft of a robot.toml."""

    text: str
    joints: int
    assumed: list[str] = field(default_factory=list)


@dataclass(slots=True)
class _Assumptions:
    """What a draft assumes: sentences, and the joints that are slower than their descriptions say, for two reasons."""

    lines: list[str]
    slowed: list[str] = field(default_factory=list)
    heavy: list[str] = field(default_factory=list)

    def sentences(self) -> list[str]:
        """Return all of it as sentences."""
        found = list(self.lines)
        if self.slowed:
            names = ", ".join(self.slowed)
            found.append(f"at most {_FAST:g} deg/s, on a slide {_FAST_SLIDE:g} m/s, as on a bench: {names}")
        if self.heavy:
            found.append(
                f"slower than described, so that moves over half the range accelerate with {_ACCELERATING:.0%} of the "
                f"torque that gravity leaves: {', '.join(self.heavy)}"
            )
        return found


@dataclass(slots=True)
class _Loads:
    """What the links of a description do to its joints: greatest torque of gravity (Nm, N), and greatest inertia."""

    gravity: NDArray[np.float64]
    inertia: NDArray[np.float64]
    centre: NDArray[np.float64]  # m, of the whole robot
    extent: float  # m
    lowest: float  # m


def draft(name: str, description: Path, source: str) -> Draft:
    """Return a draft for a description. ``source`` is the table ``[description]`` as text.

    Raises ConfigurationError for a description that cannot be read, and RefusedError for one without joints that move.
    """
    joints = read_joints(description)
    mimics = _mimics(description)
    driven = [joint for joint in joints.values() if joint.name not in mimics]
    if not driven:
        raise RefusedError(f"{description}: it has no joint that turns or slides, so there is nothing to test")
    loads = _loads(description, [joint.name for joint in joints.values()])
    places = {joint: place for place, joint in enumerate(joints)}
    made = _Assumptions(_general_assumptions(description, mimics))
    parts = []
    for part, members in _parts(description, driven):
        rows = [_joint(joint, loads, places[joint.name], made) for joint in members]
        parts.append(f"[parts.{part}.joints]\n" + "\n".join(rows) + "\n")
    assumed = made.sentences()
    away = np.round(loads.centre + np.array([1.4, 1.0, 0.5]) * max(loads.extent, 0.3), 3)
    listed = "\n".join(f"    {_quoted(line)}," for line in assumed)
    text = _HEAD.format(name=name, source=source, assumed=listed) + "\n" + "\n".join(parts)
    centre = ", ".join(f"{value:.3f}" for value in loads.centre)
    text += (
        f"\n[scene]\nfloor = {loads.lowest:.3f}\ncentre = [{centre}]\n"
        f"outside = [{', '.join(map(str, away.tolist()))}]\n"
    )
    return Draft(text, len(driven), assumed)


_HEAD = """\
# A draft, made from the description alone. What stands in 'assumed' is not known of this robot: measure it, or take it
# from its data sheet, correct the values below, and delete the line. Then 'rtf robot check' looks at it once more.

schema = 1
name = "{name}"
profile = "unvalidated"
assumed = [
{assumed}
]

[description]
{source}

[motors.assumed]
rotor_resolution = 4096   # ticks a turn
nominal_current = 2.5     # A
peak_current = 5.0
overload_current = 15.0

[defaults]
motor = "assumed"
gearbox = 100.0

[thresholds.JointLimits]  # drives that carry much of their torque need the rest to reach a limit
origin = "unvalidated"
outputLimitPercent = 95
"""


def _general_assumptions(description: Path, mimics: Sequence[str]) -> list[str]:
    found = [
        "motors: encoders of 4096 ticks a turn, 2.5 A nominal, 5 A peak, behind gears of 100:1, without couplings",
        (
            "windings: the peak current gives the greatest torque; at rest the supply drives that current, and without "
            "load it turns the motor twice as fast as the joint may move"
        ),
        (
            f"armature: {_ROTOR:g} of the greatest inertia of the links that a joint moves, at least what the greatest "
            f"torque brings to the greatest speed in {1000 * _TIME_CONSTANT:g} ms"
        ),
        (
            f"friction: {_DRY:.0%} of the greatest torque dry, {_VISCOUS:.0%} of it viscous at the greatest speed, or "
            f"less; at rest {STRIBECK:.0%} more"
        ),
        "no outlines: the links do not collide; no sensors, no torque control, no joints that move together",
    ]
    if mimics:
        found.append(f"left out, as they follow other joints: {', '.join(mimics)}")
    if description.suffix.lower() == ".urdf":
        found += repair(load_description(description, shapes=False, repaired=False))
        if bare := unusable_meshes(description):
            found.append(f"drawn as capsules, as their meshes are missing or not STL or OBJ: {', '.join(bare)}")
    return found


def _joint(joint: JointDescription, loads: _Loads, place: int, made: _Assumptions) -> str:
    """Return the line of a joint."""
    words = []
    most_way = _SLIDE if joint.prismatic else _TURN
    low, high = joint.limits or (-most_way, most_way)
    radian = math.degrees(SHARE * (high - low)) if joint.prismatic else 1.0  # m that stand for one
    if joint.limits is None:
        words.append(f"limits = [{low}, {high}]")
        made.lines.append(
            f"{joint.name}: the description has no limits for it, or no range between them; {low:g} to {high:g}"
        )
    torque = joint.effort or 0.0
    need, inertia = float(loads.gravity[place]), float(loads.inertia[place])
    if torque < _BEARING * need or not torque:
        torque = float(f"{max(_STRENGTH * need, _WEAKEST):.3g}")
        reason = f"less than gravity needs of a motor ({_BEARING * need:.3g})" if joint.effort else "none"
        made.lines.append(f"{joint.name}: its effort in the description is {joint.effort or 0:g}, {reason}; {torque:g}")
        words.append(f"max_torque = {torque}")
    rotor = max(_ROTOR * inertia, joint.armature)
    speed = _speed(joint, high - low, radian, (torque - need) / (inertia + rotor), made)
    words.append(f"max_velocity = {speed:.6g}")
    swiftest = speed if joint.prismatic else math.radians(speed)
    rotor = max(rotor, _TIME_CONSTANT * torque / swiftest)
    words.append(f"armature = {rotor:.3g}")
    friction, damping = _friction(joint, torque, swiftest, (rotor, radian), made.lines)
    words.append(f"friction = {friction:.3g}")
    words.append(f"damping = {damping:.3g}")
    if joint.prismatic:
        words.append("prismatic = true")
        words.append("gearbox = 1000.0")
    return f"{_key(joint.name)} = {{ {', '.join(words)} }}"


def _speed(joint: JointDescription, way: float, radian: float, acceleration: float, made: _Assumptions) -> float:
    """Return the greatest speed of a joint (deg/s, m/s), and note if it is less than that of the description.

    ``way`` is its range (deg, m), ``radian`` what stands for a radian, and ``acceleration`` (rad/s², m/s²) what the
    torque that gravity leaves gives to the whole inertia.
    """
    bench = min(_FAST_SLIDE, math.radians(_FAST) * radian) if joint.prismatic else _FAST
    speed = joint.max_velocity or bench / 2
    scale = 1.0 if joint.prismatic else math.degrees(1.0)
    followed = math.sqrt(_ACCELERATING * acceleration * scale * way / 2 / _JERK)
    if speed > min(bench, followed):
        (made.slowed if bench <= followed else made.heavy).append(joint.name)
    return min(speed, bench, followed)


def _friction(
    joint: JointDescription, torque: float, speed: float, rotor: tuple[float, float], assumed: list[str]
) -> tuple[float, float]:
    """Return dry (Nm, N) and viscous friction: the description's, unless a position loop could not overcome it.

    ``speed`` is the greatest one (rad/s, m/s); ``rotor`` its inertia, and what stands for a radian: 1, or the metres
    of a slide.
    """
    inertia, radian = rotor
    swing = 2 * math.pi * BANDWIDTH
    most_dry, most_viscous = _SLACK * radian * inertia * swing**2, 2 * _SHARE * inertia * swing
    dry = min(_DRY * torque, most_dry)
    viscous = min(_VISCOUS * torque / speed, most_viscous)
    if (
        joint.friction > min(_LOST * most_dry, _MOST_DRY * torque / (1 + STRIBECK))
        or joint.damping > _LOST * most_viscous
    ):
        assumed.append(
            f"{joint.name}: too much friction in the description for its drive ({joint.friction:g} dry, "
            f"{joint.damping:g} viscous); {dry:.2g} and {viscous:.2g}"
        )
        return dry, viscous
    return joint.friction or dry, joint.damping or viscous


def _loads(description: Path, names: Sequence[str]) -> _Loads:
    """Compute the loads in random poses within the limits, with the root fixed."""
    engine = mujoco()
    spec = load_description(description, shapes=False)
    fix_root(spec)
    model = spec.compile()
    data = engine.MjData(model)
    random = np.random.default_rng(0)
    dofs = np.array([int(model.joint(name).dofadr[0]) for name in names])
    places = np.array([int(model.joint(name).qposadr[0]) for name in names])
    limited = np.array([bool(model.jnt_limited[model.joint(name).id]) for name in names])
    ranges = np.array([model.joint(name).range for name in names])
    ranges[~limited] = -math.pi, math.pi
    gravity = np.zeros(len(names))
    inertia = np.zeros(len(names))
    full = np.zeros((model.nv, model.nv))
    for _ in range(_POSES):
        data.qpos[places] = random.uniform(ranges[:, 0], ranges[:, 1])
        engine.mj_forward(model, data)
        np.maximum(gravity, np.abs(data.qfrc_bias[dofs]), out=gravity)
        engine.mj_fullM(model, data, full)
        np.maximum(inertia, np.diag(full)[dofs], out=inertia)
    engine.mj_resetData(model, data)
    engine.mj_forward(model, data)
    bodies = data.xpos[1:]
    extent = float(np.linalg.norm(bodies.max(axis=0) - bodies.min(axis=0))) if len(bodies) else 1.0
    return _Loads(gravity, inertia, bodies.mean(axis=0), extent, float(bodies[:, 2].min()) - 0.1)


def _mimics(description: Path) -> list[str]:
    """Return the joints of a URDF that follow others."""
    return [str(joint.get("name")) for joint in urdf_joints(description) if joint.find("mimic") is not None]


def _parts(description: Path, driven: Sequence[JointDescription]) -> list[tuple[str, list[JointDescription]]]:
    """Split the joints into chains, a part each: a new one begins where the tree of links branches.

    Single joints that hang on one link, such as the fingers of a gripper, are one part together.
    """
    spec = load_description(description, shapes=False)
    by_body = {joint.body: joint for joint in driven}
    chains: list[list[JointDescription]] = []

    def walk(body: Any, chain: list[JointDescription]) -> None:
        below = [child for child in body.bodies if _leads_to(child, by_body)]
        for child in below:
            own = chain if len(below) == 1 else []
            if own is not chain:
                chains.append(own)
            if child.name in by_body:
                own.append(by_body[child.name])
            walk(child, own)
        single = [chain for chain in chains if len(chain) == 1 and chain[0].body in {child.name for child in below}]
        if len(single) > 1:
            for one in single[1:]:
                single[0].extend(one)
                chains.remove(one)

    first: list[JointDescription] = []
    chains.append(first)
    walk(spec.worldbody, first)
    found: dict[str, list[JointDescription]] = {}
    for chain in chains:
        if chain:
            name = _part_name([joint.name for joint in chain])
            while name in found:
                name += "_2"
            found[name] = chain
    return list(found.items())


def _leads_to(body: Any, by_body: dict[str, JointDescription]) -> bool:
    return body.name in by_body or any(_leads_to(child, by_body) for child in body.bodies)


def _part_name(names: list[str]) -> str:
    """Return what the names of joints begin with, such as ``arm_left`` of ``arm_left_1_joint``, else the first name."""
    words = [re.split(r"[^A-Za-z0-9]+", name) for name in names]
    common = []
    for several in zip(*words, strict=False):
        if len(set(several)) > 1 or several[0].isdigit() or several[0] == "joint":
            break
        common.append(several[0])
    chosen = "_".join(common) or re.sub(r"[^A-Za-z0-9]+", "_", names[0]).strip("_").removesuffix("_joint")
    return chosen or "joints"


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _quoted(name)


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
