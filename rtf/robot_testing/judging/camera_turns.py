"""Where the cameras of a robot look, by its model: directions, and the joints that turn them in place."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.model.engine import mujoco
from rtf.simulator.plant import Options, build

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.robot.model import RobotModel

#: A camera that moves less than this (m) for a few degrees turns in place: 0.2 deg for what is at half a metre.
_IN_PLACE = 0.002
#: Such a joint turns some camera by at least this share of its own way.
_TURNS = 0.3


class CameraTurns:
    """The directions of cameras: ``set`` the joints, then get the ``axes``. ``cameras`` are their names in the model.

    Raises MissingPackageError without the simulator's packages.
    """

    def __init__(self, robot: RobotModel, cameras: Mapping[str, str]) -> None:
        self._robot = robot
        self._plant = build(robot, Options(collision="none"))
        self._data = self._plant.data()
        self._cameras = {name: self._plant.model.camera(camera).id for name, camera in cameras.items()}
        self._internal = [axis.internal for axis in robot.axes]
        self._axes = self._plant.home_axes.copy()
        self._first = self._frames(self._axes)

    def set(self, joints: Sequence[str], positions: FloatArray) -> None:
        """Set joint positions, deg or m."""
        for joint, position in zip(joints, positions, strict=True):
            if joint in self._robot.index:
                place = self._robot.index[joint]
                self._axes[place] = position * self._internal[place]

    def axes(self) -> dict[str, FloatArray]:
        """Return by how much the middle of the picture at home has moved for each camera: right and down, tangents."""
        return {
            name: _moved(first, frame)
            for (name, (frame, _)), (first, _) in zip(
                self._frames(self._axes).items(), self._first.values(), strict=True
            )
        }

    def alike(self, most: float) -> list[tuple[str, str]]:
        """Return the pairs of cameras that see the same scene at home: they look the same way within ``most`` deg."""
        ways = {name: -frame[:, 2] for name, (frame, _) in self._first.items()}
        return [
            (one, other)
            for one, other in itertools.combinations(ways, 2)
            if ways[one] @ ways[other] > math.cos(math.radians(most))
        ]

    def turning(self, way: float) -> list[tuple[str, int]]:
        """Return the joints, by part and number, that turn cameras in place: ``way`` is a move of each (deg)."""
        found = []
        for part in self._robot.parts.values():
            for number, axis in enumerate(part.axes):
                pose = self._plant.home_axes.copy()
                pose[self._robot.index[axis.name]] += math.radians(way) if not axis.prismatic else way * axis.degree
                frames = self._frames(pose)
                moves = [np.linalg.norm(frames[name][1] - place) for name, (_, place) in self._first.items()]
                turns = [np.abs(_moved(first, frames[name][0])).max() for name, (first, _) in self._first.items()]
                if max(moves) < _IN_PLACE and max(turns) > _TURNS * math.tan(math.radians(way)):
                    found.append((part.name, number))
        return found

    def _frames(self, axes: FloatArray) -> dict[str, tuple[FloatArray, FloatArray]]:
        """Return the orientation and the place of each camera in a pose (rad, m)."""
        engine, model, data = mujoco(), self._plant.model, self._data
        data.qpos[:] = self._plant.pose(axes)
        engine.mj_kinematics(model, data)
        engine.mj_comPos(model, data)
        engine.mj_camlight(model, data)
        return {
            name: (data.cam_xmat[number].reshape(3, 3).copy(), data.cam_xpos[number].copy())
            for name, number in self._cameras.items()
        }


def _moved(before: FloatArray, after: FloatArray) -> FloatArray:
    """Return where the middle of a picture is after a turn: right and down, as tangents of angles.

    A camera looks along its -z, its x is to the right, its y upwards.
    """
    x, y, z = after.T @ before @ np.array([0.0, 0.0, -1.0])
    return np.array([-x / z, y / z])
