"""Which joints of a part have torque control, and the torque that holds them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.bottle import as_int, as_list
from rtf.robot.errors import NotSupportedError, RefusedError, StaleStateError
from rtf.robot_testing.causes import likely_causes
from rtf.robot_testing.courses import finish, pause
from rtf.robot_testing.part import PACE
from rtf.robot_testing.snapshot import answered

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.client.control_board import RemoteControlBoard
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.case import RobotTest
    from rtf.robot_testing.courses import Course
    from rtf.robot_testing.part import Part

#: The remote variable that says it: lists of a flag a joint, one for each board.
TORQUE_VARIABLE = "torqueControlEnabled"


def torque_joints(test: RobotTest, part: Part, wanted: Sequence[int]) -> list[int]:
    """The joints that are wanted; without any, all that have torque control.

    Skips the test when there are none, and ends it as an error when one that is wanted has none. Of a part that does
    not say which have it those that are wanted are taken.
    """
    chosen = test.select(part, wanted)
    try:
        enabled = torque_flags(part)
    except (NotSupportedError, RefusedError) as error:
        text = f"{part.name} does not say which joints have torque control ({error})"
        if not wanted:
            test.skip(f"{text}: name those that have it by the parameter joints")
        test.warn(f"{text}: those that are named are taken to have it")
        return chosen
    without = [part.names[joint] for joint in chosen if not enabled[joint]]
    if wanted:
        test.assert_error_if_true(without, f"no torque control: {', '.join(without)}; choose other joints")
        return chosen
    if len(without) == len(chosen):
        test.skip(f"no joint of {part.name} has torque control")
    return [joint for joint in chosen if enabled[joint]]


def torque_flags(part: Part) -> list[bool]:
    """Whether each joint has torque control. NotSupportedError or RefusedError where the board does not say it."""
    told = part.board.variable(TORQUE_VARIABLE)
    flags = [bool(as_int(flag)) for one in told for flag in (as_list(one) or [one])]
    if len(flags) != part.axes:
        raise RefusedError(f"{part.name}: {TORQUE_VARIABLE} has {len(flags)} flags for {part.axes} joints")
    return flags


def greatest_torque(board: RemoteControlBoard, joint: int) -> float | None:
    """The most that a joint can exert (Nm); None where the board does not say it, as many do not."""
    return answered(lambda: max(map(abs, board.torque_range(joint)))) or None


def mean_torques(part: Part, seconds: float) -> FloatArray:
    """What is measured at the joints of a part (Nm), the mean over so long. RobotError when no torques come."""
    return finish(part, measuring_torques(part, seconds), pace=PACE)


def measuring_torques(part: Part, seconds: float) -> Course[FloatArray]:
    """The same as a course."""
    torques = yield from _recording(part, seconds)
    means: FloatArray = torques.mean(axis=0)
    return means


def holding_torques(test: RobotTest, part: Part, joints: Sequence[int], seconds: float) -> Course[FloatArray]:
    """The same, before some joints are held by it. Ends as an error where nobody measures the torque of one of them.

    Nor may any of the part be no number: those that share motors with them are held by theirs, too.
    What is measured is never the same to the last bit for long; what nobody estimates any more is, and 0 at first. A
    simulated joint at rest may well be held by the same torque for long.
    """
    torques = yield from _recording(part, seconds)
    if len(torques) >= _FEWEST:
        still = [joint for joint in joints if np.ptp(torques[:, joint]) == 0.0]
        dead = [joint for joint in still if torques[0, joint] == 0.0 or not test.simulated]
        shown = ", ".join(f"{part.names[joint]} ({torques[0, joint]:g} Nm)" for joint in dead)
        test.assert_error_if_true(
            dead,
            f"the measured torque does not change at all in {seconds:g} s: {shown}; {likely_causes('torque dead')}",
        )
    means: FloatArray = torques.mean(axis=0)
    unknown = ", ".join(part.names[joint] for joint in np.flatnonzero(~np.isfinite(means)))
    test.assert_error_if_true(unknown, f"the measured torque is no number: {unknown}; {likely_causes('torque dead')}")
    return means


def _recording(part: Part, seconds: float) -> Course[FloatArray]:
    """The torques of all joints, a row a state."""
    with part.recorded() as trace:
        yield from pause(part.clock, seconds)
    if not len(trace):
        raise StaleStateError(f"{part.name} published no state in {seconds:g} s")
    part.board.torques()  # NotSupportedError where the states say that theirs mean nothing
    rows: FloatArray = np.asarray(trace.torques, dtype=np.float64)
    return rows


#: How many states it takes to say that a torque does not change.
_FEWEST = 3
