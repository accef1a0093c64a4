"""The torques that hold a robot still, by a model of it, in any posture."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rtf.robot.errors import RefusedError
from rtf.simulator.engine import mujoco

if TYPE_CHECKING:
    from collections.abc import Mapping

#: What a description says about looks and touch of a link; the files that it names need not be there.
_SHAPE = re.compile(r"<(visual|collision)\b.*?</\1>", re.DOTALL)


class GravityModel:
    """The model of the iCub, or with a path that of a description (URDF) whose joints are named as the robot's axes.

    The root stands still and upright. MissingPackageError says how to install what is needed; RefusedError that a
    description cannot be read.
    """

    def __init__(self, description: str = "") -> None:
        if description:
            self._load(description)
        else:
            self._build()

    def _build(self) -> None:
        from rtf.simulator.axes import INDEX
        from rtf.simulator.model import Options, build

        robot = build(Options(collision="none"))
        self._index: dict[str, int] = dict(INDEX)
        self._pose, self._worth = robot.pose, robot.axis_torques
        self._home = robot.home_axes.copy()
        self._model, self._data = robot.model, robot.data()

    def _load(self, description: str) -> None:
        engine = mujoco()
        try:
            text = _SHAPE.sub("", Path(description).read_text(encoding="utf-8"))
            model = engine.MjSpec.from_string(text).compile()
        except (OSError, UnicodeDecodeError, ValueError) as error:
            raise RefusedError(f"{description}: no description of a robot can be read: {error}") from error
        hinges = [model.joint(number) for number in range(model.njnt)]
        addresses = np.array([int(hinge.qposadr[0]) for hinge in hinges])
        dofs = np.array([int(hinge.dofadr[0]) for hinge in hinges])
        self._index = {hinge.name: number for number, hinge in enumerate(hinges)}
        self._home = np.zeros(model.njnt)
        self._model, self._data = model, engine.MjData(model)

        def pose(axes: Any) -> Any:
            qpos = np.zeros(model.nq)
            qpos[addresses] = axes
            return qpos

        self._pose, self._worth = pose, lambda forces: np.asarray(forces)[dofs]

    def __contains__(self, name: object) -> bool:
        return name in self._index

    def torques(self, positions: Mapping[str, float]) -> dict[str, float]:
        """The torque at each axis (Nm) in a posture (deg); axes that are not given are at their home."""
        axes = self._home.copy()
        for name, degrees in positions.items():
            if name in self._index:
                axes[self._index[name]] = np.radians(degrees)
        data = self._data
        data.qpos[:] = self._pose(axes)
        data.qvel[:] = 0.0
        mujoco().mj_forward(self._model, data)
        found = self._worth(data.qfrc_bias)
        return {name: float(found[place]) for name, place in self._index.items()}
