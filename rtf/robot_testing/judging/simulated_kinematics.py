"""Forward kinematics of the simulated robot, computed by the physics engine."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.errors import RefusedError
from rtf.robot.model.engine import mujoco
from rtf.simulator.plant import Options, build

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.robot.interfaces import FloatArray
    from rtf.robot.model import RobotModel


class SimulatedKinematics:
    """The links of the simulated robot, with the interface of :class:`.KinematicModel`.

    Raises MissingPackageError without the simulator's packages.
    """

    place = "the simulator's model"

    def __init__(self, robot: RobotModel) -> None:
        self._robot = build(robot, Options(collision="none"))
        self._index = robot.index
        self._data = self._robot.data()
        model = self._robot.model
        self.links = {model.body(number).name for number in range(model.nbody)}

    def transform(self, link: str, angles: Mapping[str, float]) -> FloatArray:
        """Return the pose of a link in the world (4x4), with joints at these angles (rad) and all others at 0.

        Raises RefusedError for an unknown link or joint.
        """
        unknown = sorted(set(angles) - set(self._index))
        if unknown or link not in self.links:
            raise RefusedError(f"{self.place} has no {', '.join(unknown) or link}")
        axes = np.zeros(len(self._index))
        for joint, angle in angles.items():
            axes[self._index[joint]] = angle
        self._data.qpos[:] = self._robot.pose(axes)
        mujoco().mj_kinematics(self._robot.model, self._data)
        body = self._data.body(link)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = np.reshape(body.xmat, (3, 3)), body.xpos
        return pose
