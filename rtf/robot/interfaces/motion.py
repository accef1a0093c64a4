"""Moving: positions, velocities, torques, currents and duty cycles."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from rtf.robot.interfaces.axes import AxisSelection, FloatArray, Values


class IPositionControl(ABC):
    """Moves along trajectories that the board generates: minimum-jerk, at the reference speed (deg, deg/s, deg/s²)."""

    @abstractmethod
    def position_move(self, targets: Values, joints: AxisSelection = None) -> None:
        """Start to move to these positions; targets beyond the limits are cut off there. Returns at once.

        A joint that is in no mode that takes it (position, mixed) does nothing.
        """

    @abstractmethod
    def relative_move(self, distances: Values, joints: AxisSelection = None) -> None:
        """The same, so far from the present reference."""

    @abstractmethod
    def motion_done(self, joints: AxisSelection = None) -> bool:
        """Whether all these joints have come to the end of their trajectories."""

    @abstractmethod
    def target_positions(self, joints: AxisSelection = None) -> FloatArray:
        """Where the joints were last told to move."""

    @abstractmethod
    def set_reference_speeds(self, speeds: Values, joints: AxisSelection = None) -> None:
        """The speeds of moves from now on."""

    @abstractmethod
    def reference_speeds(self, joints: AxisSelection = None) -> FloatArray:
        """The speeds of moves."""

    @abstractmethod
    def set_reference_accelerations(self, accelerations: Values, joints: AxisSelection = None) -> None:
        """The accelerations of velocity moves from now on."""

    @abstractmethod
    def reference_accelerations(self, joints: AxisSelection = None) -> FloatArray:
        """The accelerations of velocity moves."""

    @abstractmethod
    def stop(self, joints: AxisSelection = None) -> None:
        """Stop trajectories and velocities; the joints hold where they are."""


class IVelocityControl(ABC):
    """Moves at a speed until told otherwise (deg/s). Boards stop a joint that hears nothing for a while."""

    @abstractmethod
    def velocity_move(self, velocities: Values, joints: AxisSelection = None) -> None:
        """Move at these speeds, reached with the reference accelerations. Ignored in modes that do not take it."""

    @abstractmethod
    def target_velocities(self, joints: AxisSelection = None) -> FloatArray:
        """The speeds that were last asked for."""


class IPositionDirect(ABC):
    """Positions that are followed at once, without a trajectory: for those who make their own, at a high rate (deg)."""

    @abstractmethod
    def set_positions(self, positions: Values, joints: AxisSelection = None) -> None:
        """The references from now on. Ignored by joints that are not in this mode."""

    @abstractmethod
    def reference_positions(self, joints: AxisSelection = None) -> FloatArray:
        """The last references."""


class MotorTorqueParameters(NamedTuple):
    """How torque comes from duty cycle in a motor: back-EMF, torque constant, and friction of both directions."""

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
        """The torques that are measured or estimated."""

    @abstractmethod
    def torque_range(self, joint: int) -> tuple[float, float]:
        """The least and the greatest torque that can be measured."""

    @abstractmethod
    def set_reference_torques(self, torques: Values, joints: AxisSelection = None) -> None:
        """The torques to be exerted. Ignored by joints that are not in torque mode."""

    @abstractmethod
    def reference_torques(self, joints: AxisSelection = None) -> FloatArray:
        """The last references."""

    @abstractmethod
    def motor_torque_parameters(self, joint: int) -> MotorTorqueParameters:
        """The model of the motor."""

    @abstractmethod
    def set_motor_torque_parameters(self, joint: int, parameters: MotorTorqueParameters) -> None:
        """Change it."""


class IImpedanceControl(ABC):
    """How a compliant joint gives way: stiffness in Nm/deg, damping in Nm s/deg, offset in Nm."""

    @abstractmethod
    def impedance(self, joint: int) -> tuple[float, float]:
        """Stiffness and damping."""

    @abstractmethod
    def set_impedance(self, joint: int, stiffness: float, damping: float) -> None:
        """Change them; beyond the limits it is refused."""

    @abstractmethod
    def impedance_offset(self, joint: int) -> float:
        """The torque that is added."""

    @abstractmethod
    def set_impedance_offset(self, joint: int, offset: float) -> None:
        """Change it."""

    @abstractmethod
    def impedance_limits(self, joint: int) -> tuple[float, float, float, float]:
        """Least and greatest stiffness, least and greatest damping."""


class ICurrentControl(ABC):
    """Currents of motors (A)."""

    @abstractmethod
    def currents(self, motors: AxisSelection = None) -> FloatArray:
        """The currents that are measured."""

    @abstractmethod
    def current_range(self, motor: int) -> tuple[float, float]:
        """The least and the greatest current."""

    @abstractmethod
    def set_reference_currents(self, currents: Values, motors: AxisSelection = None) -> None:
        """The currents to be driven. Ignored by joints that are not in current mode."""

    @abstractmethod
    def reference_currents(self, motors: AxisSelection = None) -> FloatArray:
        """The last references."""


class IPWMControl(ABC):
    """Duty cycles of motors (per cent, -100 to 100): the motor without any control around it."""

    @abstractmethod
    def set_reference_duty_cycles(self, duties: Values, motors: AxisSelection = None) -> None:
        """The duty cycles to be driven. Ignored by joints that are not in PWM mode."""

    @abstractmethod
    def reference_duty_cycles(self, motors: AxisSelection = None) -> FloatArray:
        """The last references."""

    @abstractmethod
    def duty_cycles(self, motors: AxisSelection = None) -> FloatArray:
        """What the motors are driven with now, in whatever mode."""


class IControlLimits(ABC):
    """The limits of the software: positions in deg, speeds in deg/s."""

    @abstractmethod
    def limits(self, joint: int) -> tuple[float, float]:
        """The least and the greatest position."""

    @abstractmethod
    def set_limits(self, joint: int, minimum: float, maximum: float) -> None:
        """Change them."""

    @abstractmethod
    def velocity_limits(self, joint: int) -> tuple[float, float]:
        """The least and the greatest speed."""

    @abstractmethod
    def set_velocity_limits(self, joint: int, minimum: float, maximum: float) -> None:
        """Change them."""
