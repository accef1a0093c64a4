"""Chains from a robot's description, URDF or MJCF, with the bodies that its robot.toml attaches."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from rtf.errors import did_you_mean
from rtf.robot.errors import RefusedError
from rtf.robot.kinematics.chain import Chain, Link
from rtf.robot.kinematics.poses import homogeneous
from rtf.robot.model.bodies import attach_bodies
from rtf.robot.model.description import fix_root, load_description
from rtf.robot.model.engine import mujoco

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.robot.model import RobotModel


def described_chain(robot: RobotModel, tip: str, root: str = "") -> Chain:
    """Return the chain from one link of the description to another, or from its root.

    The root is the base link of a URDF, the world of an MJCF. Joints are named as in the description, and have the
    limits of the robot's axes of these names, else those of the description, else none (of a turn to either side). A
    joint that is moved by an axis of another name, as the outer joints of fingers, has the limits of the description.

    Raises RefusedError for unknown links, for one that does not carry the other, and for a ball joint between them;
    also ConfigurationError and MissingPackageError, as :func:`~rtf.robot.model.description.load_description`.
    """
    spec = load_description(robot.description, shapes=False)
    spec.compiler.fusestatic = False  # which would remove the frames of hands and feet
    fix_root(spec)
    attach_bodies(spec, robot)
    model = spec.compile()
    bodies = {model.body(number).name: number for number in range(model.nbody)}
    for name in filter(None, (tip, root)):
        if name not in bodies:
            raise RefusedError(f"{robot.description}: there is no link {name!r}{did_you_mean(name, bodies)}")
    path = _path(model, bodies[tip], bodies.get(root, 0))
    if path is None:
        raise RefusedError(f"{robot.description}: {root} does not carry {tip}")
    links: list[Link] = []
    base = np.eye(4)
    for body in path:
        base = _add(model, body, links, base)
    return Chain(tip, tuple(links), base).limited_by(axis for axis in robot.axes if axis.ratio == 1.0)


def _path(model: Any, tip: int, root: int) -> list[int] | None:
    """Return the bodies from the one behind the root to the tip; None if the root does not carry it."""
    path: list[int] = []
    while tip != root:
        if tip == 0:
            return None
        path.append(tip)
        tip = int(model.body_parentid[tip])
    return path[::-1]


def _add(model: Any, body: int, links: list[Link], base: NDArray[np.float64]) -> NDArray[np.float64]:
    """Add a body and its joints to a chain; return the base, which has what comes before the first joint."""

    def then(frame: NDArray[np.float64]) -> None:
        nonlocal base
        if links:
            links[-1] = replace(links[-1], frame=links[-1].frame @ frame)
        else:
            base = base @ frame

    kinds = mujoco().mjtJoint
    then(homogeneous(_rotation(model.body_quat[body]), model.body_pos[body]))
    first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
    for number in range(first, first + count):
        name, kind = model.joint(number).name, int(model.jnt_type[number])
        if kind not in (int(kinds.mjJNT_HINGE), int(kinds.mjJNT_SLIDE)):
            raise RefusedError(f"{name}: the joints of a chain turn about one axis, or slide along it")
        slides = kind == int(kinds.mjJNT_SLIDE)
        low, high = (-math.pi, math.pi) if not model.jnt_limited[number] else model.jnt_range[number]
        unit = 1.0 if slides else math.degrees(1.0)
        x, y, z = (float(value) for value in model.jnt_axis[number])
        anchor = model.jnt_pos[number]
        then(homogeneous(np.eye(3), anchor))
        behind = homogeneous(np.eye(3), -anchor)
        links.append(Link(name, float(low) * unit, float(high) * unit, behind, (x, y, z), prismatic=slides))
    return base


def _rotation(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    matrix = np.empty(9)
    mujoco().mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)
