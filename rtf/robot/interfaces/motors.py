"""Encoders, motors and amplifiers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rtf.robot.interfaces.axes import AxisSelection, FloatArray, Values


class IEncoders(ABC):
    """Joint encoders (deg, deg/s, deg/s²)."""

    @abstractmethod
    def encoders(self, joints: AxisSelection = None) -> FloatArray:
        """Return the positions."""

    @abstractmethod
    def encoder_speeds(self, joints: AxisSelection = None) -> FloatArray:
        """Return the speeds."""

    @abstractmethod
    def encoder_accelerations(self, joints: AxisSelection = None) -> FloatArray:
        """Return the accelerations."""

    @abstractmethod
    def encoder_times(self, joints: AxisSelection = None) -> FloatArray:
        """Return the times of the positions, in seconds of the robot's clock."""

    @abstractmethod
    def set_encoders(self, values: Values, joints: AxisSelection = None) -> None:
        """Declare that the joints are at these positions: shifts their zeros."""

    @abstractmethod
    def reset_encoders(self, joints: AxisSelection = None) -> None:
        """Declare that the joints are at zero."""

    def encoder(self, joint: int) -> float:
        """Return the position of one joint."""
        return float(self.encoders(joint)[0])


class IMotorEncoders(ABC):
    """Motor encoders (deg of the rotor, deg/s, deg/s²)."""

    @abstractmethod
    def motor_encoder_count(self) -> int:
        """Return the number of motor encoders."""

    @abstractmethod
    def motor_encoders(self, motors: AxisSelection = None) -> FloatArray:
        """Return the positions."""

    @abstractmethod
    def motor_encoder_speeds(self, motors: AxisSelection = None) -> FloatArray:
        """Return the speeds."""

    @abstractmethod
    def motor_encoder_accelerations(self, motors: AxisSelection = None) -> FloatArray:
        """Return the accelerations."""

    @abstractmethod
    def set_motor_encoders(self, values: Values, motors: AxisSelection = None) -> None:
        """Declare that the rotors are at these positions."""

    @abstractmethod
    def reset_motor_encoders(self, motors: AxisSelection = None) -> None:
        """Declare that the rotors are at zero."""

    @abstractmethod
    def counts_per_revolution(self, motor: int) -> float:
        """Return the encoder counts per revolution of the rotor."""

    @abstractmethod
    def set_counts_per_revolution(self, motor: int, counts: float) -> None:
        """Set the encoder counts per revolution of the rotor."""


class IMotor(ABC):
    """Motors: temperatures (°C) and gearboxes."""

    @abstractmethod
    def motor_count(self) -> int:
        """Return the number of motors."""

    @abstractmethod
    def temperatures(self, motors: AxisSelection = None) -> FloatArray:
        """Return the temperatures."""

    @abstractmethod
    def temperature_limit(self, motor: int) -> float:
        """Return the temperature at which a motor is switched off."""

    @abstractmethod
    def set_temperature_limit(self, motor: int, limit: float) -> None:
        """Set the temperature at which a motor is switched off."""

    @abstractmethod
    def gearbox_ratio(self, motor: int) -> float:
        """Return the turns of the rotor per turn of the joint; negative if the directions are opposite."""

    @abstractmethod
    def set_gearbox_ratio(self, motor: int, ratio: float) -> None:
        """Set the gearbox ratio that the board calculates with."""


class IAmplifierControl(ABC):
    """The electronics that drive the motors (A, V, per cent)."""

    @abstractmethod
    def enable_amplifier(self, joint: int) -> None:
        """Switch the amplifier on."""

    @abstractmethod
    def disable_amplifier(self, joint: int) -> None:
        """Switch the amplifier off: the joint becomes idle."""

    @abstractmethod
    def amplifier_status(self, joints: AxisSelection = None) -> tuple[int, ...]:
        """Return the status of the amplifiers; 0 is no fault."""

    @abstractmethod
    def currents(self, motors: AxisSelection = None) -> FloatArray:
        """Return the measured currents."""

    @abstractmethod
    def max_current(self, joint: int) -> float:
        """Return the current at which the joint enters hardware fault."""

    @abstractmethod
    def set_max_current(self, joint: int, current: float) -> None:
        """Set the current at which the joint enters hardware fault; 0 causes the fault at once."""

    @abstractmethod
    def nominal_current(self, motor: int) -> float:
        """Return the nominal current, which a motor can carry continuously."""

    @abstractmethod
    def set_nominal_current(self, motor: int, current: float) -> None:
        """Set the nominal current."""

    @abstractmethod
    def peak_current(self, motor: int) -> float:
        """Return the peak current, which a motor can carry for a moment."""

    @abstractmethod
    def set_peak_current(self, motor: int, current: float) -> None:
        """Set the peak current."""

    @abstractmethod
    def pwm(self, motor: int) -> float:
        """Return the present duty cycle."""

    @abstractmethod
    def pwm_limit(self, motor: int) -> float:
        """Return the maximum duty cycle."""

    @abstractmethod
    def set_pwm_limit(self, motor: int, limit: float) -> None:
        """Set the maximum duty cycle."""

    @abstractmethod
    def supply_voltage(self, motor: int) -> float:
        """Return the supply voltage."""
