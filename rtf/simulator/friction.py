"""Dry friction of all hinges, at a third of the cost of the engine's own.

The engine models dry friction as a constraint, which makes its solver take as long as all the rest of a step; and a
joint held by it creeps. Here a joint sits on a stiff spring whose other end slides as soon as the spring would pull
harder than the friction (the elasto-plastic element of Prandtl, also known as Dahl's friction of a sharp edge)::

    spring = stiffness (anchor - position) - drive, at most the friction to either side
    torque = spring - damping speed, at most the friction to either side

The torque of the drive is subtracted, so that it does not deflect the spring: otherwise a controlled joint would
oscillate between two encoder ticks. The state is ``stiffness anchor``, and it slides so that the first line holds.

So a joint at rest holds any load up to the friction without creeping; a moving one loses the friction times its path.

The friction is greatest at rest, and falls with the speed (Stribeck's effect), by the form of Hess and Soom::

    friction = dry (1 + more / (1 + (speed / half)²))

Both come from grease that a moving tooth floats on. What is left at high speeds is the dry friction of robot.toml.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import add, divide, maximum, minimum, multiply, negative, subtract

from rtf.robot.model.engine import mujoco

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.robot.interfaces import FloatArray
    from rtf.robot.model import Axis
    from rtf.simulator.plant import Plant

#: Natural frequency of a sticking joint (Hz), and its damping ratio. With steps of a millisecond they are stable down
#: to a fifth of the inertia that the stiffness is computed for.
STICKING = 60.0
_DAMPING = 0.2
#: Steps between two computations of the friction from the speeds; real friction, too, follows them some ms late.
_FOLLOWS = 4


class DryFriction:
    """The friction of a robot. It replaces the model's own; faults can add more in ``dof_frictionloss`` of the model.

    ``step`` is called in every step, between its two halves.
    """

    def __init__(self, plant: Plant, data: Any) -> None:
        self._dry = plant.friction  # Nm at each hinge
        share, half = _stribeck(plant.robot.axes, plant.jacobian)
        self._more = share * self._dry  # Nm, at rest
        self._of_half = 1.0 / half  # s/rad
        self._until = _FOLLOWS if self._more.any() else 0  # steps until the friction follows the speeds; 0: never
        plant.model.dof_frictionloss[:] = 0.0
        plant.reset(data)
        self.torque = self._dry + self._more  # Nm, the greatest one at each hinge now
        self._least = -self.torque
        self._position: FloatArray = (
            data.qpos
        )  # all joints are hinges or slides, so there is one for each degree of freedom
        self._speed: FloatArray = data.qvel
        self._passive: FloatArray = data.qfrc_passive
        self._ctrl: FloatArray = data.ctrl
        self._to_hinges = np.ascontiguousarray(plant.jacobian.T)  # torques of drives to those at the hinges
        self._plant = plant
        self._hold(_inertia(plant, data))
        self._anchor = np.empty_like(self.torque)  # Nm
        self._scratch = np.empty_like(self.torque)
        self._exerted = np.empty_like(self.torque)
        self.reset()

    def _hold(self, inertia: FloatArray) -> None:
        swing = 2 * math.pi * STICKING
        self._stiffness = inertia * swing**2
        self._damping = 2 * _DAMPING * inertia * swing

    def adapt(self) -> None:
        """Adapt the springs to an inertia of the hinges that has changed, and relax them."""
        self._hold(_inertia(self._plant, self._plant.data()))
        self.reset()

    def reset(self) -> None:
        """Relax the springs at the present positions and torques of the drives."""
        if self._until:
            self._follow()
        self._anchor[:] = self._stiffness * self._position + self._to_hinges @ self._ctrl

    def step(self) -> None:
        """Add the friction to the engine's passive forces. Not split into functions, as it is called in every step."""
        spring, scratch, anchor, most, least = self._exerted, self._scratch, self._anchor, self.torque, self._least
        if self._until:
            self._until -= 1
            if not self._until:
                self._follow()
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

    def _follow(self) -> None:
        """Compute the friction from the speeds."""
        self._until = _FOLLOWS
        most = self.torque
        multiply(self._speed, self._of_half, out=most)
        multiply(most, most, out=most)
        add(most, 1.0, out=most)
        divide(self._more, most, out=most)
        add(most, self._dry, out=most)
        negative(most, out=self._least)


def _stribeck(axes: tuple[Axis, ...], jacobian: NDArray[np.float64]) -> tuple[FloatArray, FloatArray]:
    """Return of each hinge what it has more at rest, a share, and the speed (rad/s, m/s) at which half of it is left.

    Of several axes over one hinge the greatest counts.
    """
    moved = jacobian != 0.0
    shares = np.array([axis.stribeck for axis in axes])
    halves = np.array([axis.stribeck_speed * axis.internal for axis in axes])
    share = np.max(np.where(moved, shares[:, None], 0.0), axis=0, initial=0.0)
    speeds = np.divide(halves[:, None], np.abs(jacobian), out=np.zeros_like(jacobian), where=moved)
    half = np.max(speeds, axis=0, initial=0.0)
    return share, np.where(half > 0.0, half, np.inf)


def _inertia(plant: Plant, data: Any) -> FloatArray:
    """Return the inertia of each hinge while all others are free (kg m²); ``data`` must have been forwarded."""
    unit = np.eye(plant.model.nv)
    solved = np.empty_like(unit)
    mujoco().mj_solveM(plant.model, data, solved, unit)
    inertia: FloatArray = 1.0 / np.diag(solved)
    return inertia
