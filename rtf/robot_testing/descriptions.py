"""Finding the description of a robot that a test compares with."""

from __future__ import annotations

from rtf.resources import DEFAULT_CONTEXT, ResourceFinder
from rtf.robot_testing.kinematics import KinematicModel
from rtf.simulator.engine import robot_description


def read_description(name: str = "", robot: str = "") -> KinematicModel:
    """The kinematics of a URDF file, found where YARP looks for files of this robot; without a name the published one.

    Raises ResourceNotFoundError with the places, DescriptionError, and MissingPackageError where the published one is
    not installed: all are RtfErrors.
    """
    if not name:
        return KinematicModel.read(robot_description())
    return KinematicModel.read(ResourceFinder(contexts=[DEFAULT_CONTEXT], robot=robot).find(name))
