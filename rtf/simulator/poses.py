"""The poses in which a robot stands: home, and the safe ones; and what is wrong with them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rtf.robot.model.engine import mujoco
from rtf.simulator.contacts import touching
from rtf.simulator.workspace import outside

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from rtf.simulator.plant import Plant

#: A drive that gravity loads with more than this share of its torque has too little left to move.
_LOADED = 0.8


def poses(plant: Plant) -> dict[str, NDArray[np.float64]]:
    """Return home and the safe poses by their names: positions of the axes (rad, m)."""
    return {"home": plant.home_axes, **{name: _axes(plant, pose) for name, pose in plant.robot.safe_poses.items()}}


def _axes(plant: Plant, pose: Mapping[str, float]) -> NDArray[np.float64]:
    return np.array([pose[axis.name] * axis.internal for axis in plant.robot.axes])


def standing(plant: Plant, axes: NDArray[np.float64]) -> Any:
    """Return a new MjData of the robot at rest in a pose, forwarded."""
    data = plant.data()
    data.qpos[:] = plant.pose(axes)
    mujoco().mj_forward(plant.model, data)
    return data


def problems_of(plant: Plant) -> list[str]:
    """Return what keeps a robot from standing in its poses, a sentence each.

    These are links that touch, joints that gravity loads too much, and points outside of the workspace.
    """
    found = []
    robot = plant.robot
    for name, axes in poses(plant).items():
        where = "the home pose" if name == "home" else f"the safe pose {name}"
        data = standing(plant, axes)
        found += [f"{first} and {second} touch in {where}" for first, second in touching(plant.model, data)]
        for axis, load in zip(robot.axes, plant.axis_torques(data.qfrc_bias).tolist(), strict=True):
            if abs(load) > _LOADED * axis.max_torque:
                found.append(
                    f"{axis.name}: gravity takes {abs(load):.3g} of its {axis.max_torque:g} in {where}; see max_torque"
                )
        found += [f"{sentence} in {where}" for sentence in outside(robot, plant.model, data)]
    return found
