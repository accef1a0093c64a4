"""Faults of mechanics and motors."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.simulator.faults.base import AxisFault, Layer, Parameter

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray


class _Friction(AxisFault):
    """More dry friction at the hinges of a joint."""

    layer = Layer.PLANT
    keeps = True
    torque: float

    def begin(self) -> None:
        self._healthy = {dof: float(self._losses[dof]) for dof in self._dofs}
        for dof in self._dofs:
            self._losses[dof] += self.torque

    def end(self) -> None:
        for dof, loss in self._healthy.items():
            self._losses[dof] = loss

    @property
    def _dofs(self) -> list[int]:
        return [int(dof) for dof in self.simulation.robot.dofs[self.axis]]

    @property
    def _losses(self) -> FloatArray:
        losses: FloatArray = self.simulation.robot.model.dof_frictionloss
        return losses


class Jam(_Friction):
    """See ``meaning``."""

    kind = "jam"
    meaning = "The joint is mechanically blocked where it is."
    shows = "It does not move whatever it is told, at full output and current."
    parameters = (Parameter("torque", 400.0, "Nm", "what it would take to move it", 0.0, 1e5),)


class Friction(_Friction):
    """See ``meaning``."""

    kind = "friction"
    meaning = "The joint has more dry friction than it should."
    shows = "It takes more output to move it, and it stops short of its target."
    parameters = (Parameter("torque", 5.0, "Nm", "what is added to the friction", 0.0, 1e5),)


class Push(AxisFault):
    """See ``meaning``."""

    kind = "push"
    stimulus = True
    layer = Layer.PLANT
    keeps = True
    meaning = "Somebody, or something, pushes the joint."
    shows = "A compliant joint gives way, a stiff one needs torque to hold."
    parameters = (Parameter("torque", 2.0, "Nm", "with its sign", -1e3, 1e3),)
    torque: float

    def begin(self) -> None:
        dofs = self.simulation.robot.dofs[self.axis]
        self._before = self.simulation.data.qfrc_applied[dofs].copy()
        self.simulation.data.qfrc_applied[dofs] += self.torque / len(dofs)

    def end(self) -> None:
        self.simulation.data.qfrc_applied[self.simulation.robot.dofs[self.axis]] = self._before


class _MotorFault(AxisFault):
    """Changes what a motor makes of its output (per cent)."""

    layer = Layer.MOTOR

    def begin(self) -> None:
        self.boards.motor_faults.append(self.drive)

    def end(self) -> None:
        self.boards.motor_faults.remove(self.drive)

    def drive(self, output: FloatArray, now: float) -> None:
        """Change the output in place."""
        raise NotImplementedError


class MotorDead(_MotorFault):
    """See ``meaning``."""

    kind = "motor_dead"
    meaning = "The motor does not turn: a broken cable, or a dead amplifier."
    shows = "The joint falls, or stays, whatever the output is."

    def drive(self, output: FloatArray, now: float) -> None:
        del now
        output[self.axis] = 0.0


class MotorWeak(_MotorFault):
    """See ``meaning``."""

    kind = "motor_weak"
    meaning = "The motor gives only a part of its torque."
    shows = "More output for the same load; slow under load."
    parameters = (Parameter("share", 0.3, "", "what is left of the torque", 0.0, 1.0),)
    share: float

    def drive(self, output: FloatArray, now: float) -> None:
        del now
        output[self.axis] *= self.share


class MotorSign(_MotorFault):
    """See ``meaning``."""

    kind = "motor_sign"
    meaning = "The motor turns the wrong way: two of its wires are exchanged."
    shows = "The joint runs away from its target into a limit."

    def drive(self, output: FloatArray, now: float) -> None:
        del now
        output[self.axis] = -output[self.axis]


class MotorOvercurrent(AxisFault):
    """See ``meaning``."""

    kind = "motor_overcurrent"
    layer = Layer.MOTOR
    meaning = "The motor draws more current than it should, as with a short circuit in its windings."
    shows = "The current reads higher; beyond its limit the joint goes into hardware fault."
    parameters = (Parameter("current", 20.0, "A", "what is added", 0.0, 1e3),)
    current: float

    def begin(self) -> None:
        self.boards.current_faults.append(self._draw)

    def end(self) -> None:
        self.boards.current_faults.remove(self._draw)

    def _draw(self, currents: FloatArray, now: float) -> None:
        del now
        currents[self.axis] += self.current


KINDS = (Jam, Friction, Push, MotorDead, MotorWeak, MotorSign, MotorOvercurrent)
