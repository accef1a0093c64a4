"""Base classes of faults: target, parameters, begin and end."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from rtf.robot.errors import RefusedError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.simulator.robot import SimulatedRobot


class Layer(Enum):
    """The layer of a fault, from the mechanics outwards."""

    PLANT = "plant"
    MOTOR = "motor"
    ENCODER = "encoder"
    BOARD = "board"
    CONFIGURATION = "configuration"
    SENSOR = "sensor"
    CAMERA = "camera"
    BUS = "bus"
    CONTROLLER = "controller"
    NETWORK = "network"
    PROCESS = "process"


class Target(Enum):
    """The type of a fault's target; the value is its description."""

    AXIS = "a joint, such as l_elbow"
    FORCE_TORQUE = "a force-torque sensor, such as left_arm"
    IMU = "the inertial unit: imu"
    CAMERA = "a camera: left or right"
    DEPTH_CAMERA = "a depth camera, such as depth of the bench"
    BATTERY = "the battery: battery"
    SKIN = "a patch of skin, such as left_hand"
    PORT = "a port that publishes, such as /icubSim/head/state:o"
    CONTROLLER = "a Cartesian controller of the robot's program, such as /icubSim/cartesianController/left_arm"
    BUS = "a CAN bus, such as left_arm0"
    CAN_BOARD = "a board on a CAN bus, such as left_arm0:2"
    ROBOT = "the robot: no name"


@dataclass(frozen=True, slots=True)
class Parameter:
    """A numeric parameter of a fault."""

    name: str
    default: float
    unit: str
    description: str
    minimum: float = -1e9
    maximum: float = 1e9
    #: The value with which nothing is wrong; None: there is none, or the parameter says where or when.
    healthy: float | None = 0.0


class Fault(ABC):
    """A fault of a robot. ``begin`` and ``end`` are called by the simulation's loop, or with its lock held.

    Parameters become attributes of the same names. Raises RefusedError for a target that the robot does not have, and
    for a parameter that the kind does not have or that is out of range.
    """

    kind: ClassVar[str]
    layer: ClassVar[Layer]
    target_kind: ClassVar[Target]
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    #: Whether the kind is something that happens to a healthy robot, such as a push. No test has to find it.
    stimulus: ClassVar[bool] = False
    #: Whether ``end`` restores values that ``begin`` has saved, so that the order of several faults matters.
    restores: ClassVar[bool] = False
    #: A sentence on the defect, and one on its symptom.
    description: ClassVar[str]
    symptom: ClassVar[str]

    def __init__(self, robot: SimulatedRobot, target: str = "", values: Mapping[str, float] | None = None) -> None:
        self.robot = robot
        self.simulation = robot.simulation
        self.boards = robot.simulation.boards
        self.target = target
        self.began = 0.0
        self._take(dict(values or {}))
        self.aim()

    def _take(self, values: dict[str, float]) -> None:
        for parameter in self.parameters:
            value = float(values.pop(parameter.name, parameter.default))
            if not parameter.minimum <= value <= parameter.maximum:
                raise RefusedError(
                    f"{self.kind}: {parameter.name} is from {parameter.minimum:g} to {parameter.maximum:g} "
                    f"{parameter.unit}, not {value:g}"
                )
            setattr(self, parameter.name, value)
        if values:
            known = ", ".join(parameter.name for parameter in self.parameters) or "none"
            raise RefusedError(f"{self.kind} has no parameter {', '.join(values)}; its parameters: {known}")

    @classmethod
    def severity(cls, values: Mapping[str, float]) -> float | None:
        """Return how far the first parameter is from its healthy value; None if no parameter says how bad it is."""
        if not cls.parameters or cls.parameters[0].healthy is None:
            return None
        first = cls.parameters[0]
        return float(values.get(first.name, first.default)) - (first.healthy or 0.0)

    def own_random(self, *place: int) -> np.random.Generator:
        """Return random numbers of this fault alone, for a ``place`` of the robot.

        How often a sensor is read, or a picture made, must not change what other faults draw.
        """
        return np.random.default_rng([self.simulation.seed, *place])

    @abstractmethod
    def aim(self) -> None:
        """Find the target. Raises RefusedError if the robot does not have it."""

    def start(self) -> None:
        """Begin the fault now."""
        self.began = self.simulation.now
        self.begin()

    @abstractmethod
    def begin(self) -> None:
        """Apply the fault to the robot."""

    @abstractmethod
    def end(self) -> None:
        """Remove the fault from the robot."""


class AxisFault(Fault):
    """A fault of one joint; ``axis`` is its index in :attr:`~rtf.robot.model.RobotModel.axes`."""

    target_kind = Target.AXIS
    axis: int

    def aim(self) -> None:
        index = self.robot.model.index
        if self.target not in index:
            raise RefusedError(
                f"{self.kind}: the robot has no joint {self.target!r}; its joints are {', '.join(index)}"
            )
        self.axis = index[self.target]

    @property
    def axes(self) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
        """The index as an array of length 1."""
        return np.array([self.axis])


class RobotFault(Fault):
    """A fault of the whole robot."""

    target_kind = Target.ROBOT

    def aim(self) -> None:
        if self.target:
            raise RefusedError(f"{self.kind} affects the whole robot and takes no target, not {self.target!r}")
