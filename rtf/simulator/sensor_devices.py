"""Devices of a robot configuration for the sensors, which are attached to the simulation."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, Generic, TypeVar

from rtf.bottle import as_string
from rtf.robot.device import Device
from rtf.robot.errors import DeviceError
from rtf.robot.interfaces import IAnalogSensor, IMultipleAnalogSensors
from rtf.robot.sensors.measurements import IMeasurementsSource
from rtf.simulator.attachment import SimulatingDevice, simulating
from rtf.simulator.simulated_sensors import SimulatedForceTorque, SimulatedForceTorques, SimulatedImu

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rtf.bottle import Property
    from rtf.robot.interfaces import SensorCategory, SensorInfo, SensorReading, SensorStatus
    from rtf.robot.sensors.measurements import Measurements

S = TypeVar("S", SimulatedForceTorques, SimulatedImu)


class _AttachedSensors(Device, IMultipleAnalogSensors, IMeasurementsSource, Generic[S]):
    """Sensors of a simulation that runs in another thread: they are read between two of its steps."""

    _sensors: S | None = None

    @abstractmethod
    def _make(self, robot: SimulatingDevice) -> S:
        """Return the robot's sensors, with their faults. Raises DeviceError if it does not have them."""

    def open(self, configuration: Property) -> None:
        """Do nothing: ``attach`` makes the sensors."""

    def attach(self, devices: Mapping[str, Device]) -> None:
        """Attach the sensors to a simulated robot."""
        self._sensors = self._make(simulating(self, devices))

    def detach(self) -> None:
        self._sensors = None

    def close(self) -> None:
        self.detach()

    def _attached(self) -> S:
        if self._sensors is None:
            raise DeviceError(f"{self.name} is attached to no simulated robot; its action 'attach' comes first")
        return self._sensors

    def sensors(self, category: SensorCategory) -> Sequence[SensorInfo]:
        return self._attached().sensors(category)

    def sensor_status(self, category: SensorCategory, index: int) -> SensorStatus:
        return self._attached().sensor_status(category, index)

    def read_sensor(self, category: SensorCategory, index: int) -> SensorReading:
        sensors = self._attached()
        with sensors.simulation.lock:
            return sensors.read_sensor(category, index)

    def read_all(self) -> Measurements:
        """See IMeasurementsSource. All readings are of the same step."""
        sensors = self._attached()
        with sensors.simulation.lock:
            return sensors.read_all()


class SimulatedImuDevice(_AttachedSensors[SimulatedImu]):
    """``simulatedImu``: the inertial unit that ``sensor`` names, by default the robot's first one."""

    _name = ""

    def open(self, configuration: Property) -> None:
        self._name = as_string(configuration.get("sensor", ""))

    def _make(self, robot: SimulatingDevice) -> SimulatedImu:
        known = robot.devices(SimulatedImu)
        name = self._name or next(iter(known), "")
        if name not in known:
            raise DeviceError(
                f"{self.name}: the robot has no inertial unit {name!r}; it has {', '.join(known) or 'none'}"
            )
        return known[name]


class SimulatedForceTorqueDevice(_AttachedSensors[SimulatedForceTorques], IAnalogSensor):
    """``simulatedForceTorque``: the force-torque sensor that ``sensor`` names, such as ``l_arm_ft_sensor``."""

    _name = ""
    _sensor: SimulatedForceTorque | None = None

    def open(self, configuration: Property) -> None:
        self._name = as_string(configuration.find("sensor"))

    def _make(self, robot: SimulatingDevice) -> SimulatedForceTorques:
        known = robot.devices(SimulatedForceTorque)
        if self._name not in known:
            raise DeviceError(f"{self.name}: the robot has no sensor {self._name!r}; it has {', '.join(known)}")
        self._sensor = known[self._name]
        return SimulatedForceTorques((self._sensor,), robot.simulation)

    def _single(self) -> SimulatedForceTorque:
        self._attached()
        assert self._sensor is not None
        return self._sensor

    def channels(self) -> int:
        return self._single().channels()

    def read(self) -> SensorReading:
        sensor = self._single()
        with sensor.simulation.lock:
            return sensor.read()

    def calibrate(self, channel: int | None = None, value: float | None = None) -> None:
        sensor = self._single()
        with sensor.simulation.lock:
            sensor.calibrate(channel, value)
