"""Which robot is meant: what the names of its ports begin with."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rtf.testing.parameters import Declared

#: Which robot, where neither a parameter nor the suite says it; given by the fixture that starts one.
ROBOT_VARIABLE = "YARP_ROBOT_NAME"


def robot_name(given: str, asking: Declared, otherwise: str) -> str:
    """The robot that is ``given``, or else that of the suite of the test or fixture, of the environment, or another."""
    suite = asking.suite_value("robotname")
    return (given or suite or os.environ.get(ROBOT_VARIABLE) or otherwise).strip("/")
