"""Torque control: the joints of a part that have it, and the measured torques that hold them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.bottle import as_int, as_list
from rtf.robot.errors import NotSupportedError, RefusedError, StaleStateError
from rtf.robot_testing.guard.snapshot import answered
from rtf.robot_testing.judging.failure_causes import likely_causes
from rtf.robot_testing.motion.part import PACE
from rtf.robot_testing.motion.routines import pause, run_to_end

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.boards.client import RemoteBoard
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.motion.part import Part
    from rtf.robot_testing.motion.routines import Routine
    from rtf.robot_testing.robot_test import RobotTest

#: The remote variable with its flags: a list for each board, with a flag for each joint.
TORQUE_VARIABLE = "torqueControlEnabled"


def torque_joints(test: RobotTest, part: Part, wanted: Sequence[int]) -> list[int]:
    """Return the wanted joints; without any, all joints that have torque control.

    The test is skipped if no joint has it, and ends with an error if a wanted joint has not. If the part does not
    report which joints have it, the wanted ones are accepted with a warning.
    """
    chosen = test.select(part, wanted)
    try:
        enabled = torque_flags(part)
    except (NotSupportedError, RefusedError) as error:
        text = f"{part.name} does not report which joints have torque control ({error})"
        if not wanted:
            test.skip(f"{text}: name them by the parameter joints")
        test.warn(f"{text}: the named joints are assumed to have it")
        return chosen
    without = [part.names[joint] for joint in chosen if not enabled[joint]]
    if wanted:
        test.assert_error_if_true(without, f"no torque control: {', '.join(without)}; choose other joints")
        return chosen
    if len(without) == len(chosen):
        test.skip(f"no joint of {part.name} has torque control")
    return [joint for joint in chosen if enabled[joint]]


def torque_flags(part: Part) -> list[bool]:
    """Return whether each joint has torque control.

    Raises NotSupportedError or RefusedError if the board does not report it.
    """
    answer = part.board.variable(TORQUE_VARIABLE)
    flags = [bool(as_int(flag)) for one in answer for flag in (as_list(one) or [one])]
    if len(flags) != part.axes:
        raise RefusedError(f"{part.name}: {TORQUE_VARIABLE} has {len(flags)} flags for {part.axes} joints")
    return flags


def greatest_torque(board: RemoteBoard, joint: int) -> float | None:
    """Return the greatest torque of a joint (Nm); None if the board does not report it, as is common."""
    return answered(lambda: max(map(abs, board.torque_range(joint)))) or None


def mean_torques(part: Part, seconds: float) -> FloatArray:
    """Return the mean measured torques of a part's joints (Nm) over ``seconds``. RobotError if there are none."""
    return run_to_end(part, measuring_torques(part, seconds), pace=PACE)


def measuring_torques(part: Part, seconds: float) -> Routine[FloatArray]:
    """Return the routine of ``mean_torques``."""
    torques = yield from _recording(part, seconds)
    means: FloatArray = torques.mean(axis=0)
    return means


def holding_torques(test: RobotTest, part: Part, joints: Sequence[int], seconds: float) -> Routine[FloatArray]:
    """Return the routine of ``mean_torques``, for torques by which joints are then held.

    The test ends with an error if the torque of one of ``joints`` is not measured, or any torque of the part is not
    finite: joints that share motors are held by theirs, too. A measured torque never stays constant to the last bit;
    one without an estimator does, at first at 0. A simulated joint at rest may have a constant torque other than 0.
    """
    torques = yield from _recording(part, seconds)
    if len(torques) >= _FEWEST:
        still = [joint for joint in joints if np.ptp(torques[:, joint]) == 0.0]
        dead = [joint for joint in still if torques[0, joint] == 0.0 or not test.simulated]
        shown = ", ".join(f"{part.names[joint]} ({part.shown_torque(joint, torques[0, joint], 'g')})" for joint in dead)
        test.assert_error_if_true(
            dead,
            f"the measured torque does not change at all in {seconds:g} s: {shown}; {likely_causes('torque dead')}",
        )
    means: FloatArray = torques.mean(axis=0)
    unknown = ", ".join(part.names[joint] for joint in np.flatnonzero(~np.isfinite(means)))
    test.assert_error_if_true(unknown, f"the measured torque is not finite: {unknown}; {likely_causes('torque dead')}")
    return means


def _recording(part: Part, seconds: float) -> Routine[FloatArray]:
    """Record the torques of all joints; shape (states, joints)."""
    with part.recorded() as trace:
        yield from pause(part.clock, seconds)
    if not len(trace):
        raise StaleStateError(f"{part.name} published no state in {seconds:g} s")
    part.board.torques()  # NotSupportedError if the states mark their torques as invalid
    rows: FloatArray = np.asarray(trace.torques, dtype=np.float64)
    return rows


#: Least number of states to tell that a torque does not change.
_FEWEST = 3
