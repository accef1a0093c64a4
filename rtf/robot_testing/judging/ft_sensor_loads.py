"""Static loads of the iCub's force-torque sensors in a posture, computed with the model of the robot."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.errors import RefusedError
from rtf.simulator.axes import INDEX
from rtf.simulator.engine import mujoco
from rtf.simulator.model import Options, build

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import FloatArray

#: Sensors by the place in their port names, with the parts whose joints determine the direction of the load: those
#: between the root, which is upright, and the end of the limb.
_SENSORS = {
    f"{side}_{limb}": (f"{side[0]}_{limb}_ft_sensor", ("torso", f"{side}_arm") if limb == "arm" else (f"{side}_leg",))
    for side in ("left", "right")
    for limb in ("arm", "leg", "foot")
}

#: The places by the sensor names in messages of several sensors; icub-models 2.0 has them without the last word.
_PLACES = {name: place for place, (sensor, _) in _SENSORS.items() for name in (sensor, sensor.removesuffix("_sensor"))}


def place_of(sensor: str) -> str:
    """Return the place of a sensor, such as left_arm for l_arm_ft_sensor; "" for an unknown one."""
    return _PLACES.get(sensor, "")


def parts_above(place: str) -> tuple[str, ...]:
    """Return the parts whose posture determines the load of a sensor; none for a place without a sensor."""
    return _SENSORS[place][1] if place in _SENSORS else ()


class WeightModel:
    """Static loads of the robot's sensors: ``set`` the joints, then get a ``load``.

    Raises MissingPackageError without the simulator's packages.
    """

    def __init__(self) -> None:
        self._robot = build(Options(collision="none"))
        self._axes = self._robot.home_axes.copy()

    def set(self, joints: Sequence[str], positions: Sequence[float] | FloatArray) -> None:
        """Set joint positions, deg; joints that the model does not have are ignored."""
        for joint, position in zip(joints, positions, strict=True):
            if joint in INDEX:
                self._axes[INDEX[joint]] = np.radians(position)

    def load(self, place: str) -> FloatArray:
        """Return the reading of a sensor: forces (N) and torques (Nm), six.

        Raises RefusedError for an unknown place.
        """
        if place not in _SENSORS:
            raise RefusedError(f"there is no force-torque sensor at {place!r}; there are {', '.join(_SENSORS)}")
        data = self._robot.data()
        data.qpos[:] = self._robot.pose(self._axes)
        data.qvel[:] = 0.0
        data.qacc[:] = 0.0
        # Inverse dynamics: the forces that keep it at rest, and the sensor readings for them.
        mujoco().mj_inverse(self._robot.model, data)
        (sensor,) = (one for one in self._robot.ft_sensors if one.name == _SENSORS[place][0])
        return sensor.read(data.sensordata)
