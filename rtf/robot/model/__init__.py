"""Robots as data: a folder with a ``robot.toml`` beside, or pointing to, a description in URDF or MJCF.

A :class:`RobotModel` is read by :func:`load_robot` and passed to whatever needs the robot's parts, axes, limits,
couplings and sensors: the simulator, the guard, the tests, the faults. No module knows a robot by itself.
"""

from rtf.robot.model.errors import RobotModelError
from rtf.robot.model.names import DEFAULT_ROBOT, ROBOT_MODEL_VARIABLE
from rtf.robot.model.reader import default_robot, find_robot, load_robot, robot_names
from rtf.robot.model.values import Axis, Coupling, Part, RobotModel
from rtf.robot.model.workspace import HalfSpace, Workspace, WorkspacePoint

__all__ = [
    "DEFAULT_ROBOT",
    "ROBOT_MODEL_VARIABLE",
    "Axis",
    "Coupling",
    "HalfSpace",
    "Part",
    "RobotModel",
    "RobotModelError",
    "Workspace",
    "WorkspacePoint",
    "default_robot",
    "find_robot",
    "load_robot",
    "robot_names",
]
