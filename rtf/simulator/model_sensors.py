"""The sensors on a robot's links: force-torque sensors and inertial units.

A sensor of the model is a slice of ``data.sensordata``; the classes here hold the slices.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rtf.robot.model.bodies import link_of
from rtf.robot.model.engine import mujoco
from rtf.robot.model.errors import RobotModelError
from rtf.simulator.scene import OUTSIDE

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from rtf.robot.model import RobotModel
    from rtf.robot.model.file import ForceTorque, Inertial


@dataclass(frozen=True, slots=True)
class FtSensor:
    """A six-axis force-torque sensor, in the sensor's frame; :meth:`read` has the sign of the robot's sensors.

    The slices are the engine's numbers: the force of the parent link on the child link, so a hanging arm shows its
    weight upwards. The robot's sensors measure the force of the child on the parent, with the opposite sign.
    """

    name: str
    settings: ForceTorque  # its link has the sensor's frame
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
    settings: Inertial
    orientation: slice  # quaternion w, x, y, z of the sensor in the world
    gyroscope: slice  # rad/s
    accelerometer: slice  # m/s2; upwards 9.81 at rest
    magnetometer: slice  # T


def add_sensors(spec: Any, robot: RobotModel) -> None:
    """Add the robot's sensors to its links.

    Raises RobotModelError for a link or a camera that the description does not have.
    """
    _check_cameras(spec, robot)
    for name, patch in robot.sensors.skin.items():
        link_of(spec, robot, patch.link, f"the skin {name}", "sensors", "skin", name, "link")
    kinds, site = mujoco().mjtSensor, mujoco().mjtObj.mjOBJ_SITE
    for name, sensor in robot.sensors.force_torque.items():
        link = link_of(spec, robot, sensor.link, f"the sensor {name}", "sensors", "force_torque", name, "link")
        link.add_site(name=name)
        spec.add_sensor(name=f"{name}/force", type=kinds.mjSENS_FORCE, objtype=site, objname=name)
        spec.add_sensor(name=f"{name}/torque", type=kinds.mjSENS_TORQUE, objtype=site, objname=name)
    for name, unit in robot.sensors.inertial.items():
        link = link_of(spec, robot, unit.link, f"the sensor {name}", "sensors", "inertial", name, "link")
        link.add_site(name=name, pos=unit.position, quat=_quaternion(*unit.rotation))
        for kind, what in (
            (kinds.mjSENS_FRAMEQUAT, "orientation"),
            (kinds.mjSENS_GYRO, "gyroscope"),
            (kinds.mjSENS_ACCELEROMETER, "accelerometer"),
            (kinds.mjSENS_MAGNETOMETER, "magnetometer"),
        ):
            spec.add_sensor(name=f"{name}/{what}", type=kind, objtype=site, objname=name)


def _check_cameras(spec: Any, robot: RobotModel) -> None:
    known = [camera.name for camera in spec.cameras] + [OUTSIDE]
    for kind in ("cameras", "depth_cameras"):
        for name, sensor in getattr(robot.sensors, kind).items():
            if sensor.camera not in known:
                raise RobotModelError(
                    f"{robot.place('sensors', kind, name, 'camera')}: {robot.description.name} has no camera "
                    f"{sensor.camera!r}; there are {', '.join(known)}"
                )


def ft_sensors(model: Any, robot: RobotModel) -> tuple[FtSensor, ...]:
    """Return the force-torque sensors of a compiled model."""
    return tuple(
        FtSensor(name, sensor, _slice(model, f"{name}/force"), _slice(model, f"{name}/torque"))
        for name, sensor in robot.sensors.force_torque.items()
    )


def imu_sensors(model: Any, robot: RobotModel) -> tuple[ImuSensor, ...]:
    """Return the inertial units of a compiled model."""
    return tuple(
        ImuSensor(
            name=name,
            frame=name,
            settings=unit,
            orientation=_slice(model, f"{name}/orientation"),
            gyroscope=_slice(model, f"{name}/gyroscope"),
            accelerometer=_slice(model, f"{name}/accelerometer"),
            magnetometer=_slice(model, f"{name}/magnetometer"),
        )
        for name, unit in robot.sensors.inertial.items()
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
