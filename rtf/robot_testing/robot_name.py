"""The robot under test: the prefix of its port names, and its model."""

from __future__ import annotations

import os
from functools import cache
from typing import TYPE_CHECKING

from rtf.robot.model import default_robot, load_robot

if TYPE_CHECKING:
    from rtf.robot.model import RobotModel
    from rtf.testing.parameters import Declared

#: The environment variable with the name of the robot; a fixture that starts a robot sets it.
ROBOT_VARIABLE = "YARP_ROBOT_NAME"


def robot_name(given: str, asking: Declared, otherwise: str) -> str:
    """Return the robot's name: ``given``, or that of the suite, of the environment, or ``otherwise``, in this order."""
    suite = asking.suite_value("robotname")
    return (given or suite or os.environ.get(ROBOT_VARIABLE) or otherwise).strip("/")


#: A test asks for its robot several times, and the file stays as it is meanwhile.
_read_once = cache(load_robot)


def robot_model(asking: Declared) -> RobotModel:
    """Return the robot as data: that of ``--robotmodel`` of the suite, of the fixture that started it, else the iCub.

    Raises RobotModelError for one that cannot be found or read.
    """
    named = asking.suite_value("robotmodel")
    return _read_once(named) if named else default_robot()
