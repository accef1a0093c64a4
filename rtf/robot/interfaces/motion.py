"""Motion: positions, velocities, torques, currents and duty cycles."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from rtf.robot.interfaces.axes import AxisSelection, FloatArray, Values


class IPositionControl(ABC):
    """Moves along trajectories that the board generates: minimum-jerk, at the reference speed (deg, deg/s, deg/s²)."""

    @abstractmethod
    def position_move(self, targets: Values, joints: AxisSelection = None) -> None:
        """Start moves to positions; targets beyond the limits are clipped. Returns at once.

        A joint in another mode than position or mixed ignores the command.
        """

    @abstractmethod
    def relative_move(self, distances: Values, joints: AxisSelection = None) -> None:
        """Start moves by distances from the present setpoints. Otherwise like ``position_move``."""

    @abstractmethod
    def motion_done(self, joints: AxisSelection = None) -> bool:
        """Return whether the trajectories of all these joints have ended."""

    @abstractmethod
    def target_positions(self, joints: AxisSelection = None) -> FloatArray:
        """Return the targets of the last moves."""

    @abstractmethod
    def set_reference_speeds(self, speeds: Values, joints: AxisSelection = None) -> None:
        """Set the speeds of later moves."""

    @abstractmethod
    def reference_speeds(self, joints: AxisSelection = None) -> FloatArray:
        """Return the speeds of moves."""

    @abstractmethod
    def set_reference_accelerations(self, accelerations: Values, joints: AxisSelection = None) -> None:
        """Set the accelerations of later velocity moves."""

    @abstractmethod
    def reference_accelerations(self, joints: AxisSelection = None) -> FloatArray:
        """Return the accelerations of velocity moves."""

    @abstractmethod
    def stop(self, joints: AxisSelection = None) -> None:
        """Stop trajectories and velocities; the joints hold their positions."""


class IVelocityControl(ABC):
    """Moves at a speed until the next command (deg/s). Boards stop a joint without commands after a while."""

    @abstractmethod
    def velocity_move(self, velocities: Values, joints: AxisSelection = None) -> None:
        """Move at speeds, reached with the reference accelerations. Ignored in modes without velocity control."""

    @abstractmethod
    def target_velocities(self, joints: AxisSelection = None) -> FloatArray:
        """Return the last commanded speeds."""


class IPositionDirect(ABC):
    """Immediate position setpoints, without a trajectory: for clients that stream their own, at a high rate (deg)."""

    @abstractmethod
    def set_positions(self, positions: Values, joints: AxisSelection = None) -> None:
        """Set the position setpoints. Ignored by joints that are not in this mode."""

    @abstractmethod
    def reference_positions(self, joints: AxisSelection = None) -> FloatArray:
        """Return the last setpoints."""


class MotorTorqueParameters(NamedTuple):
    """The motor model from duty cycle to torque: back-EMF, torque constant, and friction in both directions."""

    bemf: float = 0.0
    bemf_scale: float = 0.0
    ktau: float = 0.0
    ktau_scale: float = 0.0
    viscous_positive: float = 0.0
    viscous_negative: float = 0.0
    coulomb_positive: float = 0.0
    coulomb_negative: float = 0.0
    velocity_threshold: float = 0.0


class ITorqueControl(ABC):
    """Torques at the joints (Nm)."""

    @abstractmethod
    def torques(self, joints: AxisSelection = None) -> FloatArray:
        """Return the measured or estimated torques."""

    @abstractmethod
    def torque_range(self, joint: int) -> tuple[float, float]:
        """Return the range of torques that can be measured."""

    @abstractmethod
    def set_reference_torques(self, torques: Values, joints: AxisSelection = None) -> None:
        """Set the torque setpoints. Ignored by joints that are not in torque mode."""

    @abstractmethod
    def reference_torques(self, joints: AxisSelection = None) -> FloatArray:
        """Return the last setpoints."""

    @abstractmethod
    def motor_torque_parameters(self, joint: int) -> MotorTorqueParameters:
        """Return the parameters of the motor model."""

    @abstractmethod
    def set_motor_torque_parameters(self, joint: int, parameters: MotorTorqueParameters) -> None:
        """Set the parameters of the motor model."""


class IImpedanceControl(ABC):
    """The impedance of a compliant joint: stiffness in Nm/deg, damping in Nm s/deg, offset in Nm."""

    @abstractmethod
    def impedance(self, joint: int) -> tuple[float, float]:
        """Return the stiffness and the damping."""

    @abstractmethod
    def set_impedance(self, joint: int, stiffness: float, damping: float) -> None:
        """Set the stiffness and the damping; values beyond the limits are refused."""

    @abstractmethod
    def impedance_offset(self, joint: int) -> float:
        """Return the torque offset."""

    @abstractmethod
    def set_impedance_offset(self, joint: int, offset: float) -> None:
        """Set the torque offset."""

    @abstractmethod
    def impedance_limits(self, joint: int) -> tuple[float, float, float, float]:
        """Return the minimum and maximum stiffness, and the minimum and maximum damping."""


class ICurrentControl(ABC):
    """Currents of motors (A)."""

    @abstractmethod
    def currents(self, motors: AxisSelection = None) -> FloatArray:
        """Return the measured currents."""

    @abstractmethod
    def current_range(self, motor: int) -> tuple[float, float]:
        """Return the range of currents."""

    @abstractmethod
    def set_reference_currents(self, currents: Values, motors: AxisSelection = None) -> None:
        """Set the current setpoints. Ignored by joints that are not in current mode."""

    @abstractmethod
    def reference_currents(self, motors: AxisSelection = None) -> FloatArray:
        """Return the last setpoints."""


class IPWMControl(ABC):
    """Duty cycles of motors (per cent, -100 to 100): the motor without feedback control."""

    @abstractmethod
    def set_reference_duty_cycles(self, duties: Values, motors: AxisSelection = None) -> None:
        """Set the duty cycle setpoints. Ignored by joints that are not in PWM mode."""

    @abstractmethod
    def reference_duty_cycles(self, motors: AxisSelection = None) -> FloatArray:
        """Return the last setpoints."""

    @abstractmethod
    def duty_cycles(self, motors: AxisSelection = None) -> FloatArray:
        """Return the present duty cycles of the motors, in any mode."""


class IControlLimits(ABC):
    """The software limits: positions in deg, speeds in deg/s."""

    @abstractmethod
    def limits(self, joint: int) -> tuple[float, float]:
        """Return the minimum and maximum position."""

    @abstractmethod
    def set_limits(self, joint: int, minimum: float, maximum: float) -> None:
        """Set the minimum and maximum position."""

    @abstractmethod
    def velocity_limits(self, joint: int) -> tuple[float, float]:
        """Return the minimum and maximum speed."""

    @abstractmethod
    def set_velocity_limits(self, joint: int, minimum: float, maximum: float) -> None:
        """Set the minimum and maximum speed."""
