"""The controllers of a board: their gains, references, errors and outputs."""

from __future__ import annotations

from abc import ABC, abstractmethod
from enum import IntEnum
from typing import TYPE_CHECKING, NamedTuple

from rtf.bottle import Vocab
from rtf.robot.errors import RefusedError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces.axes import AxisSelection, FloatArray, Values


class PidType(IntEnum):
    """What is controlled; the value is the packed word that travels."""

    POSITION = Vocab("pos").value
    VELOCITY = Vocab("vel").value
    TORQUE = Vocab("trq").value
    CURRENT = Vocab("cur").value


class Pid(NamedTuple):
    """Gains and limits, in the order in which YARP 3 sends them. Outputs are in per cent of duty cycle."""

    kp: float = 0.0
    kd: float = 0.0
    ki: float = 0.0
    max_integral: float = 0.0
    max_output: float = 0.0
    offset: float = 0.0
    scale: float = 1.0
    stiction_up: float = 0.0
    stiction_down: float = 0.0
    feedforward: float = 0.0


class IPidControl(ABC):
    """Controllers: deg, deg/s, Nm or A for references and errors, as the type says."""

    @abstractmethod
    def pid(self, kind: PidType, joint: int) -> Pid:
        """The gains of a joint."""

    @abstractmethod
    def set_pid(self, kind: PidType, joint: int, pid: Pid) -> None:
        """Change them, at once."""

    def pids(self, kind: PidType) -> tuple[Pid, ...]:
        """The gains of all joints."""
        return tuple(self.pid(kind, joint) for joint in range(self.pid_count()))

    def set_pids(self, kind: PidType, pids: Sequence[Pid]) -> None:
        """Change those of all joints. As many as there are; RefusedError otherwise, and nothing is changed."""
        if len(pids) != self.pid_count():
            raise RefusedError(f"gains of {self.pid_count()} joints are needed, of {len(pids)} were given")
        for joint, pid in enumerate(pids):
            self.set_pid(kind, joint, pid)

    @abstractmethod
    def pid_count(self) -> int:
        """How many joints have a controller."""

    @abstractmethod
    def pid_references(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        """What the controllers follow now."""

    @abstractmethod
    def set_pid_references(self, kind: PidType, values: Values, joints: AxisSelection = None) -> None:
        """Give them references directly."""

    @abstractmethod
    def pid_errors(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        """Reference minus measurement."""

    @abstractmethod
    def pid_outputs(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        """What they give out now, in per cent of duty cycle."""

    @abstractmethod
    def pid_error_limits(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        """The errors at which a joint goes into fault; 0 for never."""

    @abstractmethod
    def set_pid_error_limits(self, kind: PidType, values: Values, joints: AxisSelection = None) -> None:
        """Change them."""

    @abstractmethod
    def set_pid_offset(self, kind: PidType, joint: int, offset: float) -> None:
        """Change the constant part of the output."""

    @abstractmethod
    def reset_pid(self, kind: PidType, joint: int) -> None:
        """Forget the integral; the reference becomes what is measured."""

    @abstractmethod
    def enable_pid(self, kind: PidType, joint: int) -> None:
        """Switch a controller on."""

    @abstractmethod
    def disable_pid(self, kind: PidType, joint: int) -> None:
        """Switch a controller off."""

    @abstractmethod
    def pid_enabled(self, kind: PidType, joint: int) -> bool:
        """Whether a controller is on."""
