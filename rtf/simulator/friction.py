"""Dry friction of all hinges, at a third of the cost of the engine's own.

The engine models dry friction as a constraint, which makes its solver take as long as all the rest of a step; and a
joint held by it creeps. Here a joint sits on a stiff spring whose other end slides as soon as the spring would pull
harder than the friction (the elasto-plastic element of Prandtl, also known as Dahl's friction of a sharp edge)::

    spring = stiffness (anchor - position) - drive, at most the friction to either side
    torque = spring - damping speed, at most the friction to either side

The torque of the drive is subtracted, so that it does not deflect the spring: otherwise a controlled joint would
oscillate between two encoder ticks. The state is ``stiffness anchor``, and it slides so that the first line holds.

So a joint at rest bears any load up to the friction without creeping; a moving one loses the friction times its path.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import add, maximum, minimum, multiply, subtract

from rtf.robot.model.engine import mujoco

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray
    from rtf.simulator.plant import Plant

#: Natural frequency of a sticking joint (Hz), and its damping ratio. With steps of a millisecond they are stable down
#: to a fifth of the inertia that the stiffness is computed for.
STICKING = 60.0
_DAMPING = 0.2


class DryFriction:
    """The friction of a robot. It replaces the model's own; faults can add more in ``dof_frictionloss`` of the model.

    ``step`` is called in every step, between its two halves.
    """

    def __init__(self, plant: Plant, data: Any) -> None:
        self.torque = plant.friction  # Nm at each hinge
        plant.model.dof_frictionloss[:] = 0.0
        plant.reset(data)
        self._least = -self.torque
        self._position: FloatArray = (
            data.qpos
        )  # all joints are hinges or slides, so there is one for each degree of freedom
        self._speed: FloatArray = data.qvel
        self._passive: FloatArray = data.qfrc_passive
        self._ctrl: FloatArray = data.ctrl
        self._to_hinges = np.ascontiguousarray(plant.jacobian.T)  # torques of drives to those at the hinges
        swing = 2 * math.pi * STICKING
        inertia = _inertia(plant, data)
        self._stiffness = inertia * swing**2
        self._damping = 2 * _DAMPING * inertia * swing
        self._anchor = np.empty_like(self.torque)  # Nm
        self._scratch = np.empty_like(self.torque)
        self._exerted = np.empty_like(self.torque)
        self.reset()

    def reset(self) -> None:
        """Relax the springs at the present positions and torques of the drives."""
        self._anchor[:] = self._stiffness * self._position + self._to_hinges @ self._ctrl

    def step(self) -> None:
        """Add the friction to the engine's passive forces. Not split into functions, as it is called in every step."""
        spring, scratch, anchor, most, least = self._exerted, self._scratch, self._anchor, self.torque, self._least
        multiply(self._position, self._stiffness, out=scratch)
        np.dot(self._to_hinges, self._ctrl, out=spring)
        add(scratch, spring, out=scratch)
        subtract(anchor, scratch, out=spring)
        minimum(spring, most, out=spring)
        maximum(spring, least, out=spring)
        add(scratch, spring, out=anchor)
        multiply(self._speed, self._damping, out=scratch)
        subtract(spring, scratch, out=spring)
        minimum(spring, most, out=spring)
        maximum(spring, least, out=spring)
        add(self._passive, spring, out=self._passive)


def _inertia(plant: Plant, data: Any) -> FloatArray:
    """Return the inertia of each hinge while all others are free (kg m²); ``data`` must have been forwarded."""
    unit = np.eye(plant.model.nv)
    solved = np.empty_like(unit)
    mujoco().mj_solveM(plant.model, data, solved, unit)
    inertia: FloatArray = 1.0 / np.diag(solved)
    return inertia
