"""Faults of amplifiers: of their current sensors, and of one of their directions.

The loop of an amplifier that controls its current has a sensor of its own, so what it shows can be wrong while the
current is right.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING

from rtf.simulator.faults.base import AxisFault, Layer, Parameter
from rtf.simulator.faults.mechanics import MotorFault
from rtf.simulator.faults.moments import RandomMoments

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray
    from rtf.simulator.motors import Windings


class _CurrentSensorFault(AxisFault):
    """A fault of the current sensor of a motor."""

    layer = Layer.MOTOR

    def begin(self) -> None:
        self.boards.current_faults.append(self._show)

    def end(self) -> None:
        self.boards.current_faults.remove(self._show)

    def _show(self, currents: FloatArray, now: float) -> None:
        del now
        currents[self.axis] = self.shown(float(currents[self.axis]))

    @abstractmethod
    def shown(self, current: float) -> float:
        """Return what the sensor shows in place of a current (A)."""


class CurrentSensorDead(_CurrentSensorFault):
    """Current sensor that shows no current."""

    kind = "current_sensor_dead"
    description = "The current sensor of the motor shows 0 A: a broken line, or a dead converter."
    symptom = "The current stays at 0 A, whatever the motor does; an overload is not noticed."

    def shown(self, current: float) -> float:
        del current
        return 0.0


class CurrentSensorGain(_CurrentSensorFault):
    """Wrong scale of a current sensor."""

    kind = "current_sensor_gain"
    description = "The current sensor of the motor has a wrong scale: another shunt, or a wrong full scale."
    symptom = "The currents are too small, or too large, in proportion; so are the limits that they are compared with."
    parameters = (Parameter("factor", 0.5, "", "by which the current is multiplied", 0.0, 10.0, healthy=1.0),)
    factor: float

    def shown(self, current: float) -> float:
        return self.factor * current


class CurrentSensorSign(_CurrentSensorFault):
    """Wrong sign of a current sensor."""

    kind = "current_sensor_sign"
    description = "The current sensor of the motor has the wrong sign: its lines are exchanged."
    symptom = "The current has the sign opposite to the duty cycle that drives it."

    def shown(self, current: float) -> float:
        return -current


class CurrentSensorOffset(_CurrentSensorFault):
    """Wrong zero of a current sensor."""

    kind = "current_sensor_offset"
    description = "The current sensor of the motor has a wrong zero: it was not calibrated, or it drifts."
    symptom = "It shows a current without any duty cycle, and too much in one direction."
    parameters = (Parameter("offset", 0.5, "A", "added to the current", -1e3, 1e3),)
    offset: float

    def shown(self, current: float) -> float:
        return current + self.offset


class CurrentSensorNoise(_CurrentSensorFault):
    """Noise of a current sensor."""

    kind = "current_sensor_noise"
    description = "The current sensor of the motor is noisy: a loose ground, or its filter is missing."
    symptom = "The current jumps from reading to reading, while the duty cycle does not."
    parameters = (Parameter("deviation", 0.5, "A", "standard deviation", 0.0, 1e3),)
    deviation: float

    def begin(self) -> None:
        self._random = self.own_random(self.axis)
        super().begin()

    def shown(self, current: float) -> float:
        return current + float(self._random.normal(0.0, self.deviation))


class MotorResistance(MotorFault):
    """Resistance in the circuit of a motor."""

    kind = "motor_resistance"
    description = "The circuit of the motor has more resistance: a burnt contact, or a cable whose strands are broken."
    symptom = "The motor needs more duty cycle for its current, and has less where the supply is not enough."
    parameters = (Parameter("factor", 3.0, "", "of the resistance of its winding", 1.0, 1e3, healthy=1.0),)
    factor: float

    def change(self, windings: Windings) -> None:
        windings.conductances[self.axis] /= self.factor


class MotorInterrupted(MotorFault):
    """Motor whose circuit is open for moments."""

    kind = "motor_interrupted"
    description = "The circuit of the motor is open for moments: a loose contact, or a cable that is broken inside."
    symptom = "For moments the motor has no current, at any duty cycle, and the joint sags or jerks."
    parameters = (
        Parameter("length", 0.05, "s", "of an interruption", 0.0, 60.0),
        Parameter("rate", 2.0, "1/s", "mean number of interruptions while the circuit is closed", 1e-3, 1e3),
    )
    length: float
    rate: float

    def begin(self) -> None:
        self._open = False
        self._moments = RandomMoments(self.own_random(self.axis), self.rate, self.length, self.simulation.now)
        self.boards.each_step.append(self._update)
        super().begin()

    def end(self) -> None:
        self.boards.each_step.remove(self._update)
        super().end()

    def _update(self, now: float) -> None:
        if self._moments.holds(now) is not self._open:
            self._open = not self._open
            self.boards.motors.refresh()

    def change(self, windings: Windings) -> None:
        if self._open:
            windings.conductances[self.axis] = 0.0


class AmplifierWeak(MotorFault):
    """Amplifier that is weak in one direction."""

    kind = "amplifier_weak"
    description = (
        "In one direction the amplifier gives only a part of its voltage: a transistor, or its driver, is bad."
    )
    symptom = (
        "In that direction the motor has less current than its duty cycle drives, and is weak where it needs more. One "
        "that controls its current raises the duty cycle."
    )
    parameters = (
        Parameter("share", 0.5, "", "the part of the voltage that is left", 0.01, 1.0, healthy=1.0),
        Parameter("direction", 1.0, "", "1: for positive duty cycles, -1: for negative ones", -1.0, 1.0, healthy=None),
    )
    share: float
    direction: float

    def change(self, windings: Windings) -> None:
        shares = windings.upwards if self.direction >= 0.0 else windings.downwards
        shares[self.axis] *= self.share


KINDS = (
    CurrentSensorDead,
    CurrentSensorGain,
    CurrentSensorSign,
    CurrentSensorOffset,
    CurrentSensorNoise,
    MotorResistance,
    MotorInterrupted,
    AmplifierWeak,
)
