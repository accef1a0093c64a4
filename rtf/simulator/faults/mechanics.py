"""Faults of mechanics and of motors."""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import TYPE_CHECKING

from rtf.simulator.faults.base import AxisFault, Layer, Parameter

if TYPE_CHECKING:
    from rtf.simulator.motors import Windings


#: The speed for which viscous friction is given, deg/s.
_KNOWN_AT = 100.0


class AddedFriction(AxisFault):
    """A fault that adds dry friction at the hinges of a joint: by default ``torque``, all the time."""

    layer = Layer.PLANT
    torque: float

    def begin(self) -> None:
        self.add(self.torque)

    def end(self) -> None:
        for hinge in self.hinges:
            del self.boards.friction_faults[hinge][self]
            self._sum(hinge)

    @property
    def hinges(self) -> list[int]:
        """The degrees of freedom that the joint moves."""
        return [int(dof) for dof in self.simulation.plant.dofs[self.axis]]

    def add(self, torque: float) -> None:
        """Set the friction that this fault adds now, Nm at each hinge."""
        for hinge in self.hinges:
            self.boards.friction_faults.setdefault(hinge, {})[self] = torque
            self._sum(hinge)

    def _sum(self, hinge: int) -> None:
        """Let the engine add what all faults of a hinge add; a simulation has no other friction in the engine."""
        added = self.boards.friction_faults[hinge]
        self.simulation.plant.model.dof_frictionloss[hinge] = math.fsum(added.values())
        if not added:
            del self.boards.friction_faults[hinge]


class Jam(AddedFriction):
    """Mechanical block of a joint."""

    kind = "jam"
    description = "The joint is mechanically blocked at its position."
    symptom = "The joint does not move, at full output and current."
    parameters = (Parameter("torque", 400.0, "Nm", "the torque that would move it", 0.0, 1e5),)


class Friction(AddedFriction):
    """Additional dry friction of a joint."""

    kind = "friction"
    description = "The joint has too much dry friction."
    symptom = "It needs more output to move, and it stops short of its target."
    parameters = (Parameter("torque", 5.0, "Nm", "added to the friction", 0.0, 1e5),)


class ViscousFriction(AxisFault):
    """Additional viscous friction of a joint."""

    kind = "viscous_friction"
    layer = Layer.PLANT
    restores = True
    description = (
        "The joint has too much friction that grows with its speed: its grease is old, cold or of another kind."
    )
    symptom = "It needs more current and more output the faster it moves, and reaches its speed late."
    parameters = (Parameter("torque", 10.0, "Nm", "added to the friction at 100 deg/s", 0.0, 1e5),)
    torque: float

    def begin(self) -> None:
        dofs, damping = self.simulation.plant.dofs[self.axis], self.simulation.plant.model.dof_damping
        self._before = damping[dofs].copy()
        damping[dofs] += self.torque / math.radians(_KNOWN_AT)

    def end(self) -> None:
        self.simulation.plant.model.dof_damping[self.simulation.plant.dofs[self.axis]] = self._before


class Push(AxisFault):
    """External torque on a joint; a stimulus, not a defect."""

    kind = "push"
    stimulus = True
    layer = Layer.PLANT
    restores = True
    description = "A person or an object pushes the joint."
    symptom = "A compliant joint gives way, a stiff one needs torque to hold."
    parameters = (Parameter("torque", 2.0, "Nm", "with its sign", -1e3, 1e3),)
    torque: float

    def begin(self) -> None:
        dofs = self.simulation.plant.dofs[self.axis]
        self._before = self.simulation.data.qfrc_applied[dofs].copy()
        self.simulation.data.qfrc_applied[dofs] += self.torque / len(dofs)

    def end(self) -> None:
        self.simulation.data.qfrc_applied[self.simulation.plant.dofs[self.axis]] = self._before


class MotorFault(AxisFault):
    """A fault of a motor's circuit."""

    layer = Layer.MOTOR

    def begin(self) -> None:
        self.boards.motors.faults.append(self.change)
        self.boards.motors.refresh()

    def end(self) -> None:
        self.boards.motors.faults.remove(self.change)
        self.boards.motors.refresh()

    @abstractmethod
    def change(self, windings: Windings) -> None:
        """Change the circuits in place."""


class MotorDead(MotorFault):
    """Motor without current."""

    kind = "motor_dead"
    description = "The motor does not turn: a broken cable, or a dead amplifier."
    symptom = "The joint falls, or stays, at any output, and the motor has no current."

    def change(self, windings: Windings) -> None:
        windings.conductances[self.axis] = 0.0


class MotorWeak(MotorFault):
    """Motor with a part of its torque."""

    kind = "motor_weak"
    description = "The motor gives only a part of its torque, as its magnets have lost their strength."
    symptom = "It needs more current and more output for the same load, and is slow under load."
    parameters = (Parameter("share", 0.3, "", "the part of the torque that is left", 0.0, 1.0, healthy=1.0),)
    share: float

    def change(self, windings: Windings) -> None:
        windings.constants[self.axis] *= self.share


class MotorSign(MotorFault):
    """Motor that turns the wrong way."""

    kind = "motor_sign"
    description = "The motor turns the wrong way: two of its wires are exchanged."
    symptom = "The joint runs away from its target into a limit."

    def change(self, windings: Windings) -> None:
        windings.constants[self.axis] *= -1.0


class MotorOvercurrent(AxisFault):
    """Additional current of a motor."""

    kind = "motor_overcurrent"
    layer = Layer.MOTOR
    description = "The motor draws too much current, as with a short circuit in its windings."
    symptom = "The measured current is higher; beyond its limit the joint goes into hardware fault."
    parameters = (Parameter("current", 20.0, "A", "added to the current", 0.0, 1e3),)
    current: float

    def begin(self) -> None:
        self.boards.motors.short_circuits[self.axis] += self.current

    def end(self) -> None:
        self.boards.motors.short_circuits[self.axis] -= self.current


KINDS = (Jam, Friction, ViscousFriction, Push, MotorDead, MotorWeak, MotorSign, MotorOvercurrent)
