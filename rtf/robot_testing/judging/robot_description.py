"""Finding the URDF description that a test compares the robot with."""

from __future__ import annotations

from rtf.resources import DEFAULT_CONTEXT, ResourceFinder
from rtf.robot_testing.judging.kinematics import KinematicModel
from rtf.simulator.engine import robot_description


def read_description(name: str = "", robot: str = "") -> KinematicModel:
    """Return the kinematics of a URDF file, found where YARP looks for files of this robot.

    Without a name it is the published description of the iCub. Raises ResourceNotFoundError with the searched places,
    DescriptionError, or MissingPackageError if the published one is not installed: all are RtfErrors.
    """
    if not name:
        return KinematicModel.read(robot_description())
    return KinematicModel.read(ResourceFinder(contexts=[DEFAULT_CONTEXT], robot=robot).find(name))
