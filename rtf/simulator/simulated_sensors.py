"""The sensors of the simulated robot as devices: force-torque sensors and the inertial unit, with noise.

Without noise a sensor at rest would repeat its readings, unlike a real one; noise and drift follow from the seed of the
simulation. A reading is what is measured, with noise, drift and faults, in whole counts. Faults are functions in lists,
which are empty in a healthy robot. A sensor measures at most once a step, so that all ports publish the same reading.
"""

from __future__ import annotations

import math
import zlib
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
from rtf.robot.sensors.measurements import IMeasurementsSource, not_well

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from rtf.bottle import Property
    from rtf.robot.interfaces import FloatArray
    from rtf.robot.model.file import Accuracy
    from rtf.robot.sensors.measurements import Measurements
    from rtf.simulator.model_sensors import FtSensor, ImuSensor
    from rtf.simulator.simulation import Simulation

#: The sensors of an inertial unit: deg/s, m/s², T, deg.
_IMU = (
    SensorCategory.GYROSCOPE,
    SensorCategory.ACCELEROMETER,
    SensorCategory.MAGNETOMETER,
    SensorCategory.ORIENTATION,
)
#: For each sensor of the unit, by category: its slice of the numbers of an inertial unit.
_IMU_PLACES = [(category, slice(3 * category, 3 * category + 3)) for category in _IMU]
# Names of this module, as the look-up of members of an enumeration is slow.
_WELL, _FORCE_TORQUE, _CATEGORIES = SensorStatus.OK, SensorCategory.FORCE_TORQUE, len(SensorCategory)
#: Drifts are given by the minute.
_MINUTE = 60.0
_DRIFT_SEED = 0xD21F7
#: Number of measurements whose noise is drawn at once, which takes a tenth of the time.
_DRAWN = 256


class SimulatedSensor(Device):
    """Base class of the sensors, which live as long as the simulation.

    ``accuracies`` are those of the quantities of a reading, each of which has ``each`` numbers.
    """

    def __init__(self, name: str, simulation: Simulation, accuracies: Sequence[Accuracy], each: int = 3) -> None:
        super().__init__(name)
        self.simulation = simulation
        self._boards = simulation.boards
        self._deviation = np.repeat([one.noise for one in accuracies], each)
        counts = np.repeat([one.count for one in accuracies], each)
        self._counted = counts > 0.0
        self._counts = counts if counts.any() else None
        drift = np.repeat([one.drift for one in accuracies], each)
        self._drift = Drift(name, simulation, drift) if drift.any() else None
        self._zero = np.zeros(self._deviation.size)
        self._noise: Iterator[FloatArray] = iter(())
        #: Faults: each is called with the readings by sensor name, and the time, and changes them in place.
        self.faults: list[Callable[[str, SensorCategory, FloatArray, float], None]] = []
        self.status = SensorStatus.OK
        self._measured_at = -1
        simulation.on_reset.append(self._begin_anew)

    def _begin_anew(self) -> None:
        """Discard the last reading and the noise drawn in advance."""
        self._measured_at = -1
        self._noise = iter(())

    def _next_noise(self) -> FloatArray:
        """Return the noise of one reading, minus the zero offset. The array must not be changed."""
        row = next(self._noise, None)
        if row is None:
            size = self._deviation.size
            rows = self._deviation * self._draw(_DRAWN * size).reshape(_DRAWN, size)
            rows -= self._zero
            self._noise = iter(rows)
            row = next(self._noise)
        return row

    def _draw(self, count: int) -> FloatArray:
        """Return ``count`` standard normal random numbers."""
        return self.simulation.noise(count)

    def _count(self, values: FloatArray) -> None:
        """Round numbers to whole counts, in place."""
        if self._counts is not None:
            where = self._counted
            np.divide(values, self._counts, out=values, where=where)
            np.rint(values, out=values, where=where)
            np.multiply(values, self._counts, out=values, where=where)

    def open(self, configuration: Property) -> None:
        """Do nothing: it is open from its construction."""

    def close(self) -> None:
        """Do nothing: there are no resources."""


class Drift:
    """The bias of a sensor: a random walk with a step every second, whenever it is read.

    It has random numbers of its own, so the noise of all sensors does not depend on it.
    """

    def __init__(self, name: str, simulation: Simulation, a_minute: FloatArray) -> None:
        self._seed = [_DRIFT_SEED, zlib.crc32(name.encode())]
        self._simulation = simulation
        self._steps = a_minute / math.sqrt(_MINUTE)
        self._begin_anew()
        simulation.on_reset.append(self._begin_anew)

    def _begin_anew(self) -> None:
        self._random = np.random.default_rng([self._simulation.seed, *self._seed])
        self._bias = np.zeros(self._steps.size)
        self._second = int(self._simulation.now)

    def at(self, now: float) -> FloatArray:
        """Return the bias. The array must not be changed."""
        while self._second < int(now):
            self._second += 1
            self._bias = self._bias + self._steps * self._random.standard_normal(self._steps.size)
        return self._bias


class SimulatedForceTorque(SimulatedSensor, IAnalogSensor, IMultipleAnalogSensors, IMeasurementsSource):
    """A force-torque sensor: three forces (N) and three torques (Nm), minus the zero offset."""

    def __init__(self, sensor: FtSensor, simulation: Simulation) -> None:
        settings = sensor.settings
        super().__init__(sensor.name, simulation, [settings.force, settings.torque])
        self.sensor = sensor
        self._forces = simulation.data.sensordata[sensor.force.start : sensor.torque.stop]  # a view; the other way
        self._reading = SensorReading(self._zero, 0.0)
        self._together = SimulatedForceTorques((self,), simulation)

    def channels(self) -> int:
        return self._zero.size

    def sensors(self, category: SensorCategory) -> Sequence[SensorInfo]:
        return self._together.sensors(category)

    def sensor_status(self, category: SensorCategory, index: int) -> SensorStatus:
        return self._together.sensor_status(category, index)

    def read_sensor(self, category: SensorCategory, index: int) -> SensorReading:
        return self._together.read_sensor(category, index)

    def read_all(self) -> Measurements:
        return self._together.read_all()

    def read(self) -> SensorReading:
        boards = self._boards
        if self._measured_at != boards.tick:
            self._measured_at = boards.tick
            values = self._next_noise() - self._forces
            now = boards.now
            if self._drift is not None:
                values += self._drift.at(now)
            for fault in self.faults:
                fault(self.name, _FORCE_TORQUE, values, now)
            self._count(values)
            self._reading = SensorReading(values, now)
        return self._reading

    def calibrate(self, channel: int | None = None, value: float | None = None) -> None:
        if channel is not None and not 0 <= channel < self._zero.size:
            raise RefusedError(
                f"{self.name} has {self._zero.size} channels, counted from 0, and none with the number {channel}"
            )
        with self.simulation.lock:
            zero = self.sensor.read(self.simulation.data.sensordata) - (value or 0.0)
            if self._drift is not None:
                zero += self._drift.at(self.simulation.now)
            if channel is None:
                self._zero = zero
            else:
                self._zero[channel] = zero[channel]
            self._begin_anew()


class SimulatedForceTorques(Device, IMultipleAnalogSensors, IMeasurementsSource):
    """All force-torque sensors of the robot in one device."""

    def __init__(self, sensors: Sequence[SimulatedForceTorque], simulation: Simulation) -> None:
        super().__init__("force-torque sensors")
        self.simulation = simulation
        self._sensors = tuple(sensors)
        self._infos = tuple(SensorInfo(one.name, one.sensor.settings.link) for one in self._sensors)

    def open(self, configuration: Property) -> None:
        """Do nothing: it is open from its construction."""

    def close(self) -> None:
        """Do nothing: there are no resources."""

    def sensors(self, category: SensorCategory) -> Sequence[SensorInfo]:
        return self._infos if category is SensorCategory.FORCE_TORQUE else ()

    def sensor_status(self, category: SensorCategory, index: int) -> SensorStatus:
        return self._sensor(category, index).status

    def read_sensor(self, category: SensorCategory, index: int) -> SensorReading:
        return self._sensor(category, index).read()

    def read_all(self) -> Measurements:
        found: Measurements = [[]] * _CATEGORIES
        readings = found[_FORCE_TORQUE] = []
        for one in self._sensors:
            if one.status != _WELL:
                raise not_well(one.name, _FORCE_TORQUE, one.status)
            readings.append(one.read())
        return found

    def _sensor(self, category: SensorCategory, index: int) -> SimulatedForceTorque:
        if category is not SensorCategory.FORCE_TORQUE or not 0 <= index < len(self._sensors):
            raise RefusedError(f"{self.name}: there is no {SensorCategory(category).name} {index}")
        return self._sensors[index]


class SimulatedImu(SimulatedSensor, IMultipleAnalogSensors, IMeasurementsSource):
    """An inertial unit."""

    def __init__(self, imu: ImuSensor, simulation: Simulation) -> None:
        self.imu = imu
        settings = imu.settings
        accuracies = [settings.gyroscope, settings.accelerometer, settings.magnetometer, settings.orientation]
        super().__init__(imu.name, simulation, accuracies)
        found: FloatArray = simulation.data.sensordata
        self._vectors = found[imu.gyroscope.start : imu.magnetometer.stop]  # of all but the orientation
        self._quaternion = found[imu.orientation]
        self._info = (SensorInfo(imu.name, imu.frame),)
        self._readings: Measurements = []

    def sensors(self, category: SensorCategory) -> Sequence[SensorInfo]:
        return self._info if category in _IMU else ()

    def sensor_status(self, category: SensorCategory, index: int) -> SensorStatus:
        self._check(category, index)
        return self.status

    def read_sensor(self, category: SensorCategory, index: int) -> SensorReading:
        self._check(category, index)
        self._measure()
        return self._readings[category][0]

    def read_all(self) -> Measurements:
        if self.status != _WELL:
            raise not_well(self.name, SensorCategory.GYROSCOPE, self.status)
        self._measure()
        return self._readings

    def _measure(self) -> None:
        boards = self._boards
        if self._measured_at == boards.tick:
            return
        self._measured_at = boards.tick
        values = np.empty(self._deviation.size)
        np.multiply(self._vectors, _IMU_SCALES, values[: _IMU_SCALES.size])
        values[-3], values[-2], values[-1] = roll_pitch_yaw(self._quaternion)
        values += self._next_noise()
        now = boards.now
        if self._drift is not None:
            values += self._drift.at(now)
        for fault in self.faults:
            for category, place in _IMU_PLACES:
                fault(self.name, category, values[place], now)
        self._count(values)
        self._readings = [[SensorReading(values[place], now)] for _, place in _IMU_PLACES] + _OTHERS

    def _check(self, category: SensorCategory, index: int) -> None:
        if category not in _IMU or index != 0:
            raise RefusedError(f"{self.name}: there is no {SensorCategory(category).name} {index}")


_DEGREES = 180.0 / math.pi
#: Factors from the engine's units to those of gyroscope, accelerometer and magnetometer.
_IMU_SCALES = np.repeat([_DEGREES, 1.0, 1.0], 3)
#: The categories without sensors.
_OTHERS: Measurements = [[]] * (_CATEGORIES - len(_IMU))


def roll_pitch_yaw(quaternion: FloatArray) -> tuple[float, float, float]:
    """Convert a quaternion w, x, y, z to roll, pitch and yaw (deg) about the fixed axes x, y and z, in this order."""
    w, x, y, z = quaternion.tolist()
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return roll * _DEGREES, pitch * _DEGREES, yaw * _DEGREES
