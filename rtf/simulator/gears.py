"""Gears with play, and gears that bend: the rotor's side of an axis and the link's are two positions then.

A rigid gear is no part of the simulation: its rotor turns with the joint, and its inertia is that of the joint
(``armature``). An axis with play or elasticity has a rotor of its own, with an angle and a speed in the units of the
axis, and a massless spring and damper between rotor and joint, which touches beyond half the play to either side::

    twist = angle - position, less what the play leaves of it
    torque = stiffness twist + damping (speed - speed of the joint), never pulling across an open play
    rotor: inertia d(speed)/dt = torque of the motor - torque

The torque is what the joint feels, and what a torque sensor behind the gear measures. The rotor is integrated
implicitly, so it may be as light as it likes; for the joint, whose inertia the engine knows, the spring is explicit,
which bounds its stiffness: teeth that are stiffer than a step of the simulation resolves are as stiff as that. Where
only the play is given, the teeth yield by 0.2 degrees to the greatest torque, as harmonic drives do by their data
sheets.

A tenth of the rotor's inertia stays with the joint, as that of the gear's last stage. Friction and damping are those of
the joint; the motor's own braking acts on the rotor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rtf.robot.model.errors import RobotModelError
from rtf.simulator.plant import TIMESTEP

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.robot.interfaces import FloatArray
    from rtf.simulator.plant import Plant

#: The greatest phase (rad) by which the joint swings on its gear in a step, as if the rotor were held: 80 Hz.
_PHASE = 0.5
#: What the teeth of a gear with play yield to the greatest torque (deg, of a slide what stands for it).
_TEETH = 0.2
#: Damping ratio of that swing: some per cent are lost in gears of steel, more where grease is pressed out of a play.
_DAMPING = 0.1
#: The share of the rotor's inertia that turns with the joint.
_LAST_STAGE = 0.1
#: The least share of a joint's inertia at home that it has in any pose.
_LEAST_INERTIA = 0.5


@dataclass(slots=True)
class GearProperties:
    """The gears as they are, to be changed in place by faults; a column for each axis. Without both a gear is rigid."""

    play: FloatArray  # rad (m), the whole play
    compliance: FloatArray  # rad/Nm (m/N), the twist for a torque


class Gears:
    """The gears of all axes. Faults call ``refresh`` when they change; all else is called in every step."""

    def __init__(self, plant: Plant, data: Any) -> None:
        axes = plant.robot.axes
        self._plant = plant
        self._position: FloatArray = data.actuator_length
        self._speed_of_joint: FloatArray = data.actuator_velocity
        self._ctrl: FloatArray = data.ctrl
        self._armature = plant.model.dof_armature.copy()
        self._rotors = _rotor_inertia(plant)
        self._play = np.array([axis.play * axis.internal for axis in axes])
        self._compliance = np.array([0.0 if axis.stiffness is None else 1.0 / axis.stiffness for axis in axes])
        self._teeth = np.array([_TEETH * axis.degree / axis.max_torque for axis in axes])
        #: Active faults: functions that change their argument. Empty in a healthy robot.
        self.faults: list[Callable[[GearProperties], None]] = []
        #: Called when the inertia of joints has changed.
        self.on_change: Callable[[], None] = lambda: None
        self.flexible = np.empty(0, dtype=np.intp)  # the axes whose gears are not rigid
        self._angle, self._speed = np.zeros(len(axes)), np.zeros(len(axes))  # of the rotors of these
        self.refresh()

    def lacks_rotor(self, axis: int) -> bool:
        """Return whether an axis has no inertia of its rotor, so that its gear can only be rigid."""
        return not self._rotors[axis] > 0.0

    def refresh(self) -> None:
        """Compute what follows from play and elasticity anew. A rotor that was rigid begins where its joint is."""
        found = GearProperties(self._play.copy(), self._compliance.copy())
        for fault in self.faults:
            fault(found)
        flexible = np.flatnonzero((found.play > 0.0) | (found.compliance > 0.0))
        if not (len(flexible) or len(self.flexible)):
            return
        fresh = np.setdiff1d(flexible, self.flexible)
        self._angle[fresh], self._speed[fresh] = self._position[fresh], self._speed_of_joint[fresh]
        self.flexible = flexible
        self._take_inertia()
        joints = _LEAST_INERTIA * self._plant.axis_inertia(self._plant.data())[flexible]
        compliance = np.where(found.compliance > 0.0, found.compliance, self._teeth)[flexible]
        self._stiffness = 1.0 / np.maximum(compliance, TIMESTEP**2 / (_PHASE**2 * joints))
        self._damping = 2 * _DAMPING * np.sqrt(self._stiffness * joints)
        self._half = found.play[flexible] / 2
        self._yields = 1.0 / (1.0 + (self._stiffness * TIMESTEP + self._damping) * self._hastens)
        self.on_change()

    def _take_inertia(self) -> None:
        """Take the inertia of rotors with a side of their own from the joints."""
        armature = self._armature.copy()
        for axis in self.flexible.tolist():
            if self.lacks_rotor(axis):
                robot = self._plant.robot
                name = robot.axes[axis].name
                raise RobotModelError(f"{robot.folder}: {name} has play or a stiffness, so it needs an armature")
            armature -= (1.0 - _LAST_STAGE) * self._rotors[axis] * self._plant.jacobian[axis] ** 2
        self._plant.model.dof_armature[:] = np.maximum(armature, 0.0)
        #: The change of a rotor's speed in a step, for a torque.
        self._hastens = TIMESTEP / ((1.0 - _LAST_STAGE) * self._rotors[self.flexible])

    # A step -------------------------------------------------------------------------------------------------------

    def turn(self, speeds: FloatArray) -> None:
        """Replace the speeds of joints by those of their rotors, in place."""
        speeds[self.flexible] = self._speed[self.flexible]

    def step(self, torques: FloatArray) -> None:
        """Replace the torques of motors by what their gears give to the joints, in place; move the rotors on."""
        axes, half = self.flexible, self._half
        speed = self._speed[axes] + self._hastens * torques[axes]  # with an open play
        relative = speed - self._speed_of_joint[axes]
        apart = self._angle[axes] - self._position[axes] + TIMESTEP * relative
        twist = apart - np.clip(apart, -half, half)
        given = (self._stiffness * twist + self._damping * relative * (twist != 0.0)) * self._yields
        given = np.where((half > 0.0) & (given * twist < 0.0), 0.0, given)
        speed -= self._hastens * given
        self._speed[axes] = speed
        self._angle[axes] += TIMESTEP * speed
        torques[axes] = given

    def rest(self, torques: FloatArray) -> None:
        """Put the rotors at rest where they give these torques."""
        axes = self.flexible
        self._speed[axes] = self._speed_of_joint[axes]
        self._angle[axes] = self._position[axes] + torques[axes] / self._stiffness + np.sign(torques[axes]) * self._half
        self._ctrl[axes] = torques[axes]

    # What motor encoders measure ----------------------------------------------------------------------------------

    def angles(self) -> FloatArray:
        """Return the positions of the axes by their rotors (rad, m), not to be changed."""
        return self._by_rotors(self._position, self._angle)

    def speeds(self) -> FloatArray:
        """Return the speeds of the axes by their rotors (rad/s, m/s), not to be changed."""
        return self._by_rotors(self._speed_of_joint, self._speed)

    def _by_rotors(self, joints: FloatArray, rotors: FloatArray) -> FloatArray:
        if not len(self.flexible):
            return joints
        found = joints.copy()
        found[self.flexible] = rotors[self.flexible]
        return found


def _rotor_inertia(plant: Plant) -> FloatArray:
    """Return the inertia of the rotor of each axis (kg m², kg), by what the model has at its joints; 0 if unknown."""
    shares = plant.jacobian**2
    given = np.array([math.nan if axis.armature is None else axis.armature for axis in plant.robot.axes])
    least = np.divide(plant.model.dof_armature, shares, out=np.full_like(shares, math.inf), where=shares > 0.0).min(
        axis=1
    )
    found: FloatArray = np.where(np.isnan(given), least, np.minimum(given, least))
    return found
