"""Faults of force-torque sensors, of the inertial unit, of the cameras and of the battery."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import SensorCategory
from rtf.simulator.faults.base import Fault, Layer, Parameter, Target

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.robot.interfaces import FloatArray
    from rtf.robot.sensors.battery import BatteryReading
    from rtf.simulator.battery import SimulatedBattery
    from rtf.simulator.simulated_cameras import SimulatedCamera
    from rtf.simulator.simulated_sensors import SimulatedForceTorque, SimulatedImu


class _SensorFault(Fault):
    layer = Layer.SENSOR
    sensor: SimulatedForceTorque | SimulatedImu

    def begin(self) -> None:
        self.sensor.faults.append(self.show)

    def end(self) -> None:
        self.sensor.faults.remove(self.show)

    def show(self, name: str, category: SensorCategory, values: FloatArray, now: float) -> None:
        """Change the measurements in place."""
        raise NotImplementedError


class ForceTorqueFault(_SensorFault):
    """A fault of a force-torque sensor."""

    target_kind = Target.FORCE_TORQUE

    def aim(self) -> None:
        known = self.robot.force_torques
        if self.target not in known:
            raise RefusedError(
                f"{self.kind}: there is no force-torque sensor {self.target!r}; there are {', '.join(known)}"
            )
        self.sensor = known[self.target]


class ForceTorqueBias(ForceTorqueFault):
    """Offset of a force-torque sensor."""

    kind = "ft_bias"
    description = "The force-torque sensor has an offset: it was overloaded, or never calibrated."
    symptom = "Its force is not the weight of the links below it."
    parameters = (
        Parameter("force", 10.0, "N", "added to each force", -1e4, 1e4),
        Parameter("torque", 0.0, "Nm", "added to each torque", -1e4, 1e4),
    )
    force: float
    torque: float

    def show(self, name: str, category: SensorCategory, values: FloatArray, now: float) -> None:
        del name, category, now
        values[:3] += self.force
        values[3:] += self.torque


class ForceTorqueFrozen(ForceTorqueFault):
    """Constant reading of a force-torque sensor."""

    kind = "ft_frozen"
    description = "The force-torque sensor repeats its last measurement."
    symptom = "The readings have no noise and do not change."
    _held: FloatArray | None = None

    def show(self, name: str, category: SensorCategory, values: FloatArray, now: float) -> None:
        del name, category, now
        if self._held is None:
            self._held = values.copy()
        values[:] = self._held


class ForceTorqueNoise(ForceTorqueFault):
    """Noise of a force-torque sensor."""

    kind = "ft_noise"
    description = "The force-torque sensor is noisy."
    symptom = "The standard deviation of its forces is many times too large."
    parameters = (Parameter("deviation", 2.0, "N", "standard deviation of each force", 0.0, 1e4),)
    deviation: float

    def show(self, name: str, category: SensorCategory, values: FloatArray, now: float) -> None:
        del name, category, now
        values[:3] += self.simulation.random.normal(0.0, self.deviation, 3)


class ImuFault(_SensorFault):
    """A fault of an inertial unit."""

    target_kind = Target.IMU

    def aim(self) -> None:
        units = {sensor.name: sensor for sensor in self.robot.imus.values()}
        if self.target in ("", "imu") and len(units) == 1:
            (self.sensor,) = units.values()
        elif self.target in units:
            self.sensor = units[self.target]
        else:
            raise RefusedError(
                f"{self.kind}: the robot has no inertial unit {self.target!r}; there are {', '.join(units) or 'none'}"
            )


class ImuRotated(ImuFault):
    """Rotated mounting of the inertial unit."""

    kind = "imu_rotated"
    description = "The inertial unit is mounted with a rotation about its z axis."
    symptom = "Orientation and direction of gravity do not agree with the posture of the head."
    parameters = (Parameter("angle", 90.0, "deg", "angle of the rotation", -360.0, 360.0),)
    angle: float

    def show(self, name: str, category: SensorCategory, values: FloatArray, now: float) -> None:
        del name, now
        if category is SensorCategory.ORIENTATION:
            values[:] = _rpy(_rotation(*np.radians(values)) @ _rotation(0.0, 0.0, math.radians(self.angle)))
        else:
            values[:] = _rotation(0.0, 0.0, math.radians(self.angle)).T @ values


class ImuFrozen(ImuFault):
    """Constant reading of the inertial unit."""

    kind = "imu_frozen"
    description = "The inertial unit repeats its last measurement."
    symptom = "The readings have no noise; the orientation does not change while the head moves."

    def begin(self) -> None:
        self._held: dict[SensorCategory, FloatArray] = {}
        super().begin()

    def show(self, name: str, category: SensorCategory, values: FloatArray, now: float) -> None:
        del name, now
        values[:] = self._held.setdefault(category, values.copy())


class CameraFault(Fault):
    """A fault of a camera: ``show`` changes its pictures."""

    layer = Layer.CAMERA
    target_kind = Target.CAMERA
    camera: SimulatedCamera

    def aim(self) -> None:
        known = self.robot.cameras
        if self.target not in known:
            there = ", ".join(known) or "none, as the robot was started without cameras"
            raise RefusedError(f"{self.kind}: there is no camera {self.target!r}; there are {there}")
        self.camera = known[self.target]

    def begin(self) -> None:
        self.camera.faults.append(self.show)

    def end(self) -> None:
        self.camera.faults.remove(self.show)

    def show(self, pixels: NDArray[np.uint8], now: float) -> NDArray[np.uint8]:
        """Return the picture to be published instead."""
        raise NotImplementedError


class CameraFrozen(CameraFault):
    """Repetition of the last image of a camera."""

    kind = "camera_frozen"
    description = "The camera sends the same picture again and again."
    symptom = "Pictures are identical although the scene moves."
    _held: NDArray[np.uint8] | None = None

    def show(self, pixels: NDArray[np.uint8], now: float) -> NDArray[np.uint8]:
        del now
        if self._held is None:
            self._held = pixels
        return self._held


class CameraBlack(CameraFault):
    """Black images of a camera."""

    kind = "camera_black"
    description = "The camera sends black pictures: its cap is on, or its sensor is dead."
    symptom = "All pixels are the same."

    def show(self, pixels: NDArray[np.uint8], now: float) -> NDArray[np.uint8]:
        del now
        return np.zeros_like(pixels)


class CameraSize(CameraFault):
    """Images of a camera in another size than announced."""

    kind = "camera_size"
    description = "The camera sends pictures of another size than it announces."
    symptom = "Pictures are half as wide and half as high as configured."

    def show(self, pixels: NDArray[np.uint8], now: float) -> NDArray[np.uint8]:
        del now
        return np.ascontiguousarray(pixels[::2, ::2])


class _BatteryFault(Fault):
    layer = Layer.SENSOR
    target_kind = Target.BATTERY
    battery: SimulatedBattery

    def aim(self) -> None:
        battery = self.robot.battery
        if battery is None or self.target not in ("", "battery"):
            there = "no battery" if battery is None else f"no battery {self.target!r}; its name is battery"
            raise RefusedError(f"{self.kind}: the robot has {there}")
        self.battery = battery


class BatteryWeak(_BatteryFault):
    """Lost capacity of the battery."""

    kind = "battery_weak"
    description = "The battery has lost capacity: its cells are old, or one of them is dead."
    symptom = "The charge falls faster than the current explains."
    parameters = (Parameter("share", 0.5, "", "share of the capacity that is left", 0.01, 1.0, healthy=1.0),)
    share: float

    def begin(self) -> None:
        self.battery.weaknesses.append(self.share)

    def end(self) -> None:
        self.battery.weaknesses.remove(self.share)


class BatteryFrozen(_BatteryFault):
    """Constant readings of the battery."""

    kind = "battery_frozen"
    description = "The battery's gauge repeats its last measurement."
    symptom = "The readings have no noise, and the charge does not fall."
    _held: BatteryReading | None = None

    def begin(self) -> None:
        self._held = None
        self.battery.faults.append(self.show)

    def end(self) -> None:
        self.battery.faults.remove(self.show)

    def show(self, reading: BatteryReading, now: float) -> BatteryReading:
        """Return the first reading of the fault."""
        del now
        if self._held is None:
            self._held = reading
        return self._held


def _rotation(roll: float, pitch: float, yaw: float) -> FloatArray:
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def _rpy(rotation: FloatArray) -> FloatArray:
    pitch = math.asin(max(-1.0, min(1.0, -rotation[2, 0])))
    return np.degrees([math.atan2(rotation[2, 1], rotation[2, 2]), pitch, math.atan2(rotation[1, 0], rotation[0, 0])])


KINDS = (
    ForceTorqueBias,
    ForceTorqueFrozen,
    ForceTorqueNoise,
    ImuRotated,
    ImuFrozen,
    CameraFrozen,
    CameraBlack,
    CameraSize,
    BatteryWeak,
    BatteryFrozen,
)
