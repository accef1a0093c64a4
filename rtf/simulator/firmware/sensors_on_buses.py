"""Which boards the sensors of a simulated robot have, and on which of its buses.

A force-torque sensor and an inertial unit are on the first bus of the part that moves their link, the hall sensors of a
hand on the last one of its arm. Their addresses are counted from 14 downwards, as motors have the low ones. Skin, which
sends most, has buses of its own, with three boards each.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot.devices.can.codes import BoardType, InertialKind
from rtf.robot.devices.can.messages import ADDRESSES
from rtf.robot.interfaces import SensorCategory
from rtf.simulator.errors import SimulatorError
from rtf.simulator.firmware.sensor_boards import (
    TRIANGLES,
    InertialBoard,
    MaisBoard,
    SkinBoard,
    StrainBoard,
    calibration_of,
)
from rtf.simulator.firmware.wire import Wire
from rtf.simulator.skin import TAXELS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from rtf.robot.interfaces import FloatArray
    from rtf.simulator.angle_sensors import SimulatedAngles
    from rtf.simulator.firmware.sensor_boards import SensorBoard
    from rtf.simulator.robot_sensors import RobotSensors
    from rtf.simulator.simulated_sensors import SimulatedForceTorque, SimulatedImu
    from rtf.simulator.simulation import Simulation
    from rtf.simulator.skin import SimulatedSkin

#: Boards on a bus of skin.
_SKIN_BOARDS = 3
#: The full scales (N, Nm) of a sensor whose counts the model does not say; a range has 0x8000 counts to either side.
_FULL_SCALE, _COUNTS = (1500.0, 35.0), 0x8000


class InertialPart(NamedTuple):
    """A vector of an inertial unit, the name of its settings, and its unit a count where the model does not say it."""

    category: SensorCategory
    name: str
    usual: float


#: What an inertial unit has, in the order of its kinds: deg/s, m/s², T, deg.
INERTIAL = {
    InertialKind.ANGULAR_VELOCITY: InertialPart(SensorCategory.GYROSCOPE, "gyroscope", 0.0625),
    InertialKind.ACCELERATION: InertialPart(SensorCategory.ACCELEROMETER, "accelerometer", 0.01),
    InertialKind.MAGNETIC_FIELD: InertialPart(SensorCategory.MAGNETOMETER, "magnetometer", 6.25e-8),
    InertialKind.ORIENTATION: InertialPart(SensorCategory.ORIENTATION, "orientation", 0.0625),
}


@dataclass(frozen=True)
class SensorOnBus:
    """A sensor and its boards, which are on one bus. ``key`` is that of :class:`RobotSensors`."""

    key: str
    sensor: SimulatedForceTorque | SimulatedImu | SimulatedAngles | SimulatedSkin
    boards: tuple[SensorBoard, ...]

    @property
    def wire(self) -> str:
        """The name of the bus."""
        return self.boards[0].wire.name


class SensorPlan:
    """Gives the sensors of a robot boards on ``wires``, to which skin adds others; ``parts`` has those of each part."""

    def __init__(self, simulation: Simulation, wires: dict[str, Wire], parts: Mapping[str, list[Wire]]) -> None:
        self._simulation = simulation
        self._wires, self._parts = wires, parts
        self._taken: dict[str, int] = {}

    def place(self, sensors: RobotSensors) -> Iterator[SensorOnBus]:
        """Yield the sensors of the parts that have a bus, with their boards."""
        for port, force_torque in sensors.force_torques.items():
            if found := self._wires_at(force_torque.sensor.settings.link):
                yield SensorOnBus(port, force_torque, (self._strain(found[0], force_torque),))
        for port, imu in sensors.imus.items():
            if found := self._wires_at(imu.imu.settings.link):
                yield SensorOnBus(port, imu, (self._inertial(found[0], imu),))
        for port, angles in sensors.angles.items():
            if found := self._wires_of(angles.axes[0]):
                yield SensorOnBus(port, angles, (self._mais(found[-1], angles),))
        for name, skin in sensors.skin.items():
            if self._wires_at(skin.settings.link):
                yield SensorOnBus(name, skin, tuple(self._skin(skin)))

    def _strain(self, wire: Wire, sensor: SimulatedForceTorque) -> StrainBoard:
        settings = sensor.sensor.settings
        counts = np.repeat([settings.force.count, settings.torque.count], 3)
        ranges = np.where(counts > 0.0, counts * _COUNTS, np.repeat(_FULL_SCALE, 3))
        scales = tuple(max(round(one), 1) for one in ranges.tolist())
        address = self._address(wire)
        return StrainBoard(
            wire, address, self._simulation, lambda: sensor.read().values, scales, calibration_of(address)
        )

    def _inertial(self, wire: Wire, sensor: SimulatedImu) -> InertialBoard:
        return InertialBoard(
            wire, self._address(wire), self._simulation, lambda: _inertial_values(sensor), inertial_scales(sensor)
        )

    def _mais(self, wire: Wire, sensor: SimulatedAngles) -> MaisBoard:
        return MaisBoard(wire, self._address(wire), self._simulation, lambda: sensor.read().values, BoardType.MAIS)

    def _skin(self, sensor: SimulatedSkin) -> Iterator[SkinBoard]:
        """Yield the boards of a patch, all on one bus."""
        size = TRIANGLES * TAXELS
        firsts = range(0, sensor.channels(), size)
        if len(firsts) > _SKIN_BOARDS:
            raise SimulatorError(f"the skin {sensor.name} needs {len(firsts)} boards, and a bus has {_SKIN_BOARDS}")
        number = 0
        while self._taken.get(f"skin{number}", 0) + len(firsts) > _SKIN_BOARDS:
            number += 1
        wire = self._wires.setdefault(f"skin{number}", Wire(f"skin{number}"))
        for first in firsts:
            yield SkinBoard(
                wire,
                self._address(wire),
                self._simulation,
                lambda first=first: sensor.read().values[first : first + size],  # type: ignore[misc]  # bound at once
                BoardType.SKIN,
            )

    def _address(self, wire: Wire) -> int:
        taken = self._taken[wire.name] = self._taken.get(wire.name, 0) + 1
        return ADDRESSES[-taken]

    def _wires_at(self, link: str) -> list[Wire]:
        """Return the buses of the part that moves a link."""
        model, plant = self._simulation.plant.model, self._simulation.plant
        body = model.body(link).id
        while body and not model.body_dofnum[body]:
            body = model.body_parentid[body]
        degree = int(model.body_dofadr[body])
        axis = next((axis for axis, dofs in enumerate(plant.dofs) if degree in dofs), None) if body else None
        return next(iter(self._parts.values()), []) if axis is None else self._wires_of(axis)

    def _wires_of(self, axis: int) -> list[Wire]:
        """Return the buses of the part of an axis; none of a part without boards."""
        robot = self._simulation.plant.robot
        slices = {part: robot.part_slice(part) for part in robot.parts}
        part = next(part for part, own in slices.items() if own.start <= axis < own.stop)
        return self._parts.get(part, [])


def inertial_scales(sensor: SimulatedImu) -> dict[InertialKind, float]:
    """Return the units a count of what an inertial unit measures."""
    settings = sensor.imu.settings
    return {kind: getattr(settings, part.name).count or part.usual for kind, part in INERTIAL.items()}


def _inertial_values(sensor: SimulatedImu) -> FloatArray:
    return np.concatenate([sensor.read_sensor(part.category, 0).values for part in INERTIAL.values()])
