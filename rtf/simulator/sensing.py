"""The sensors of the simulated robot as devices: force-torque sensors and the inertial unit, with noise.

Without noise a sensor at rest would repeat itself, which a real one does not; the noise is that of the simulation's
seed. Faults are functions in lists, which are empty in a healthy robot. Each sensor measures once a step at the most:
all ports that show it tell the same.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.device import Device
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import (
    IAnalogSensor,
    IMultipleAnalogSensors,
    SensorCategory,
    SensorInfo,
    SensorReading,
    SensorStatus,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.bottle import Property
    from rtf.robot.interfaces import FloatArray
    from rtf.simulator.sensors import FtSensor
    from rtf.simulator.simulation import Simulation

#: Standard deviations: N and Nm of force and torque; deg, deg/s, m/s² and T of the inertial unit.
FORCE_NOISE, TORQUE_NOISE = 0.05, 0.002
_IMU_NOISE = {
    SensorCategory.GYROSCOPE: 0.05,
    SensorCategory.ACCELEROMETER: 0.02,
    SensorCategory.MAGNETOMETER: 1e-7,
    SensorCategory.ORIENTATION: 0.02,
}
_FT_NOISE = np.array([FORCE_NOISE] * 3 + [TORQUE_NOISE] * 3)
_IMU_DEVIATION = np.repeat([*_IMU_NOISE.values()], 3)
#: What each of its sensors shows of the numbers of an inertial unit.
_IMU_PLACES = [(category, slice(3 * place, 3 * place + 3)) for place, category in enumerate(_IMU_NOISE)]


class _Sensor(Device):
    """What the sensors have in common. They live as long as the simulation."""

    def __init__(self, name: str, simulation: Simulation) -> None:
        super().__init__(name)
        self.simulation = simulation
        #: Each is given what is about to be told, by name of the sensor, and the time, and changes it in place.
        self.faults: list[Callable[[str, SensorCategory, FloatArray, float], None]] = []
        self.status = SensorStatus.OK
        self._measured_at = -1
        simulation.on_reset.append(self._forget)

    def _forget(self) -> None:
        """What was measured is not true any more."""
        self._measured_at = -1

    def open(self, configuration: Property) -> None:
        """See Device."""

    def close(self) -> None:
        """See Device."""

    def _told(self, category: SensorCategory, values: FloatArray) -> SensorReading:
        """A reading of these values, as the sensor tells it."""
        now = self.simulation.now
        for fault in self.faults:
            fault(self.name, category, values, now)
        return SensorReading(values, now)


class SimulatedForceTorque(_Sensor, IAnalogSensor):
    """One force-torque sensor: three forces (N) and three torques (Nm), less what was made zero."""

    def __init__(self, sensor: FtSensor, simulation: Simulation) -> None:
        super().__init__(sensor.name, simulation)
        self.sensor = sensor
        self._forces = simulation.data.sensordata[sensor.force.start : sensor.torque.stop]  # a view; the other way
        self._zero = np.zeros(6)
        self._reading = SensorReading(self._zero, 0.0)

    def channels(self) -> int:
        """See IAnalogSensor."""
        return self._zero.size

    def read(self) -> SensorReading:
        """See IAnalogSensor."""
        simulation = self.simulation
        tick = simulation.boards.tick
        if self._measured_at != tick:
            self._measured_at = tick
            values = _FT_NOISE * simulation.noise(6)
            values -= self._forces
            values -= self._zero
            self._reading = self._told(SensorCategory.FORCE_TORQUE, values)
        return self._reading

    def calibrate(self, channel: int | None = None, value: float | None = None) -> None:
        """See IAnalogSensor."""
        self._forget()
        zero = self.sensor.read(self.simulation.data.sensordata) - (value or 0.0)
        if channel is None:
            self._zero = zero
        elif 0 <= channel < self._zero.size:
            self._zero[channel] = zero[channel]
        else:
            raise RefusedError(f"{self.name} has {self._zero.size} channels, counted from 0, and no {channel}")


class SimulatedForceTorques(_Sensor, IMultipleAnalogSensors):
    """All force-torque sensors of the robot in one device."""

    def __init__(self, sensors: Sequence[SimulatedForceTorque], simulation: Simulation) -> None:
        super().__init__("force-torque sensors", simulation)
        self._sensors = tuple(sensors)
        self._infos = tuple(SensorInfo(one.name, one.sensor.frame) for one in self._sensors)

    def sensors(self, category: SensorCategory) -> Sequence[SensorInfo]:
        """See IMultipleAnalogSensors."""
        return self._infos if category is SensorCategory.FORCE_TORQUE else ()

    def sensor_status(self, category: SensorCategory, index: int) -> SensorStatus:
        """See IMultipleAnalogSensors."""
        return self._sensor(category, index).status

    def read_sensor(self, category: SensorCategory, index: int) -> SensorReading:
        """See IMultipleAnalogSensors."""
        return self._sensor(category, index).read()

    def _sensor(self, category: SensorCategory, index: int) -> SimulatedForceTorque:
        if category is not SensorCategory.FORCE_TORQUE or not 0 <= index < len(self._sensors):
            raise RefusedError(f"{self.name}: there is no {SensorCategory(category).name} {index}")
        return self._sensors[index]


class SimulatedImu(_Sensor, IMultipleAnalogSensors):
    """The inertial unit of the head."""

    def __init__(self, simulation: Simulation) -> None:
        super().__init__(simulation.robot.imu.name, simulation)
        self.imu = simulation.robot.imu
        self._found: FloatArray = simulation.data.sensordata
        self._info = (SensorInfo(self.imu.name, self.imu.frame),)
        self._readings: dict[SensorCategory, SensorReading] = {}

    def sensors(self, category: SensorCategory) -> Sequence[SensorInfo]:
        """See IMultipleAnalogSensors."""
        return self._info if category in _IMU_NOISE else ()

    def sensor_status(self, category: SensorCategory, index: int) -> SensorStatus:
        """See IMultipleAnalogSensors."""
        self._check(category, index)
        return self.status

    def read_sensor(self, category: SensorCategory, index: int) -> SensorReading:
        """See IMultipleAnalogSensors."""
        self._check(category, index)
        tick = self.simulation.boards.tick
        if self._measured_at != tick:
            self._measured_at = tick
            values = self._true()
            values += _IMU_DEVIATION * self.simulation.noise(values.size)
            self._readings = {category: self._told(category, values[place]) for category, place in _IMU_PLACES}
        return self._readings[category]

    def _check(self, category: SensorCategory, index: int) -> None:
        if category not in _IMU_NOISE or index != 0:
            raise RefusedError(f"{self.name}: there is no {SensorCategory(category).name} {index}")

    def _true(self) -> FloatArray:
        """What all of them measure, in the order of ``_IMU_PLACES``."""
        found, imu = self._found, self.imu
        true = np.empty(_IMU_DEVIATION.size)
        true[_GYROSCOPE] = found[imu.gyroscope]
        true[_GYROSCOPE] *= _DEGREES
        true[_ACCELEROMETER] = found[imu.accelerometer]
        true[_MAGNETOMETER] = found[imu.magnetometer]
        true[_ORIENTATION] = roll_pitch_yaw(found[imu.orientation])
        return true


_DEGREES = 180.0 / math.pi
_GYROSCOPE, _ACCELEROMETER, _MAGNETOMETER, _ORIENTATION = (place for _, place in _IMU_PLACES)


def roll_pitch_yaw(quaternion: FloatArray) -> tuple[float, float, float]:
    """The rotation w, x, y, z as roll, pitch and yaw in deg: about fixed axes x, y and z in this order."""
    w, x, y, z = quaternion.tolist()
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return roll * _DEGREES, pitch * _DEGREES, yaw * _DEGREES
