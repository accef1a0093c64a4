"""What disturbs a torque: evidence of the torque sensors of a part on the motors that its joints share."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.extended_state import Field
from rtf.robot_testing.guard.reactions import LIMP
from rtf.robot_testing.judging.blame import accused
from rtf.robot_testing.judging.torque_agreement import Group, torque_evidence
from rtf.robot_testing.motion.disturbance import disturbance
from rtf.robot_testing.torque_control import greatest_torque

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot_testing.guard.transmission import Transmission
    from rtf.robot_testing.judging.blame import Evidence
    from rtf.robot_testing.motion.part import Part

#: The time whose states are compared, s, and their fewest.
_COMPARED, _FEWEST = 0.5, 10
#: What friction may hide of the torque of a joint, as a share of the greatest one.
_FRICTION = 0.04
_LIMP = [int(mode) for mode in LIMP]


def torque_disturbance(part: Part, joint: int, motors: Sequence[Evidence]) -> str:
    """Return what disturbs a joint and its torque, see ``disturbance``: a motor that it shares may be weak, too.

    ``motors`` is the evidence of ``motors_by_torques``.
    """
    wrong = accused(motors)
    if joint in wrong:
        return ""
    if wrong:
        return f"it was disturbed: {next(iter(wrong.values())).text}"
    return disturbance(part, joint)


def weak_motor(joint: int, motors: Sequence[Evidence]) -> str:
    """Return that the motor of a joint gives another torque than by its current, and why that may be; "" if not."""
    own = accused(motors).get(joint)
    return own.sentence if own is not None else ""


def motors_by_torques(part: Part, transmission: Transmission, joint: int) -> list[Evidence]:
    """Return the evidence on the motors that a joint shares whose torque is not that of their current.

    There is none for a joint with a motor of its own, or where drives, currents or torques are not known.
    """
    group, states = transmission.coupled(joint), part.history.copy()
    known = all(one in part.motors and part.motors[one].known for one in group)
    if len(group) == 1 or not known or len(states) < _FEWEST:
        return []
    if not all(states.newest[1].valid[field] for field in (Field.CURRENTS, Field.TORQUES)):
        return []
    last = states.time > states.time[-1] - _COMPARED
    if last.sum() < _FEWEST or np.isin(states.control_modes[last][:, group], _LIMP).any():
        return []
    most = [greatest_torque(part.board, one) for one in group]
    constants = np.array([part.motors[one].drive.output_constant for one in group])
    return torque_evidence(
        Group(
            group,
            given=states.currents[last][:, group].mean(axis=0) * constants,
            measured=states.torques[last][:, group].mean(axis=0),
            friction=np.array([_FRICTION * (one or np.inf) for one in most]),
            coupling=transmission.coupling[np.ix_(group, group)],
        ),
        part.names,
    )
