"""Gravity model: the torques that hold a robot at rest in any posture."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rtf.robot.errors import RefusedError
from rtf.robot.model.engine import mujoco

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.robot.model import RobotModel

#: The visual and collision shapes of a URDF: the mesh files that they name need not exist.
_SHAPE = re.compile(r"<(visual|collision)\b.*?</\1>", re.DOTALL)


class GravityModel:
    """The gravity model of a robot, or of a description (URDF file) whose joints are named like the robot's axes.

    The root is fixed and upright. Raises MissingPackageError, with how to install the package, and RefusedError for a
    description that cannot be read.
    """

    def __init__(self, robot: RobotModel, description: str = "") -> None:
        if description:
            self._load(description)
        else:
            self._build(robot)

    def _build(self, robot: RobotModel) -> None:
        from rtf.simulator.plant import Options, build

        plant = build(robot, Options(collision="none"))
        self._index: dict[str, int] = dict(robot.index)
        self._pose, self._worth = plant.pose, plant.axis_torques
        self._home = plant.home_axes.copy()
        self._degrees = [axis.degree for axis in robot.axes]
        self._model, self._data = plant.model, plant.data()

    def _load(self, description: str) -> None:
        engine = mujoco()
        try:
            text = _SHAPE.sub("", Path(description).read_text(encoding="utf-8"))
            model = engine.MjSpec.from_string(text).compile()
        except (OSError, UnicodeDecodeError, ValueError) as error:
            raise RefusedError(f"{description}: cannot read a robot description (URDF): {error}") from error
        hinges = [model.joint(number) for number in range(model.njnt)]
        addresses = np.array([int(hinge.qposadr[0]) for hinge in hinges])
        dofs = np.array([int(hinge.dofadr[0]) for hinge in hinges])
        self._index = {hinge.name: number for number, hinge in enumerate(hinges)}
        self._home = np.zeros(model.njnt)
        self._degrees = [np.radians(1.0)] * model.njnt
        self._model, self._data = model, engine.MjData(model)

        def pose(axes: Any) -> Any:
            qpos = np.zeros(model.nq)
            qpos[addresses] = axes
            return qpos

        self._pose, self._worth = pose, lambda forces: np.asarray(forces)[dofs]

    def __contains__(self, name: object) -> bool:
        return name in self._index

    def torques(self, positions: Mapping[str, float]) -> dict[str, float]:
        """Return the torque of each axis (Nm, N) in a posture; axes without a position are at home.

        Positions are in deg; of a prismatic joint in what stands for one, :attr:`rtf.robot.model.Axis.degree`.
        """
        axes = self._home.copy()
        for name, degrees in positions.items():
            if name in self._index:
                axes[self._index[name]] = degrees * self._degrees[self._index[name]]
        data = self._data
        data.qpos[:] = self._pose(axes)
        data.qvel[:] = 0.0
        mujoco().mj_forward(self._model, data)
        found = self._worth(data.qfrc_bias)
        return {name: float(found[place]) for name, place in self._index.items()}
