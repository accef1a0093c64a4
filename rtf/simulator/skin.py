"""The skin of a simulated robot: patches of triangles with twelve taxels each, which feel contacts of their link.

A taxel is a capacitor below a soft layer. As on the iCub its reading is a whole number from 0 to 255, which is high at
rest and falls with the force upon it. A patch covers a shape that the model has for collisions; it only reads the
contacts of that shape, so the mechanics are the same with and without skin. Temperature, drift and hysteresis of real
skin are not modelled.
"""

from __future__ import annotations

import math
import zlib
from typing import TYPE_CHECKING, Any

import numpy as np

from rtf.robot.errors import NotSupportedError
from rtf.robot.interfaces import IAnalogSensor, SensorCategory, SensorReading
from rtf.robot.model.engine import mujoco
from rtf.robot.model.errors import RobotModelError
from rtf.robot.model.file import Accuracy
from rtf.simulator.simulated_sensors import SimulatedSensor

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray
    from rtf.robot.model.file import SkinPatch
    from rtf.simulator.plant import Plant
    from rtf.simulator.simulation import Simulation

#: Seconds between two messages of a patch, as on the iCub.
SKIN_PERIOD = 0.02
TAXELS = 12  # of a triangle
LARGEST = 255.0
#: Distance between neighbouring taxels, and that at which a contact is felt with 1/e of its force, through the soft
#: layer (m). Both are chosen.
_PITCH, _SPREAD = 0.007, 0.01
#: The rows of taxels in a triangle, from its tip, by their numbers.
_ROWS = (3, 4, 5)
_GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))
_FORCE = 6  # numbers of the force and the torque of a contact
#: The random numbers of each patch are its own, so the noise of other sensors does not depend on who reads the skin.
_SEED = 0x5C1A


class SimulatedSkin(SimulatedSensor, IAnalogSensor):
    """A patch of skin: one channel a taxel, the taxels of a triangle in a row.

    A contact lowers the readings of the taxels about it by ``sensitivity`` counts a newton, less with the distance.
    Raises RobotModelError for a link or a shape that the model does not have.
    """

    def __init__(self, name: str, settings: SkinPatch, simulation: Simulation) -> None:
        self.settings = settings
        self._random = self._new_random(name, simulation)
        super().__init__(name, simulation, [Accuracy(noise=settings.noise)], each=TAXELS * settings.triangles)
        model = simulation.plant.model
        self._shape = covered_shape(name, settings, simulation.plant)
        self.places: FloatArray = np.empty((0, 3))  # (taxels, 3), m, in the frame of the shape
        if self._shape >= 0:
            self.places = _taxels(model, self._shape, settings.triangles)
        self._scratch: Any = None
        self._reading = SensorReading(self._zero, 0.0)

    @staticmethod
    def _new_random(name: str, simulation: Simulation) -> np.random.Generator:
        return np.random.default_rng([simulation.seed, _SEED, zlib.crc32(name.encode())])

    def _begin_anew(self) -> None:
        super()._begin_anew()
        self._random = self._new_random(self.name, self.simulation)

    def _draw(self, count: int) -> FloatArray:
        return self._random.standard_normal(count)

    def channels(self) -> int:
        return self._zero.size

    def read(self) -> SensorReading:
        boards = self._boards
        if self._measured_at != boards.tick:
            self._measured_at = boards.tick
            values = self.settings.rest + self._next_noise()
            forces = self._forces()
            if forces is not None:
                values -= self.settings.sensitivity * forces
            np.rint(values, out=values)
            np.clip(values, 0.0, LARGEST, out=values)
            now = boards.now
            for fault in self.faults:
                fault(self.name, SensorCategory.SKIN_PATCH, values, now)
            self._reading = SensorReading(values, now)
        return self._reading

    def calibrate(self, channel: int | None = None, value: float | None = None) -> None:
        del channel, value
        raise NotSupportedError(f"{self.name}: skin has no calibration; its readings are counts of its capacitors")

    def _forces(self) -> FloatArray | None:
        """Return the force that each taxel feels (N), shape (taxels,); None if nothing touches the patch."""
        data, model = self.simulation.data, self.simulation.plant.model
        if not data.ncon or not (np.asarray(data.contact.geom) == self._shape).any():
            return None
        if self._scratch is None:
            self._scratch = mujoco().MjData(model)
        scratch = self._scratch
        mujoco().mj_copyData(scratch, model, data)
        _compute_forces(model, scratch)
        touching = np.flatnonzero((np.asarray(scratch.contact.geom).reshape(-1, 2) == self._shape).any(axis=1))
        rotation, centre = scratch.geom_xmat[self._shape].reshape(3, 3), scratch.geom_xpos[self._shape]
        felt = np.zeros(len(self.places))
        force = np.empty(_FORCE)
        for contact in touching.tolist():
            mujoco().mj_contactForce(model, scratch, contact, force)
            place = (scratch.contact.pos[contact] - centre) @ rotation
            distances = np.linalg.norm(self.places - place, axis=1) / _SPREAD
            felt += force[0] * np.exp(-distances * distances)
        return felt


def _compute_forces(model: Any, data: Any) -> None:
    """Compute the forces of the contacts of a copy of the state, from the accelerations of the last step.

    Between two steps the engine has new contacts, but not their forces. Computing the whole step would not have the
    friction that is outside of the engine.
    """
    residual = np.empty(data.nefc)
    mujoco().mj_mulJacVec(model, data, residual, data.qacc)
    mujoco().mj_constraintUpdate(model, data, residual - data.efc_aref, None, 0)


def covered_shape(name: str, settings: SkinPatch, plant: Plant) -> int:
    """Return the index of the shape that a patch covers; -1 for a model without collisions, whose skin feels nothing.

    Raises RobotModelError, with the line, for a link without such a shape.
    """
    model, place = plant.model, plant.robot.place("sensors", "skin", name)
    body = mujoco().mj_name2id(model, mujoco().mjtObj.mjOBJ_BODY, settings.link)
    if body < 0:
        raise RobotModelError(f"{place}: the skin {name} is on {settings.link!r}, which is no link of its own")
    solid = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    if not solid.any():
        return -1
    shapes = np.flatnonzero((model.geom_bodyid == body) & solid).tolist()
    if settings.shape:
        shapes = [one for one in shapes if model.geom(one).name == settings.shape]
    if not shapes:
        what = f"shape {settings.shape!r}" if settings.shape else "shape"
        raise RobotModelError(f"{place}: the skin {name}: the link {settings.link} has no {what} that collides")
    return int(shapes[0])


def _taxels(model: Any, shape: int, triangles: int) -> FloatArray:
    """Return the places of all taxels on a shape (m, in its frame), shape (taxels, 3).

    The triangles touch its surface, and are spread over it as points of a Fibonacci lattice over an ellipsoid of its
    extent. Few triangles leave gaps.
    """
    centre, extent = model.geom_aabb[shape].reshape(2, 3)  # the centre is not the origin of a mesh
    ways = _directions(triangles) * extent
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    places: FloatArray = np.concatenate([_triangle(model, shape, way) for way in ways]) + centre
    return places


def _directions(count: int) -> FloatArray:
    """Return ``count`` evenly spread unit vectors, shape (count, 3)."""
    number = np.arange(count)
    z = 1.0 - (2.0 * number + 1.0) / count
    radius, angle = np.sqrt(1.0 - z * z), _GOLDEN_ANGLE * number
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])


def _triangle(model: Any, shape: int, way: FloatArray) -> FloatArray:
    """Return the places of the taxels of the triangle that is in one direction from the centre, shape (12, 3)."""
    normal = np.empty(3)
    centre = way * _distance(model, shape, way, normal)
    first = np.cross(normal, (0.0, 0.0, 1.0) if abs(normal[2]) < math.sqrt(0.5) else (1.0, 0.0, 0.0))
    first /= np.linalg.norm(first)
    second = np.cross(normal, first)
    offsets = [
        (_PITCH * (column - (row - 1) / 2.0), _PITCH * math.sqrt(0.75) * (line - 1))
        for line, row in enumerate(_ROWS)
        for column in range(row)
    ]
    return np.array([centre + along * first + across * second for along, across in offsets])


def _distance(model: Any, shape: int, way: FloatArray, normal: FloatArray) -> float:
    """Return the distance of the surface from the centre of a shape (m) in a direction; fills in its normal."""
    engine = mujoco()
    kind = model.geom_type[shape]
    if kind == engine.mjtGeom.mjGEOM_MESH:  # which is taken as the box around it
        kind, size = engine.mjtGeom.mjGEOM_BOX, model.geom_aabb[shape][3:]
    else:
        size = model.geom_size[shape]
    # From outside: rays that begin within some shapes find the far side only.
    far = 2.0 * float(model.geom_rbound[shape]) or 1.0
    found = engine.mju_rayGeom(np.zeros(3), np.eye(3).ravel(), size, far * way, -way, kind, normal)
    if found < 0.0:
        raise RobotModelError(f"no skin covers the shape {model.geom(shape).name!r}, as it is not a closed one")
    return float(far - found)
