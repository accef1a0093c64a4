"""The name of the robot under test: the prefix of its port names."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rtf.testing.parameters import Declared

#: The environment variable with the name of the robot; a fixture that starts a robot sets it.
ROBOT_VARIABLE = "YARP_ROBOT_NAME"


def robot_name(given: str, asking: Declared, otherwise: str) -> str:
    """Return the robot's name: ``given``, or that of the suite, of the environment, or ``otherwise``, in this order."""
    suite = asking.suite_value("robotname")
    return (given or suite or os.environ.get(ROBOT_VARIABLE) or otherwise).strip("/")
