"""Encoders, motors and amplifiers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rtf.robot.interfaces.axes import AxisSelection, FloatArray, Values


class IEncoders(ABC):
    """Where the joints are (deg, deg/s, deg/s²)."""

    @abstractmethod
    def encoders(self, joints: AxisSelection = None) -> FloatArray:
        """The positions."""

    @abstractmethod
    def encoder_speeds(self, joints: AxisSelection = None) -> FloatArray:
        """The speeds."""

    @abstractmethod
    def encoder_accelerations(self, joints: AxisSelection = None) -> FloatArray:
        """The accelerations."""

    @abstractmethod
    def encoder_times(self, joints: AxisSelection = None) -> FloatArray:
        """When the positions were measured, in seconds of the robot's clock."""

    @abstractmethod
    def set_encoders(self, values: Values, joints: AxisSelection = None) -> None:
        """Declare that the joints are at these positions: shifts their zeros."""

    @abstractmethod
    def reset_encoders(self, joints: AxisSelection = None) -> None:
        """Declare that the joints are at zero."""

    def encoder(self, joint: int) -> float:
        """The position of one joint."""
        return float(self.encoders(joint)[0])


class IMotorEncoders(ABC):
    """Where the rotors of the motors are (deg of the rotor, deg/s, deg/s²)."""

    @abstractmethod
    def motor_encoder_count(self) -> int:
        """How many there are."""

    @abstractmethod
    def motor_encoders(self, motors: AxisSelection = None) -> FloatArray:
        """The positions."""

    @abstractmethod
    def motor_encoder_speeds(self, motors: AxisSelection = None) -> FloatArray:
        """The speeds."""

    @abstractmethod
    def motor_encoder_accelerations(self, motors: AxisSelection = None) -> FloatArray:
        """The accelerations."""

    @abstractmethod
    def set_motor_encoders(self, values: Values, motors: AxisSelection = None) -> None:
        """Declare that the rotors are at these positions."""

    @abstractmethod
    def reset_motor_encoders(self, motors: AxisSelection = None) -> None:
        """Declare that the rotors are at zero."""

    @abstractmethod
    def counts_per_revolution(self, motor: int) -> float:
        """How many ticks a turn of the rotor has."""

    @abstractmethod
    def set_counts_per_revolution(self, motor: int, counts: float) -> None:
        """Change it."""


class IMotor(ABC):
    """Motors: temperatures (°C) and gearboxes."""

    @abstractmethod
    def motor_count(self) -> int:
        """How many there are."""

    @abstractmethod
    def temperatures(self, motors: AxisSelection = None) -> FloatArray:
        """The temperatures."""

    @abstractmethod
    def temperature_limit(self, motor: int) -> float:
        """The temperature at which a motor is switched off."""

    @abstractmethod
    def set_temperature_limit(self, motor: int, limit: float) -> None:
        """Change it."""

    @abstractmethod
    def gearbox_ratio(self, motor: int) -> float:
        """How many turns of the rotor make one of the joint; negative when they turn the other way."""

    @abstractmethod
    def set_gearbox_ratio(self, motor: int, ratio: float) -> None:
        """Change what the board reckons with."""


class IAmplifierControl(ABC):
    """The electronics that drive the motors (A, V, per cent)."""

    @abstractmethod
    def enable_amplifier(self, joint: int) -> None:
        """Switch it on."""

    @abstractmethod
    def disable_amplifier(self, joint: int) -> None:
        """Switch it off: the joint becomes idle."""

    @abstractmethod
    def amplifier_status(self, joints: AxisSelection = None) -> tuple[int, ...]:
        """Its state; 0 is in order, anything else is a fault."""

    @abstractmethod
    def currents(self, motors: AxisSelection = None) -> FloatArray:
        """The currents that are measured."""

    @abstractmethod
    def max_current(self, joint: int) -> float:
        """The current at which the joint goes into hardware fault."""

    @abstractmethod
    def set_max_current(self, joint: int, current: float) -> None:
        """Change it. At 0 the joint goes into fault at once."""

    @abstractmethod
    def nominal_current(self, motor: int) -> float:
        """The current that a motor bears for ever."""

    @abstractmethod
    def set_nominal_current(self, motor: int, current: float) -> None:
        """Change it."""

    @abstractmethod
    def peak_current(self, motor: int) -> float:
        """The current that it bears for a moment."""

    @abstractmethod
    def set_peak_current(self, motor: int, current: float) -> None:
        """Change it."""

    @abstractmethod
    def pwm(self, motor: int) -> float:
        """What it is driven with now."""

    @abstractmethod
    def pwm_limit(self, motor: int) -> float:
        """The greatest duty cycle."""

    @abstractmethod
    def set_pwm_limit(self, motor: int, limit: float) -> None:
        """Change it."""

    @abstractmethod
    def supply_voltage(self, motor: int) -> float:
        """The voltage it is supplied with."""
