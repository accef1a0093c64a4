"""Encoders, motors and amplifiers of a part."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import ControlMode
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import IAmplifierControl, IEncoders, IMotor, IMotorEncoders, values_for
from rtf.simulator.part.base import PartBase

if TYPE_CHECKING:
    from rtf.robot.interfaces import AxisSelection, FloatArray, Values

#: The supply voltage, V.
SUPPLY = 40.0
_FAULTY = 1


class PartMotors(PartBase, IEncoders, IMotorEncoders, IMotor, IAmplifierControl):
    """Measurements of joints and motors, and the settings of motors and amplifiers."""

    # IEncoders

    def encoders(self, joints: AxisSelection = None) -> FloatArray:
        return self._read(self.boards.position, joints)

    def encoder_speeds(self, joints: AxisSelection = None) -> FloatArray:
        return self._read(self.boards.velocity, joints)

    def encoder_accelerations(self, joints: AxisSelection = None) -> FloatArray:
        return self._read(self.boards.accelerations_now(), joints)

    def encoder_times(self, joints: AxisSelection = None) -> FloatArray:
        """See IEncoders: all are measured at the same moment."""
        return np.full(len(self._places(joints)), self.boards.now)

    def set_encoders(self, values: Values, joints: AxisSelection = None) -> None:
        axes = self._places(joints)
        given = values_for(len(axes), values)
        with self.lock:
            self.boards.shift_encoders(axes, given)

    def reset_encoders(self, joints: AxisSelection = None) -> None:
        self.set_encoders(np.zeros(len(self._places(joints))), joints)

    # IMotorEncoders

    def motor_encoder_count(self) -> int:
        return self.size

    def motor_encoders(self, motors: AxisSelection = None) -> FloatArray:
        return self._read(self.boards.motor_motion()[0], motors, "motor")

    def motor_encoder_speeds(self, motors: AxisSelection = None) -> FloatArray:
        return self._read(self.boards.motor_motion()[1], motors, "motor")

    def motor_encoder_accelerations(self, motors: AxisSelection = None) -> FloatArray:
        return self._read(self.boards.motor_accelerations(), motors, "motor")

    def set_motor_encoders(self, values: Values, motors: AxisSelection = None) -> None:
        axes = self._places(motors, "motor")
        given = values_for(len(axes), values)
        with self.lock:
            self.boards.shift_motor_encoders(axes, given)

    def reset_motor_encoders(self, motors: AxisSelection = None) -> None:
        self.set_motor_encoders(np.zeros(len(self._places(motors, "motor"))), motors)

    def counts_per_revolution(self, motor: int) -> float:
        return float(self.boards.rotor_resolution[self._axis(motor, "motor")])

    def set_counts_per_revolution(self, motor: int, counts: float) -> None:
        self._write(_positive(counts, "the resolution"), motor, self.boards.rotor_resolution, "motor")

    # IMotor

    def motor_count(self) -> int:
        return self.size

    def temperatures(self, motors: AxisSelection = None) -> FloatArray:
        return self._read(self.boards.temperature, motors, "motor")

    def temperature_limit(self, motor: int) -> float:
        return float(self.boards.temperature_limit[self._axis(motor, "motor")])

    def set_temperature_limit(self, motor: int, limit: float) -> None:
        self._write(limit, motor, self.boards.temperature_limit, "motor")

    def gearbox_ratio(self, motor: int) -> float:
        """See IMotor: the configured ratio, which can differ from that of the mechanics."""
        return float(self.boards.configured_gearbox[self._axis(motor, "motor")])

    def set_gearbox_ratio(self, motor: int, ratio: float) -> None:
        self._write(ratio, motor, self.boards.configured_gearbox, "motor")

    # IAmplifierControl

    def enable_amplifier(self, joint: int) -> None:
        """See IAmplifierControl: an idle joint enters position mode."""
        axis = self._axis(joint)
        with self.lock:
            if self.boards.mode[axis] == ControlMode.IDLE:
                self.boards.request_mode(axis, ControlMode.POSITION)

    def disable_amplifier(self, joint: int) -> None:
        with self.lock:
            self.boards.request_mode(self._axis(joint), ControlMode.IDLE)

    def amplifier_status(self, joints: AxisSelection = None) -> tuple[int, ...]:
        """See IAmplifierControl: 1 while the joint is in fault."""
        modes = self.boards.mode[self._places(joints)]
        return tuple(_FAULTY if mode == ControlMode.HARDWARE_FAULT else 0 for mode in modes.tolist())

    def currents(self, motors: AxisSelection = None) -> FloatArray:
        return self._read(self.boards.motor_currents(), motors, "motor")

    def max_current(self, joint: int) -> float:
        return float(self.boards.max_current[self._axis(joint)])

    def set_max_current(self, joint: int, current: float) -> None:
        with self.lock:
            self.boards.set_max_current(self._axis(joint), float(values_for(1, current)[0]))

    def nominal_current(self, motor: int) -> float:
        return float(self.boards.nominal_current[self._axis(motor, "motor")])

    def set_nominal_current(self, motor: int, current: float) -> None:
        self._write(current, motor, self.boards.nominal_current, "motor")

    def peak_current(self, motor: int) -> float:
        return float(self.boards.peak_current[self._axis(motor, "motor")])

    def set_peak_current(self, motor: int, current: float) -> None:
        self._write(current, motor, self.boards.peak_current, "motor")

    def pwm(self, motor: int) -> float:
        return float(self.boards.motor_duties()[self._axis(motor, "motor")])

    def pwm_limit(self, motor: int) -> float:
        return float(self.boards.duty_limit[self._axis(motor, "motor")])

    def set_pwm_limit(self, motor: int, limit: float) -> None:
        if not 0 <= limit <= 100:  # noqa: PLR2004 - per cent
            raise RefusedError(
                f"{self.part} motor {motor}: a duty cycle limit must be from 0 to 100 per cent, not {limit:g}"
            )
        axis = self._axis(motor, "motor")
        with self.lock:
            self.boards.duty_limit[axis] = limit
            self.boards.refresh(axis)

    def supply_voltage(self, motor: int) -> float:
        self._axis(motor, "motor")
        return SUPPLY


def _positive(value: float, what: str) -> float:
    if not value > 0:
        raise RefusedError(f"{what} must be greater than 0, not {value:g}")
    return value
