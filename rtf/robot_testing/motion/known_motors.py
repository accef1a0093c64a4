"""Motors of a part as robot.toml says them, and what their currents say against them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot.errors import NotSupportedError, RefusedError
from rtf.robot_testing.judging.blame import Evidence
from rtf.robot_testing.judging.motor_model import MotorRun, interruption, wrong_motor

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from numpy.typing import NDArray

    from rtf.robot.boards.client import RemoteBoard
    from rtf.robot.interfaces import FloatArray
    from rtf.robot.model import RobotModel
    from rtf.robot.model.drives import Drive


#: The fewest states with power that are judged.
_FEWEST = 30


class KnownMotor(NamedTuple):
    """A motor: its drive, its supply now (V), its peak current (A), and whether the drive's winding is known."""

    drive: Drive
    supply: float
    peak: float
    known: bool


class MotorStates(NamedTuple):
    """The last moments of the motors of a part: duty cycles (%), currents (A), rotor speeds (deg/s); (states, axes).

    ``powered`` says in which a motor has power: without, its circuit is open, and a speed drives no current.
    """

    duties: FloatArray
    currents: FloatArray
    speeds: FloatArray
    powered: NDArray[np.bool_]


def known_motors(
    board: RemoteBoard, names: Sequence[str], model: RobotModel, *, simulated: bool
) -> dict[int, KnownMotor]:
    """Return the motors of a part that the model of the robot has."""
    found = {}
    for joint, name in enumerate(names):
        if name in model.index:
            axis = model.axis(name)
            try:
                supply = board.supply_voltage(joint)
            except (NotSupportedError, RefusedError):
                supply = 0.0
            known = simulated or not axis.drive.assumed
            found[joint] = KnownMotor(axis.drive, supply or axis.drive.supply, axis.peak_current, known=known)
    return found


def motor_evidence(
    states: MotorStates, motors: Mapping[int, KnownMotor], names: Sequence[str], concerned: Collection[int]
) -> list[Evidence]:
    """Return the evidence on the ``concerned`` motors whose currents are not those of their drives.

    Of the others only that their current is interrupted: one that jerks shakes all of the part. Motors that are not
    known, or that have hardly moved, are no evidence.
    """
    found = []
    for motor, one in motors.items():
        there = states.powered[:, motor]
        columns = states.duties[there, motor], states.currents[there, motor], states.speeds[there, motor]
        if not one.known or there.sum() < _FEWEST or not all(np.isfinite(column).all() for column in columns):
            continue
        judge = wrong_motor if motor in concerned else interruption
        if wrong := judge(MotorRun(*columns, one.drive, one.supply)):
            text = f"the motor of {names[motor]}: {wrong.text}"
            found.append(Evidence(frozenset({motor}), text, (wrong.finding,)))
    return found
