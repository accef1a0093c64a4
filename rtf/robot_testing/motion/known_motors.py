"""Motors of a part as robot.toml says them, and what their currents say against them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot.errors import NotSupportedError, RefusedError
from rtf.robot.extended_state import Field
from rtf.robot_testing.judging.blame import Evidence, Strength, accused
from rtf.robot_testing.judging.motor_model import LOOSE_CONTACT, wrong_motor
from rtf.robot_testing.motion.stop_evidence import stop_evidence

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from rtf.robot.model import RobotModel
    from rtf.robot.model.drives import Drive
    from rtf.robot_testing.motion.part import Part

#: The time in which currents are compared with duty cycles, s: that of two steps.
_COMPARED = 5.0
_NEEDED = (Field.MOTOR_VELOCITIES, Field.DUTY_CYCLES, Field.CURRENTS)


class KnownMotor(NamedTuple):
    """A motor: its drive, its supply now (V), its peak current (A), and whether the drive's winding is known."""

    drive: Drive
    supply: float
    peak: float
    known: bool


def known_motors(part: Part, model: RobotModel, joints: Collection[int], *, simulated: bool) -> dict[int, KnownMotor]:
    """Return the motors of some joints that the model of the robot has."""
    found = {}
    for joint in joints:
        if part.names[joint] in model.index:
            axis = model.axis(part.names[joint])
            try:
                supply = part.board.supply_voltage(joint)
            except (NotSupportedError, RefusedError):
                supply = 0.0
            known = simulated or not axis.drive.assumed
            found[joint] = KnownMotor(axis.drive, supply or axis.drive.supply, axis.peak_current, known=known)
    return found


def motor_evidence(part: Part, motors: Mapping[int, KnownMotor]) -> list[Evidence]:
    """Return the evidence on motors whose currents in the last seconds are not those of their drives.

    Motors that are not known, or that have hardly moved, are no evidence.
    """
    states = part.history.copy()
    if not len(states) or not all(states.newest[1].valid[field] for field in _NEEDED):
        return []
    time = states.time
    recent = time > time[-1] - _COMPARED
    duties, currents, speeds = (
        column[recent] for column in (states.duty_cycles, states.currents, states.motor_velocities)
    )
    found = []
    for motor, one in motors.items():
        columns = duties[:, motor], currents[:, motor], speeds[:, motor]
        if not one.known or not all(np.isfinite(column).all() for column in columns):
            continue
        if wrong := wrong_motor(*columns, one.drive, one.supply):
            text = f"the motor of {part.names[motor]}: {wrong.text}"
            found.append(Evidence(frozenset({motor}), text, (wrong.finding,)))
    return found


def disturbance(part: Part, joint: int, model: RobotModel, *, simulated: bool) -> str:
    """Return what disturbs a joint: another one that is broken or limp; "" if none is, or this joint is accused.

    A value out of bounds is no fault of a joint that another one shook meanwhile, or that a limp one carries, or that
    shares a motor which does not give what its drive says. One whose motor is interrupted shakes all of them.
    """
    sharing = {joint} if part.guard is None else {joint, *part.guard.coupled_with(joint)}
    motors = motor_evidence(part, known_motors(part, model, range(part.axes), simulated=simulated))
    found = [*stop_evidence(part), *(one for one in motors if one.joints & sharing or LOOSE_CONTACT in one.findings)]
    wrong = accused(one for one in found if one.strength is Strength.CERTAIN)
    if joint in wrong:
        return ""
    if wrong:
        return f"it was disturbed: {next(iter(wrong.values())).text}"
    return limpness(part, joint)


def limpness(part: Part, joint: int) -> str:
    """Return which other joints were left without power, as a reason why a joint is disturbed; "" if none."""
    if part.guard is None:
        return ""
    limp = [part.names[one] for one in range(part.axes) if one != joint and part.guard.is_excluded(one)]
    return f"it was disturbed: without power are {', '.join(limp)}" if limp else ""
