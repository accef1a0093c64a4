"""Forward kinematics of the simulated robot, computed by the physics engine."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.errors import RefusedError
from rtf.simulator.axes import INDEX
from rtf.simulator.engine import mujoco
from rtf.simulator.model import Options, build

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.robot.interfaces import FloatArray


class SimulatedKinematics:
    """The links of the simulated robot, with the interface of :class:`.KinematicModel`.

    Raises MissingPackageError without the simulator's packages.
    """

    place = "the simulator's model"

    def __init__(self) -> None:
        self._robot = build(Options(collision="none"))
        self._data = self._robot.data()
        model = self._robot.model
        self.links = {model.body(number).name for number in range(model.nbody)}

    def transform(self, link: str, angles: Mapping[str, float]) -> FloatArray:
        """Return the pose of a link in the world (4x4), with joints at these angles (rad) and all others at 0.

        Raises RefusedError for an unknown link or joint.
        """
        unknown = sorted(set(angles) - set(INDEX))
        if unknown or link not in self.links:
            raise RefusedError(f"{self.place} has no {', '.join(unknown) or link}")
        axes = np.zeros(len(INDEX))
        for joint, angle in angles.items():
            axes[INDEX[joint]] = angle
        self._data.qpos[:] = self._robot.pose(axes)
        mujoco().mj_kinematics(self._robot.model, self._data)
        body = self._data.body(link)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = np.reshape(body.xmat, (3, 3)), body.xpos
        return pose
