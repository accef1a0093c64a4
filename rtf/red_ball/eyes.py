"""The eyes of a robot by its description: where its cameras are, by the positions of its joints.

The cameras sit where the description, with its attached bodies, puts them, so a point that both see is where it is on a
simulated robot. Tables of Denavit and Hartenberg have the middle of an eye instead, some millimetres elsewhere.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot.errors import RefusedError
from rtf.robot.kinematics import Eyes, Pinhole, described_chain
from rtf.robot.kinematics.poses import homogeneous
from rtf.robot.model.bodies import attach_bodies
from rtf.robot.model.description import load_description
from rtf.robot.model.engine import mujoco

if TYPE_CHECKING:
    from typing import Any

    from rtf.robot.interfaces import FloatArray
    from rtf.robot.model import RobotModel

#: From a camera of MuJoCo, which looks along its -z with y up, to one that looks along z with y down.
_LOOKING = np.diag([1.0, -1.0, -1.0])


class Cameras(NamedTuple):
    """Two cameras on a head."""

    eyes: Eyes
    #: The axes of the robot that move them, in the order of the positions of ``eyes``.
    joints: tuple[str, ...]


def cameras_of(robot: RobotModel, left: str = "left", right: str = "right") -> Cameras:
    """Return the cameras of a robot, by their names in its robot.toml.

    Raises RefusedError for a camera that it does not have, or that is no eye: one behind a joint of its own, which is
    behind a joint of both. Raises also MissingPackageError and RobotModelError.
    """
    spec = load_description(robot.description, shapes=False)
    attach_bodies(spec, robot)
    chains = [_chain_of(robot, spec, name) for name in (left, right)]
    pan = {chain.joints[-1] for chain in chains}
    shared = chains[0].joints[:-1]
    if len(pan) != len(chains) or any(chain.joints[:-1] != shared for chain in chains):
        raise RefusedError(f"{robot.name}: the cameras {left} and {right} are no eyes with a pan of their own each")
    tilt = next(body.parent.name for body in spec.bodies for joint in body.joints if joint.name == shared[-1])
    eyes = Eyes(chains[0], chains[1], described_chain(robot, tilt))
    axes = [axis.name for part in robot.parts.values() for axis in part.axes]
    version, vergence = (_axis(robot, axes, end) for end in ("version", "vergence"))
    return Cameras(eyes, (*shared, version, vergence))


def _chain_of(robot: RobotModel, spec: Any, name: str) -> Any:
    tables = robot.sensors.cameras
    if name not in tables:
        raise RefusedError(f"{robot.name} has no camera {name!r}; it has {', '.join(tables) or 'none'}")
    camera = next(one for one in spec.cameras if one.name == tables[name].camera)
    turn = np.empty(9)
    mujoco().mju_quat2Mat(turn, np.asarray(camera.quat))
    tip = homogeneous(turn.reshape(3, 3) @ _LOOKING, camera.pos)
    return described_chain(robot, camera.parent.name).with_tip(tip)


def _axis(robot: RobotModel, axes: list[str], end: str) -> str:
    found = [name for name in axes if name.endswith(f"_{end}") or name == end]
    if len(found) != 1:
        raise RefusedError(f"{robot.name} has no axis for the {end} of its eyes, but {', '.join(axes)}")
    return found[0]


def pinhole(width: int, height: int, vertical: float) -> Pinhole:
    """Return a camera without distortion by the size of its pictures and its vertical field of view (deg)."""
    focal = height / 2.0 / math.tan(math.radians(vertical) / 2.0)
    return Pinhole(width, height, focal, focal, width / 2.0, height / 2.0)


def in_root(place: FloatArray, pose: FloatArray) -> FloatArray:
    """Return a place in the frame of a camera (m) in that of the root, by the camera's pose (4, 4)."""
    found: FloatArray = pose[:3, :3] @ place + pose[:3, 3]
    return found
