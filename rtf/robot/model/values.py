"""The values of a robot model: parts, axes, motor couplings, sensors and body, as plain data.

All arrays with one column for each axis (actuators of the simulator's model, boards, ports) are in the order of
:attr:`RobotModel.axes`: the parts as the file lists them, and in each part the joints as its control board numbers
them. Positions are in degrees for revolute axes and in metres for prismatic ones; speeds are per second of these.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from rtf.resources.toml_file import line_of
from rtf.robot.errors import RefusedError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from rtf.robot.model.drives import Drive
    from rtf.robot.model.file import Bench, Body, ForceTorque, GuardTable, Sensors
    from rtf.robot.model.workspace import Workspace


@dataclass(frozen=True, slots=True)
class Axis:
    """An axis as a control board sees it, after the gearbox; "unit" is deg, or m of a prismatic axis."""

    part: str
    name: str
    minimum: float  # unit, configured, within the mechanical range
    maximum: float
    max_velocity: float  # unit/s
    max_torque: float  # Nm (N of a prismatic axis), the greatest of the drive
    gearbox: float  # turns of the motor a turn (a metre) of the axis; negative for a motor mounted the other way round
    encoder_resolution: float  # ticks a unit of the joint encoder
    rotor_resolution: float  # ticks a turn of the motor encoder
    armature: float | None  # kg m2 (kg), the rotor's inertia seen from the axis; None: as in the description
    friction: float | None  # Nm (N), dry; likewise
    stribeck: float  # what friction at rest has more, a share of the dry friction
    stribeck_speed: float  # unit/s, at which half of that is left
    damping: float | None  # Nm s/rad (N s/m); likewise
    play: float  # unit, the whole play of its gear
    stiffness: float | None  # Nm/rad (N/m) of its gear; None: rigid
    home: float  # unit, a pose in which nothing touches
    nominal_current: float  # A
    peak_current: float  # A
    overload_current: float  # A, beyond which the drive switches off
    drive: Drive  # of the motor of its number
    torque_control: bool  # whether the joint has torque sensing, and can be compliant
    ratio: float  # units of the axis a unit of its joint in the description
    prismatic: bool
    degree: float  # rad, or m of a prismatic axis, that stand for a degree in the parameters of tests

    @property
    def unit(self) -> str:
        """The unit of its positions: ``deg`` or ``m``."""
        return "m" if self.prismatic else "deg"

    @property
    def internal(self) -> float:
        """Radians, or metres, a unit of the axis."""
        return 1.0 if self.prismatic else float(np.pi / 180.0)


@dataclass(frozen=True, slots=True)
class Coupling:
    """The coupling of the motors of some neighbouring joints of a part.

    ``motor = joint_to_motor @ joint`` and ``torque of the joints = joint_to_motor.T @ torque of the motors``, both
    before the gearbox: an encoder of motor *i* turns ``gearbox[i]`` times as far. Rows and columns are in the order of
    the part's control board. A robot returns this matrix as its remote variable ``kinematic_mj``.
    """

    first: int  # joint of the part at which the block starts
    joint_to_motor: tuple[tuple[float, ...], ...]

    @property
    def size(self) -> int:
        """The number of joints, and of motors."""
        return len(self.joint_to_motor)

    @property
    def motor_to_joint(self) -> NDArray[np.float64]:
        """The inverse."""
        return np.linalg.inv(np.array(self.joint_to_motor))


@dataclass(frozen=True, slots=True)
class Part:
    """A control board: its axes, and one block of couplings for each of its electronics, which cover all joints."""

    name: str
    axes: tuple[Axis, ...]
    couplings: tuple[Coupling, ...]
    #: Joints that may make large moves at the same time, by their names: queues of groups of joints that move together.
    #: The groups of the first queue come after the joints that are in no group, one by one; the others run beside it.
    together: tuple[tuple[tuple[str, ...], ...], ...] = ()
    light: frozenset[str] = frozenset()  # joints that move hardly any mass

    @property
    def joint_to_motor(self) -> NDArray[np.float64]:
        """The couplings as one square matrix: motors = matrix @ joints, before the gearbox."""
        matrix = np.zeros((len(self.axes), len(self.axes)))
        for block in self.couplings:
            span = slice(block.first, block.first + block.size)
            matrix[span, span] = block.joint_to_motor
        return matrix


@dataclass(frozen=True, slots=True)
class Thresholds:
    """Values of parameters of a test, for this robot; a suite may say others."""

    test: str
    origin: str  # "measured on …", "chosen" or "unvalidated"
    values: Mapping[str, bool | float | str | list[int | float | str]]
    place: str  # file and line
    places: Mapping[str, str]  # likewise of each value

    @property
    def validated(self) -> bool:
        """Whether somebody measured or chose them for this robot."""
        return self.origin != UNVALIDATED


UNVALIDATED = "unvalidated"


@dataclass(frozen=True)
class RobotModel:
    """A robot: its parts with their axes, its description, and what the description lacks."""

    name: str
    title: str
    file: Path  # robot.toml
    description: Path  # URDF or MJCF
    parts: Mapping[str, Part]  # with physics, in the robot's order
    kinematic_parts: Mapping[str, Part]  # that move hardly any mass, without physics
    body: Body
    sensors: Sensors
    guard: GuardTable
    scene: Bench
    profile: str  # the origin of the thresholds that it does not say: measured on a robot, chosen, or unvalidated
    assumed: tuple[str, ...] = field(default=())  # what ``rtf robot new`` had to assume
    workspace: Workspace | None = None  # None: nothing is known of it
    #: Poses in which the robot may be left: a position of every axis (unit), with physics or without.
    safe_poses: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    thresholds: Mapping[str, Thresholds] = field(default_factory=dict)  # by the names of tests

    @property
    def folder(self) -> Path:
        """The folder with robot.toml, and with the files that it names."""
        return self.file.parent

    def place(self, *keys: str) -> str:
        """Return the file and the line of a key of robot.toml, such as ``("body", "outlines", "1")``, for messages."""
        try:
            return f"{self.file}:{line_of(self.file.read_text(encoding='utf-8'), keys)}"
        except (OSError, UnicodeDecodeError):  # removed or changed since it was read
            return str(self.file)

    @cached_property
    def axes(self) -> tuple[Axis, ...]:
        """All axes with physics, part by part."""
        return tuple(chain.from_iterable(part.axes for part in self.parts.values()))

    @cached_property
    def index(self) -> dict[str, int]:
        """The place of each axis in :attr:`axes`."""
        return {axis.name: place for place, axis in enumerate(self.axes)}

    @property
    def origins(self) -> str:
        """The origin of its thresholds, and of single tests where that is another."""
        others = (f"{one.test}: {one.origin}" for one in self.thresholds.values() if one.origin != self.profile)
        return "; ".join([self.profile, *others])

    @property
    def unvalidated(self) -> str:
        """A sentence about thresholds that nobody measured or chose for this robot; empty if there are none."""
        if self.profile == UNVALIDATED:
            return f"the thresholds of {self.name} are not validated; {self.folder} says so"
        tests = ", ".join(one.test for one in self.thresholds.values() if not one.validated)
        return f"the thresholds of {self.name} are not validated for {tests}; {self.folder} says so" if tests else ""

    def contact_sensor(self, part: str) -> ForceTorque | None:
        """Return the force-torque sensor that shows contacts of a part: one that carries a weight, on its chain.

        The outermost of the parts that decide the direction of the weight is the one that the sensor is on.
        """
        for sensor in self.sensors.force_torque.values():
            if sensor.weight and (sensor.parts or [sensor.port])[-1] == part:
                return sensor
        return None

    @cached_property
    def sensor_keys(self) -> tuple[str, ...]:
        """The keys of its sensors in robot.toml, such as ``sensors.cameras.left`` and ``sensors.battery``."""
        tables = {name: getattr(self.sensors, name) for name in self.sensors.__struct_fields__}
        return tuple(
            key
            for kind, table in tables.items()
            if table is not None
            for key in (
                [f"sensors.{kind}.{name}" for name in table] if isinstance(table, dict) else [f"sensors.{kind}"]
            )
        )

    @property
    def simulated_name(self) -> str:
        """The prefix of the ports of a simulated robot, unless another is asked for: ``icubSim`` of ``icub``."""
        return f"{self.name}Sim"

    @property
    def served(self) -> tuple[str, ...]:
        """The names of all parts that a simulated robot can serve."""
        return (*self.parts, *self.kinematic_parts)

    def axis(self, name: str) -> Axis:
        """Return an axis by its name. Raises RefusedError, with the known names, for an unknown one."""
        if name not in self.index:
            raise RefusedError(f"{self.name} has no joint {name!r}; its joints are {', '.join(self.index)}")
        return self.axes[self.index[name]]

    def part(self, name: str) -> Part:
        """Return a part by its name. Raises RefusedError, with the known names, for an unknown one."""
        known = {**self.parts, **self.kinematic_parts}
        if name not in known:
            raise RefusedError(f"{self.name} has no part {name!r}; its parts are {', '.join(known)}")
        return known[name]

    def together(self, part: str) -> tuple[tuple[tuple[str, ...], ...], ...]:
        """Return the groups of joints of a part that may move together; none for a part of another robot."""
        known = self.parts.get(part)
        return known.together if known else ()

    def part_slice(self, name: str) -> slice:
        """Return the slice of a part with physics in :attr:`axes`. Raises RefusedError for an unknown one."""
        self.part(name)
        names = list(self.parts)
        first = sum(len(self.parts[other].axes) for other in names[: names.index(name)])
        return slice(first, first + len(self.parts[name].axes))

    @cached_property
    def joint_to_motor(self) -> NDArray[np.float64]:
        """The couplings of all axes as one square matrix."""
        matrix = np.zeros((len(self.axes), len(self.axes)))
        for name, part in self.parts.items():
            span = self.part_slice(name)
            matrix[span, span] = part.joint_to_motor
        return matrix
