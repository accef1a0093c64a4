"""Faults of the scale and of the axes of force-torque sensors and inertial units."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.interfaces import SensorCategory
from rtf.simulator.faults.base import Parameter
from rtf.simulator.faults.sensors import ForceTorqueFault, ImuFault

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray


class ForceTorqueGain(ForceTorqueFault):
    """Wrong scale of a force-torque sensor."""

    kind = "ft_gain"
    description = "The force-torque sensor has a wrong scale: the calibration of another one, or a wrong full scale."
    symptom = "Its forces and torques are too small, or too large, in proportion."
    parameters = (Parameter("factor", 0.7, "", "by which all six are multiplied", 0.0, 10.0),)
    factor: float

    def show(self, name: str, category: SensorCategory, values: FloatArray, now: float) -> None:
        del name, category, now
        values *= self.factor


class ForceTorqueAxes(ForceTorqueFault):
    """Exchanged axes of a force-torque sensor."""

    kind = "ft_axes"
    description = "Two axes of the force-torque sensor are exchanged: a wrong calibration matrix, or it is turned."
    symptom = "A load along one of the axes shows along the other."
    parameters = (
        Parameter("first", 0.0, "", "an axis: 0 for x, 1 for y, 2 for z", 0.0, 2.0),
        Parameter("second", 1.0, "", "the other one", 0.0, 2.0),
    )
    first: float
    second: float

    def show(self, name: str, category: SensorCategory, values: FloatArray, now: float) -> None:
        del name, category, now
        one, other = round(self.first), round(self.second)
        for begin in (0, 3):
            values[[begin + one, begin + other]] = values[[begin + other, begin + one]]


class _ImuGain(ImuFault):
    """A wrong scale of one of the sensors of an inertial unit."""

    category: SensorCategory
    factor: float

    def show(self, name: str, category: SensorCategory, values: FloatArray, now: float) -> None:
        del name, now
        if category is self.category:
            values *= self.factor


class GyroscopeGain(_ImuGain):
    """Wrong scale of the gyroscope."""

    kind = "gyroscope_gain"
    category = SensorCategory.GYROSCOPE
    description = "The gyroscope of the inertial unit has a wrong scale: it was set to another range."
    symptom = "Its angular velocities are too small, or too large, in proportion."
    parameters = (Parameter("factor", 0.5, "", "by which they are multiplied", 0.0, 10.0),)


class AccelerometerGain(_ImuGain):
    """Wrong scale of the accelerometer."""

    kind = "accelerometer_gain"
    category = SensorCategory.ACCELEROMETER
    description = "The accelerometer of the inertial unit has a wrong scale: it was set to another range."
    symptom = "At rest it does not measure 9.81 m/s2."
    parameters = (Parameter("factor", 0.5, "", "by which they are multiplied", 0.0, 10.0),)


class GyroscopeAxes(ImuFault):
    """Exchanged axes of the gyroscope."""

    kind = "gyroscope_axes"
    description = "Two axes of the gyroscope are exchanged, those of the other sensors of the unit are not."
    symptom = "A rotation about one of the axes shows about the other."
    parameters = (
        Parameter("first", 0.0, "", "an axis: 0 for x, 1 for y, 2 for z", 0.0, 2.0),
        Parameter("second", 1.0, "", "the other one", 0.0, 2.0),
    )
    first: float
    second: float

    def show(self, name: str, category: SensorCategory, values: FloatArray, now: float) -> None:
        del name, now
        if category is SensorCategory.GYROSCOPE:
            pair = [round(self.first), round(self.second)]
            values[pair] = values[pair[::-1]]


KINDS = (ForceTorqueGain, ForceTorqueAxes, GyroscopeGain, AccelerometerGain, GyroscopeAxes)
