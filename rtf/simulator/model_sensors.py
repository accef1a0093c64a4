"""The sensors on the robot's links: six force-torque sensors and the inertial unit of the head.

A sensor of the model is a slice of ``data.sensordata``; the classes here hold the slices.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rtf.simulator.engine import mujoco

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_FORCE_TORQUE = {
    "l_arm_ft_sensor": "l_upper_arm",
    "r_arm_ft_sensor": "r_upper_arm",
    "l_leg_ft_sensor": "l_hip_3",
    "r_leg_ft_sensor": "r_hip_3",
    "l_foot_ft_sensor": "l_foot",
    "r_foot_ft_sensor": "r_foot",
}
#: Links that must stay separate bodies, because a sensor measures the forces at their joint.
SENSED_LINKS = frozenset(_FORCE_TORQUE.values())

_IMU = "head_imu_0"
_IMU_POSITION = (0.0095, 0.133444, 0.0093)  # m, in the frame of the head
_IMU_ROTATION = (-math.pi / 2, math.pi / 2, 0.0)  # roll, pitch, yaw about fixed axes, as in the description


@dataclass(frozen=True, slots=True)
class FtSensor:
    """A six-axis force-torque sensor, in the sensor's frame; :meth:`read` has the sign of the robot's sensors.

    The slices are the engine's numbers: the force of the parent link on the child link, so a hanging arm shows its
    weight upwards. The robot's sensors measure the force of the child on the parent, with the opposite sign.
    """

    name: str
    frame: str  # the link whose frame is the sensor's
    force: slice  # of data.sensordata, N, parent on child
    torque: slice  # Nm, likewise, about the sensor's origin

    def read(self, sensordata: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return force (N) and torque (Nm) of the child link on the parent link, as six numbers."""
        return -sensordata[self.force.start : self.torque.stop]


@dataclass(frozen=True, slots=True)
class ImuSensor:
    """An inertial unit; each slice is of data.sensordata, and in the sensor's frame."""

    name: str
    frame: str
    orientation: slice  # quaternion w, x, y, z of the sensor in the world
    gyroscope: slice  # rad/s
    accelerometer: slice  # m/s2; upwards 9.81 at rest
    magnetometer: slice  # T


def add_sensors(spec: Any) -> None:
    """Add the sensors to the links."""
    kinds, site = mujoco().mjtSensor, mujoco().mjtObj.mjOBJ_SITE
    for name, link in _FORCE_TORQUE.items():
        spec.body(link).add_site(name=name)
        spec.add_sensor(name=f"{name}/force", type=kinds.mjSENS_FORCE, objtype=site, objname=name)
        spec.add_sensor(name=f"{name}/torque", type=kinds.mjSENS_TORQUE, objtype=site, objname=name)
    spec.body("head").add_site(name=_IMU, pos=_IMU_POSITION, quat=_quaternion(*_IMU_ROTATION))
    spec.add_sensor(name=f"{_IMU}/orientation", type=kinds.mjSENS_FRAMEQUAT, objtype=site, objname=_IMU)
    spec.add_sensor(name=f"{_IMU}/gyroscope", type=kinds.mjSENS_GYRO, objtype=site, objname=_IMU)
    spec.add_sensor(name=f"{_IMU}/accelerometer", type=kinds.mjSENS_ACCELEROMETER, objtype=site, objname=_IMU)
    spec.add_sensor(name=f"{_IMU}/magnetometer", type=kinds.mjSENS_MAGNETOMETER, objtype=site, objname=_IMU)


def ft_sensors(model: Any) -> tuple[FtSensor, ...]:
    """Return the force-torque sensors of a compiled model."""
    return tuple(
        FtSensor(name, link, _slice(model, f"{name}/force"), _slice(model, f"{name}/torque"))
        for name, link in _FORCE_TORQUE.items()
    )


def imu_sensor(model: Any) -> ImuSensor:
    """Return the inertial unit of a compiled model."""
    return ImuSensor(
        name=_IMU,
        frame=_IMU,
        orientation=_slice(model, f"{_IMU}/orientation"),
        gyroscope=_slice(model, f"{_IMU}/gyroscope"),
        accelerometer=_slice(model, f"{_IMU}/accelerometer"),
        magnetometer=_slice(model, f"{_IMU}/magnetometer"),
    )


def _slice(model: Any, name: str) -> slice:
    sensor = model.sensor(name)
    first = int(sensor.adr[0])
    return slice(first, first + int(sensor.dim[0]))


def _quaternion(roll: float, pitch: float, yaw: float) -> list[float]:
    """Return the quaternion w, x, y, z of the rotation by roll, pitch and yaw about fixed x, y and z, in this order."""
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]
