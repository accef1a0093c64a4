"""The electrical side of a motor and its gear: from a voltage to a current, and from a current to a torque.

A winding of resistance *R* and torque constant *k*, in a rotor of the speed *w*, obeys ``voltage = R current + k w``
and ``torque = k current``; a brushless motor as its equivalent of direct current. The inductance is left out: its time
constant, some tenths of a millisecond, is below the step of the simulation.

A robot.toml needs to say none of it. Then the motor gives the greatest torque of its joint with its peak current, the
supply turns it twice as fast as the joint may move, and at rest the whole supply drives the peak current.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from rtf.robot.model.file import Motor

#: The speed at which the supply turns a motor without load, as a multiple of its joint's greatest one.
_NO_LOAD = 2.0


@dataclass(frozen=True, slots=True)
class Drive:
    """A winding, its amplifier and its gear."""

    kind: Literal["voltage", "current"]  # what the amplifier controls
    supply: float  # V
    resistance: float  # Ohm
    torque_constant: float  # Nm/A of the rotor, and V s/rad
    current_noise: float  # A, standard deviation of its current sensor
    current_step: float  # A, of the numbers of its current sensor
    assumed: bool  # whether its resistance or its torque constant follows from the joint
    turns: float  # of the rotor a turn of the joint (rad/m of a prismatic one); negative if mounted the other way round

    @property
    def output_constant(self) -> float:
        """The torque behind the gear for a current, Nm/A (N/A), positive if it turns the joint upwards."""
        return self.torque_constant * self.turns


def drive_of(motor: Motor, *, torque: float, speed: float, gearbox: float, prismatic: bool) -> Drive:
    """Return the drive of a motor that gives ``torque`` (Nm, N) behind its gear, for a joint of this greatest speed.

    ``speed`` is in deg/s, or m/s of a prismatic joint; ``gearbox`` in turns a turn, or a metre.
    """
    turns = gearbox * (2.0 * math.pi if prismatic else 1.0)
    constant = motor.torque_constant or torque / (motor.peak_current * abs(turns))
    fastest = speed if prismatic else math.radians(speed)
    supply = motor.supply or _NO_LOAD * fastest * constant * abs(turns)
    resistance = motor.resistance or supply * constant * abs(turns) / torque
    return Drive(
        kind=motor.drive,
        supply=supply,
        resistance=resistance,
        torque_constant=constant,
        current_noise=motor.current_noise * motor.peak_current,
        current_step=motor.current_step,
        assumed=motor.resistance is None or motor.torque_constant is None,
        turns=turns,
    )
