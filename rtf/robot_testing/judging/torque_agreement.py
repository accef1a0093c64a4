"""Agreement of measured torques with those that motors give by their currents: which of several motors does not.

A motor with weak magnets lacks torque at all the joints that it moves, in the ratio of its couplings; a wrong sensor,
or friction, shows one joint wrong. So the errors of joints that share motors are compared with what each of these
motors, and each sensor, would cause alone. Where no motor is shared, a joint has none to blame but its own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot_testing.judging.blame import Evidence
from rtf.robot_testing.judging.motor_model import TOLERANCE

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from rtf.robot.interfaces import FloatArray

#: What the explanation that holds leaves of the errors, as a share of what the next one leaves.
_BETTER = 0.5


class Group(NamedTuple):
    """Joints that share motors, by their numbers, and the mean torques of a time without a change of the posture.

    ``given`` are the torques of the motors by their currents, behind their gears; ``measured`` those of the joints;
    ``friction`` is what may hide of the latter (Nm each). ``coupling`` has a row for each motor.
    """

    joints: Sequence[int]
    given: FloatArray
    measured: FloatArray
    friction: FloatArray
    coupling: FloatArray


class _Cause(NamedTuple):
    """What one motor of a group, or with -1 one sensor, leaves of the errors at most if it lacks a torque (Nm)."""

    left: float
    motor: int
    lacks: float


def torque_evidence(group: Group, names: Sequence[str]) -> list[Evidence]:
    """Return the evidence on the motor of a group that alone explains its torques; none if no motor clearly does."""
    errors = group.measured - group.given @ group.coupling
    if not np.isfinite(errors).all() or (np.abs(errors) <= group.friction).all():
        return []
    best, second, *_ = sorted(_causes(errors, group.coupling), key=lambda one: one.left)
    if best.motor < 0 or best.left > min(group.friction.max(), _BETTER * second.left):
        return []
    given, most = float(group.given[best.motor]), float(np.abs(group.coupling[best.motor]).max())
    if abs(best.lacks) <= TOLERANCE * abs(given) + group.friction.max() / most:
        return []
    joint = group.joints[best.motor]
    text = f"the motor of {names[joint]} gives {given + best.lacks:+.2f} Nm, and {given:+.2f} Nm by its current"
    return [Evidence(frozenset({joint}), text, ("weak magnets",))]


def _causes(errors: FloatArray, coupling: FloatArray) -> Iterator[_Cause]:
    """Yield what each motor of a group that moves several joints, and each sensor, may be to blame for."""
    shared = np.count_nonzero(coupling, axis=1) > 1
    motors = [(motor, coupling[motor]) for motor in np.flatnonzero(shared).tolist()]
    for motor, way in [*motors, *((-1, one) for one in np.eye(len(errors)))]:
        lacks = float(way @ errors) / float(way @ way)
        yield _Cause(float(np.abs(errors - lacks * way).max()), motor, lacks)
