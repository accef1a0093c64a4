"""Static loads of a robot's force-torque sensors in a posture, computed with the model of the robot."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.errors import RefusedError
from rtf.robot.model.engine import mujoco
from rtf.simulator.plant import Options, build

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.robot.model import RobotModel


def place_of(robot: RobotModel, sensor: str) -> str:
    """Return the place of a sensor, such as left_arm for l_arm_ft_sensor; "" for an unknown one.

    A name without the last word, ``_sensor``, is that of the same sensor in other versions of a description.
    """
    for name, settings in robot.sensors.force_torque.items():
        if sensor in (name, name.removesuffix("_sensor")):
            return settings.port
    return ""


def parts_above(robot: RobotModel, place: str) -> tuple[str, ...]:
    """Return the parts whose posture determines the load of a sensor; none for a place without a sensor."""
    for settings in robot.sensors.force_torque.values():
        if settings.port == place:
            return tuple(settings.parts)
    return ()


class WeightModel:
    """Static loads of the robot's sensors: ``set`` the joints, then get a ``load``.

    Raises MissingPackageError without the simulator's packages.
    """

    def __init__(self, robot: RobotModel) -> None:
        self._index = robot.index
        self._units = [axis.internal for axis in robot.axes]
        self._robot = build(robot, Options(collision="none"))
        self._axes = self._robot.home_axes.copy()

    def set(self, joints: Sequence[str], positions: Sequence[float] | FloatArray) -> None:
        """Set joint positions, deg or m; joints that the model does not have are ignored."""
        for joint, position in zip(joints, positions, strict=True):
            if joint in self._index:
                self._axes[self._index[joint]] = position * self._units[self._index[joint]]

    def load(self, place: str) -> FloatArray:
        """Return the reading of a sensor: forces (N) and torques (Nm), six.

        Raises RefusedError for an unknown place.
        """
        sensors = {sensor.settings.port: sensor for sensor in self._robot.ft_sensors}
        if place not in sensors:
            raise RefusedError(f"there is no force-torque sensor at {place!r}; there are {', '.join(sensors)}")
        data = self._robot.data()
        data.qpos[:] = self._robot.pose(self._axes)
        data.qvel[:] = 0.0
        data.qacc[:] = 0.0
        # Inverse dynamics: the forces that keep it at rest, and the sensor readings for them.
        mujoco().mj_inverse(self._robot.model, data)
        return sensors[place].read(data.sensordata)
