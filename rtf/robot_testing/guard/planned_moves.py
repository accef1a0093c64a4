"""Planned moves, checked on the robot's model before they start: self-collisions, and the limits of the workspace.

The shapes are the model's own: outlines of robot.toml, or those of its description. Links that are neighbours do not
collide, as in the simulator. What is wrong before a move, such as hands on hips, is not the fault of the move.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.errors import RefusedError
from rtf.robot.model.engine import mujoco
from rtf.robot_testing.guard.read_only_board import connect_read_only
from rtf.simulator.contacts import touching
from rtf.simulator.plant import build
from rtf.simulator.workspace import outside
from rtf.testing.verdict import TestProblem

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from rtf.middleware.ports.network import Network
    from rtf.robot.boards.client import RemoteBoard
    from rtf.robot.interfaces import FloatArray
    from rtf.robot.model import RobotModel

#: Greatest way of a joint between two checked poses, deg: 1 cm at the hand of a stretched arm of 0.5 m; and of a
#: prismatic joint, m.
STEP, _SLIDE_STEP = 1.2, 0.01
#: How far ahead the motion is checked, s: two ticks of 20 ms until a stop is commanded, a state of 10 ms of age, and
#: 0.05 s in which a board stops a joint of 60 deg/s, as for the iCub's deceleration of 1000 deg/s².
AHEAD = 0.1
#: Joints that are slower, in such steps a second, cannot come far in that time.
_SLOW = 1.7


class RefusedMoveError(RefusedError, TestProblem):
    """A planned move would bring two links of the robot together, or leave the workspace. Nothing was sent."""


class MoveCheck:
    """The robot's model with the positions of its parts: ``positions`` has for each part what returns them (deg).

    Parts that are not there are at home. Raises MissingPackageError, with how to install the package.
    """

    def __init__(self, robot: RobotModel, positions: Mapping[str, Callable[[], FloatArray]]) -> None:
        self._robot = robot
        self._positions = positions
        self._plant = build(robot)
        self._data = self._plant.data()
        self._internal = np.array([axis.internal for axis in robot.axes])
        self._steps = np.array([_SLIDE_STEP if axis.prismatic else STEP for axis in robot.axes])

    def pose(self) -> FloatArray:
        """Return the present positions of all axes (deg, m). Raises StaleStateError."""
        found: FloatArray = self._plant.home_axes / self._internal
        for part, read in self._positions.items():
            found[self._robot.part_slice(part)] = read()
        return found

    def problems(self, pose: FloatArray) -> dict[tuple[str, ...], str]:
        """Return what is wrong with a pose (deg, m), a clause each: links that touch, points out of the workspace."""
        engine, model, data = mujoco(), self._plant.model, self._data
        data.qpos[:] = self._plant.pose(pose * self._internal)
        engine.mj_kinematics(model, data)
        engine.mj_collision(model, data)
        found: dict[tuple[str, ...], str] = {pair: f"{pair[0]} would touch {pair[1]}" for pair in touching(model, data)}
        if self._robot.workspace is not None:
            found |= {(text.partition(" ")[0],): text for text in outside(self._robot, model, data)}
        return found

    def check(self, part: str, joints: Sequence[int], targets: FloatArray, speeds: FloatArray) -> None:
        """Check a move of joints of a part to targets, with speeds (a second), along minimum-jerk trajectories.

        Both are in deg, or m of prismatic joints, as all positions here.

        Raises RefusedMoveError, with the links, and the place where they would touch.
        """
        begin = self.pose()
        axes = self._robot.part_slice(part).start + np.asarray(joints)
        way = targets - begin[axes]
        if not way.size or not np.isfinite(begin).all():
            return  # a joint without a position is stopped anyway
        times = np.abs(way) / speeds
        count = max(1, math.ceil(float((np.abs(way) / self._steps[axes]).max())))
        before, pose = self.problems(begin), begin.copy()
        for moment in np.linspace(0.0, float(times.max()), count + 1)[1:]:
            share = np.minimum(1.0, moment / np.maximum(times, 1e-9))
            pose[axes] = begin[axes] + way * share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
            found = self.problems(pose)
            if new := sorted(found.keys() - before.keys()):
                moved = [self._robot.axes[axis] for axis in axes]
                names = [axis.name for axis in moved]
                places = zip(moved, pose[axes], strict=True)
                where = ", ".join(
                    f"{axis.name} at {place:{'.3f' if axis.prismatic else '.1f'}} {axis.unit}" for axis, place in places
                )
                raise RefusedMoveError(
                    f"{part}: the move of {', '.join(names)} is refused: by the model of {self._robot.name} "
                    f"{found[new[0]]}, with {where}; choose other targets or another order"
                )

    def ahead(self, part: str, speeds: FloatArray) -> str:
        """Return what will be wrong within ``AHEAD`` s if a part moves on with ``speeds``; "" if nothing."""
        span = self._robot.part_slice(part)
        if not (np.abs(speeds) > _SLOW * self._steps[span]).any():
            return ""
        pose = self.pose()
        low, high = np.array([(axis.minimum, axis.maximum) for axis in self._robot.axes[span]]).T
        before, here = self.problems(pose), pose[span].copy()
        pose[span] = np.clip(here + AHEAD * speeds, np.minimum(low, here), np.maximum(high, here))
        found = self.problems(pose)
        return next((found[new] for new in sorted(found.keys() - before.keys())), "")


def read_positions(
    robot: RobotModel, name: str, *, network: Network, carrier: str, opened: Callable[[RemoteBoard], object]
) -> dict[str, Callable[[], FloatArray]]:
    """Connect to all parts of a robot that are there; return for each what reads its positions (deg).

    ``opened`` is called with each board, which the caller closes. Raises RefusedError for a part with another number of
    joints than the model has.
    """
    found: dict[str, Callable[[], FloatArray]] = {}
    for part in robot.parts:
        place = f"/{name}/{part}"
        if network.names.query(f"{place}/stateExt:o") is None:
            continue
        board = connect_read_only(place, carrier=carrier, network=network)
        opened(board)
        expected = len(robot.parts[part].axes)
        if board.axes() != expected:
            raise RefusedError(f"{place} has {board.axes()} joints, the model of {robot.name} {expected}")
        found[part] = board.encoders
    return found
