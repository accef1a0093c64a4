"""Units of a robot: robots of one series differ, and what holds for one need not hold for the next.

Unit 0 is the nominal robot, as its description and robot.toml say. Every other number draws a robot of the population,
always the same one. What a unit differs in is known to nobody but the simulation: the boards are configured for the
nominal robot, and the tests ask the model of the nominal robot.
"""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rtf.robot.model.engine import mujoco

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.robot.model import Axis


class Spread(NamedTuple):
    """How far the units are from the nominal robot: evenly distributed up to ``most``, to both sides."""

    most: float
    what: str


#: What the units differ in. The spreads are chosen: as those of castings, of greased gears, of hand-tuned controllers,
#: of calibrations with a jig, and of the data sheets of small motors, which give tolerances of 5 to 10 %.
SPREADS = {
    "mass": Spread(0.05, "share of the mass of each link"),
    "inertia": Spread(0.05, "share of the inertia of each link and of each rotor"),
    "friction": Spread(0.30, "share of the dry and of the viscous friction of each joint"),
    "gain": Spread(0.10, "share of each gain of the position controllers"),
    "torque constant": Spread(0.08, "share of the torque constant of each motor"),
    "zero": Spread(0.3, "offset of each joint's encoder, deg, or of a slide's encoder, mm"),
    "mounting": Spread(0.5, "rotation of each sensor about each of its axes, deg"),
}
#: Metres: an offset of an encoder is in degrees, and of a slide in millimetres.
_MILLIMETRE = 1e-3


@dataclass(frozen=True, slots=True)
class Unit:
    """A robot of the population, by its number from 0."""

    number: int = 0

    def draw(self, name: str, *shape: int) -> FloatArray:
        """Return what a property differs by, of each element; zeros of unit 0. What is drawn before has no effect."""
        if not self.number:
            return np.zeros(shape)
        most = SPREADS[name].most
        return np.random.default_rng([self.number, zlib.crc32(name.encode())]).uniform(-most, most, shape)

    def factors(self, name: str, *shape: int) -> FloatArray:
        """Return the factors of a property of which a share varies; ones of unit 0."""
        return 1.0 + self.draw(name, *shape)

    def zeros(self, axes: Sequence[Axis]) -> FloatArray:
        """Return the offsets of the axes' encoders, in the units of the axes."""
        return self.draw("zero", len(axes)) * _offset_units(axes)


def _offset_units(axes: Sequence[Axis]) -> FloatArray:
    return np.array([_MILLIMETRE if axis.prismatic else 1.0 for axis in axes])


def vary(model: Any, unit: Unit, axes: Sequence[Axis], jacobian: FloatArray, sensors: Sequence[str]) -> None:
    """Make a compiled model that of a unit. ``sensors`` are the sites of sensors; all cameras are turned, too.

    The mechanical stops get the room that the offsets of the encoders need, so that a joint at a limit by its encoder
    does not touch one.
    """
    if not unit.number:
        return
    bodies, joints = model.nbody, model.nv
    inertias, frictions = unit.factors("inertia", bodies + joints), unit.factors("friction", 2, joints)
    model.body_mass *= unit.factors("mass", bodies)
    model.body_inertia *= inertias[:bodies, None]
    model.dof_armature *= inertias[bodies:]
    model.dof_frictionloss *= frictions[0]
    model.dof_damping *= frictions[1]
    quaternions = [model.site(name).quat for name in sensors] + list(model.cam_quat)
    for quaternion, angles in zip(quaternions, unit.draw("mounting", len(quaternions), 3), strict=True):
        _turn(quaternion, np.radians(angles))
    _widen(model, axes, jacobian)
    mujoco().mj_setConst(model, mujoco().MjData(model))


def _turn(quaternion: FloatArray, angles: FloatArray) -> None:
    """Turn a frame by small angles (rad) about its own axes."""
    turn, before = np.empty(4), quaternion.copy()
    angle = float(np.linalg.norm(angles))
    mujoco().mju_axisAngle2Quat(turn, angles / angle if angle else np.array([1.0, 0.0, 0.0]), angle)
    mujoco().mju_mulQuat(quaternion, before, turn)


def _widen(model: Any, axes: Sequence[Axis], jacobian: FloatArray) -> None:
    """Move the stops outwards by the greatest offset of an encoder."""
    most = SPREADS["zero"].most * _offset_units(axes) * np.array([axis.internal for axis in axes])  # rad, m
    units = np.abs(jacobian)
    needed = np.max(np.divide(most[:, None], units, out=np.zeros_like(units), where=units > 0), axis=0)  # of each dof
    for joint in range(model.njnt):
        room = float(needed[model.jnt_dofadr[joint]])
        model.jnt_range[joint] += (-room, room)
    model.tendon_range += np.array([-1.0, 1.0]) * math.radians(SPREADS["zero"].most)
