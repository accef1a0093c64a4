"""What a fault is: what it strikes, what can be set about it, and how it begins and ends."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from rtf.robot.errors import RefusedError
from rtf.simulator.axes import INDEX

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.simulator.icub import SimulatedIcub


class Layer(Enum):
    """Where a fault happens, from the mechanics outwards."""

    PLANT = "plant"
    MOTOR = "motor"
    ENCODER = "encoder"
    BOARD = "board"
    CONFIGURATION = "configuration"
    SENSOR = "sensor"
    CAMERA = "camera"
    NETWORK = "network"
    PROCESS = "process"


class Target(Enum):
    """What a fault strikes; the value says how it is named."""

    AXIS = "a joint, such as l_elbow"
    FORCE_TORQUE = "a force-torque sensor, such as left_arm"
    IMU = "the inertial unit: imu"
    CAMERA = "a camera: left or right"
    PORT = "a port that publishes, such as /icubSim/head/state:o"
    ROBOT = "the robot: no name"


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number that can be set about a fault."""

    name: str
    default: float
    unit: str
    meaning: str
    minimum: float = -1e9
    maximum: float = 1e9


class Fault(ABC):
    """One fault of a robot. ``begin`` and ``end`` are called by the simulation's loop, or through its lock.

    Its parameters are attributes of the same names. Raises RefusedError for a target that the robot has not got, for a
    parameter that the kind does not have, and for one that is out of range.
    """

    kind: ClassVar[str]
    layer: ClassVar[Layer]
    target_kind: ClassVar[Target]
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    #: Something that happens to a healthy robot: nothing is wrong with it, and no test has to find it.
    stimulus: ClassVar[bool] = False
    #: Whether ``begin`` keeps what it finds and ``end`` puts that back, so that the order of several matters.
    keeps: ClassVar[bool] = False
    #: What is wrong, in a sentence, and how it shows.
    meaning: ClassVar[str]
    shows: ClassVar[str]

    def __init__(self, robot: SimulatedIcub, target: str = "", values: Mapping[str, float] | None = None) -> None:
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
            known = ", ".join(parameter.name for parameter in self.parameters) or "nothing"
            raise RefusedError(f"{self.kind} has no parameter {', '.join(values)}; what can be set is {known}")

    @abstractmethod
    def aim(self) -> None:
        """Find the target. Raises RefusedError when the robot has not got it."""

    def start(self) -> None:
        """Begin now."""
        self.began = self.simulation.now
        self.begin()

    @abstractmethod
    def begin(self) -> None:
        """Break what is to be broken."""

    @abstractmethod
    def end(self) -> None:
        """Fix it."""


class AxisFault(Fault):
    """A fault of one joint; ``axis`` is its place among all."""

    target_kind = Target.AXIS
    axis: int

    def aim(self) -> None:
        if self.target not in INDEX:
            raise RefusedError(
                f"{self.kind}: the robot has no joint {self.target!r}; its joints are {', '.join(INDEX)}"
            )
        self.axis = INDEX[self.target]

    @property
    def axes(self) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
        """The same as an array of one."""
        return np.array([self.axis])


class RobotFault(Fault):
    """A fault of the whole robot."""

    target_kind = Target.ROBOT

    def aim(self) -> None:
        if self.target:
            raise RefusedError(f"{self.kind} strikes the whole robot; {self.target!r} is not needed")
