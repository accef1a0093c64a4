"""Finding the URDF description that a test compares the robot with."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.resources import DEFAULT_CONTEXT, ResourceFinder
from rtf.robot_testing.judging.kinematics import KinematicModel

if TYPE_CHECKING:
    from rtf.robot.model import RobotModel


def read_description(model: RobotModel, name: str = "", robot: str = "") -> KinematicModel:
    """Return the kinematics of a URDF file, found where YARP looks for files of this robot.

    Without a name it is the description of the robot ``model``. Raises ResourceNotFoundError with the searched places,
    and DescriptionError: both are RtfErrors.
    """
    if not name:
        return KinematicModel.read(model.description)
    return KinematicModel.read(ResourceFinder(contexts=[DEFAULT_CONTEXT], robot=robot).find(name))
