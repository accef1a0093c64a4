"""The controllers of a board: their gains, setpoints, errors and outputs. YARP calls setpoints references."""

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
    """The controlled quantity of a PID; the value is the packed word that is sent."""

    POSITION = Vocab("pos").value
    VELOCITY = Vocab("vel").value
    TORQUE = Vocab("trq").value
    CURRENT = Vocab("cur").value


class Pid(NamedTuple):
    """Gains and limits, in YARP 3's order. Outputs are in per cent of duty cycle."""

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
    """PID controllers. Setpoints and errors are in deg, deg/s, Nm or A, depending on the type."""

    @abstractmethod
    def pid(self, kind: PidType, joint: int) -> Pid:
        """Return the gains of a joint."""

    @abstractmethod
    def set_pid(self, kind: PidType, joint: int, pid: Pid) -> None:
        """Set the gains of a joint, effective at once."""

    def pids(self, kind: PidType) -> tuple[Pid, ...]:
        """Return the gains of all joints."""
        return tuple(self.pid(kind, joint) for joint in range(self.pid_count()))

    def set_pids(self, kind: PidType, pids: Sequence[Pid]) -> None:
        """Set the gains of all joints. Raises RefusedError, before any change, for a wrong number of them."""
        if len(pids) != self.pid_count():
            raise RefusedError(f"gains of {self.pid_count()} joints are needed, not of {len(pids)}")
        for joint, pid in enumerate(pids):
            self.set_pid(kind, joint, pid)

    @abstractmethod
    def pid_count(self) -> int:
        """Return the number of joints with a controller."""

    @abstractmethod
    def pid_references(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        """Return the present setpoints of the controllers."""

    @abstractmethod
    def set_pid_references(self, kind: PidType, values: Values, joints: AxisSelection = None) -> None:
        """Set the setpoints of the controllers directly."""

    @abstractmethod
    def pid_errors(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        """Return the control errors: setpoint minus measurement."""

    @abstractmethod
    def pid_outputs(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        """Return the present outputs, in per cent of duty cycle."""

    @abstractmethod
    def pid_error_limits(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        """Return the errors at which a joint enters fault; 0 means never."""

    @abstractmethod
    def set_pid_error_limits(self, kind: PidType, values: Values, joints: AxisSelection = None) -> None:
        """Set the errors at which a joint enters fault; 0 means never."""

    @abstractmethod
    def set_pid_offset(self, kind: PidType, joint: int, offset: float) -> None:
        """Set the constant offset of the output."""

    @abstractmethod
    def reset_pid(self, kind: PidType, joint: int) -> None:
        """Reset the integral; the setpoint becomes the measured value."""

    @abstractmethod
    def enable_pid(self, kind: PidType, joint: int) -> None:
        """Switch a controller on."""

    @abstractmethod
    def disable_pid(self, kind: PidType, joint: int) -> None:
        """Switch a controller off."""

    @abstractmethod
    def pid_enabled(self, kind: PidType, joint: int) -> bool:
        """Return whether a controller is on."""
