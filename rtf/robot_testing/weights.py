"""What hangs at the force-torque sensors of the iCub, by the model of the robot, in a posture at rest."""

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

#: The sensors by the place that their ports are named after, and the parts whose joints decide how the load hangs:
#: those between the root, which is held upright, and the end of the limb.
_SENSORS = {
    f"{side}_{limb}": (f"{side[0]}_{limb}_ft_sensor", ("torso", f"{side}_arm") if limb == "arm" else (f"{side}_leg",))
    for side in ("left", "right")
    for limb in ("arm", "leg", "foot")
}

#: The same places by what the sensors are called in messages of many; icub-models 2.0 left the last word out.
_PLACES = {name: place for place, (sensor, _) in _SENSORS.items() for name in (sensor, sensor.removesuffix("_sensor"))}


def place_of(sensor: str) -> str:
    """The place of a sensor, such as left_arm of l_arm_ft_sensor; "" for one that is not known."""
    return _PLACES.get(sensor, "")


def parts_above(place: str) -> tuple[str, ...]:
    """The parts on which the load of a sensor depends; none for a place that has no force-torque sensor."""
    return _SENSORS[place][1] if place in _SENSORS else ()


class WeightModel:
    """The robot's weights. ``set`` its joints, then ask for a ``load``. MissingPackageError without the simulator."""

    def __init__(self) -> None:
        self._robot = build(Options(collision="none"))
        self._axes = self._robot.home_axes.copy()

    def set(self, joints: Sequence[str], positions: Sequence[float] | FloatArray) -> None:
        """Say where joints are, deg; those that the model does not have are passed over."""
        for joint, position in zip(joints, positions, strict=True):
            if joint in INDEX:
                self._axes[INDEX[joint]] = np.radians(position)

    def load(self, place: str) -> FloatArray:
        """What the sensor there shows: forces (N) and torques (Nm), six. Raises RefusedError for another place."""
        if place not in _SENSORS:
            raise RefusedError(f"there is no force-torque sensor at {place!r}; there are {', '.join(_SENSORS)}")
        data = self._robot.data()
        data.qpos[:] = self._robot.pose(self._axes)
        data.qvel[:] = 0.0
        data.qacc[:] = 0.0
        # Backwards: the forces that keep it at rest, whatever gives them, and what the sensors show of them.
        mujoco().mj_inverse(self._robot.model, data)
        (sensor,) = (one for one in self._robot.ft_sensors if one.name == _SENSORS[place][0])
        return sensor.read(data.sensordata)
