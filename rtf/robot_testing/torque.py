"""Which joints of a part have torque control, and the torque that holds them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.bottle import as_int, as_list
from rtf.robot.errors import NotSupportedError, RefusedError
from rtf.robot_testing.courses import finish, pause
from rtf.robot_testing.part import PACE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.case import RobotTest
    from rtf.robot_testing.courses import Course
    from rtf.robot_testing.part import Part

#: The remote variable that says it: lists of a flag a joint, one for each board.
TORQUE_VARIABLE = "torqueControlEnabled"


def torque_joints(test: RobotTest, part: Part, wanted: Sequence[int]) -> list[int]:
    """The joints that are wanted; without any, all that have torque control.

    Skips the test when there are none, and ends it as an error when one that is wanted has none.
    """
    enabled = _enabled(part)
    chosen = test.select(part, wanted)
    without = [part.names[joint] for joint in chosen if not enabled[joint]]
    if wanted:
        test.assert_error_if_true(without, f"no torque control: {', '.join(without)}; choose other joints")
        return chosen
    if len(without) == len(chosen):
        test.skip(f"no joint of {part.name} has torque control")
    return [joint for joint in chosen if enabled[joint]]


def _enabled(part: Part) -> list[bool]:
    """By what the board says; one that does not say it is taken to have it everywhere."""
    try:
        told = part.board.variable(TORQUE_VARIABLE)
    except (NotSupportedError, RefusedError):
        return [True] * part.axes
    flags = [bool(as_int(flag)) for one in told for flag in (as_list(one) or [one])]
    if len(flags) != part.axes:
        raise RefusedError(f"{part.name}: {TORQUE_VARIABLE} has {len(flags)} flags for {part.axes} joints")
    return flags


def mean_torques(part: Part, seconds: float) -> FloatArray:
    """What is measured at the joints of a part (Nm), the mean over so long. ValueError when no state comes."""
    return finish(part, measuring_torques(part, seconds), pace=PACE)


def measuring_torques(part: Part, seconds: float) -> Course[FloatArray]:
    """The same as a course."""
    with part.recorded() as trace:
        yield from pause(part.clock, seconds)
    if not len(trace):
        raise ValueError(f"{part.name} published no state in {seconds:g} s")
    means: FloatArray = np.asarray(trace.torques, dtype=np.float64).mean(axis=0)
    return means
