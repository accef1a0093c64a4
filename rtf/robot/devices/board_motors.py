"""Encoders, motors and amplifiers of a board."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import ControlMode
from rtf.robot.devices.board_base import BoardBase
from rtf.robot.devices.motor_board import FARTHEST
from rtf.robot.errors import RefusedError
from rtf.robot.extended_state import Field
from rtf.robot.interfaces import IAmplifierControl, IEncoders, IMotor, IMotorEncoders, values_for

if TYPE_CHECKING:
    from rtf.robot.interfaces import AxisSelection, FloatArray, Values

#: The status of an amplifier in fault whose board gives no code.
_FAULTY = 1


class BoardMotors(BoardBase, IEncoders, IMotorEncoders, IMotor, IAmplifierControl):
    """Measurements of joints and motors, and the settings of motors and amplifiers."""

    # IEncoders

    def encoders(self, joints: AxisSelection = None) -> FloatArray:
        return self._measured(Field.JOINT_POSITIONS, joints)

    def encoder_speeds(self, joints: AxisSelection = None) -> FloatArray:
        return self._measured(Field.JOINT_VELOCITIES, joints)

    def encoder_accelerations(self, joints: AxisSelection = None) -> FloatArray:
        return self._measured(Field.JOINT_ACCELERATIONS, joints)

    def encoder_times(self, joints: AxisSelection = None) -> FloatArray:
        """See IEncoders: all are measured at the same moment."""
        count = len(self._places(joints))
        self._update()
        return np.full(count, self.board.measured_at)

    def set_encoders(self, values: Values, joints: AxisSelection = None) -> None:
        axes = self._places(joints)
        given = values_for(len(axes), values)
        if (np.abs(given) > FARTHEST).any():
            raise RefusedError(f"{self.name}: {given.tolist()} are not positions within {FARTHEST:g} deg")
        with self._between_cycles() as board:
            board.shift_encoders(axes, given)

    def reset_encoders(self, joints: AxisSelection = None) -> None:
        self.set_encoders(np.zeros(len(self._places(joints))), joints)

    # IMotorEncoders

    def motor_encoder_count(self) -> int:
        return self.size

    def motor_encoders(self, motors: AxisSelection = None) -> FloatArray:
        return self._measured(Field.MOTOR_POSITIONS, motors, "motor")

    def motor_encoder_speeds(self, motors: AxisSelection = None) -> FloatArray:
        return self._measured(Field.MOTOR_VELOCITIES, motors, "motor")

    def motor_encoder_accelerations(self, motors: AxisSelection = None) -> FloatArray:
        return self._measured(Field.MOTOR_ACCELERATIONS, motors, "motor")

    def set_motor_encoders(self, values: Values, motors: AxisSelection = None) -> None:
        axes = self._places(motors, "motor")
        given = values_for(len(axes), values)
        with self._between_cycles() as board:
            board.shift_motor_encoders(axes, given)

    def reset_motor_encoders(self, motors: AxisSelection = None) -> None:
        self.set_motor_encoders(np.zeros(len(self._places(motors, "motor"))), motors)

    def counts_per_revolution(self, motor: int) -> float:
        return self._setting(self.board.rotor_resolution, motor, "motor")

    def set_counts_per_revolution(self, motor: int, counts: float) -> None:
        self._write(_positive(counts, "the resolution"), motor, self.board.rotor_resolution, "motor")

    # IMotor

    def motor_count(self) -> int:
        return self.size

    def temperatures(self, motors: AxisSelection = None) -> FloatArray:
        return self._measured(Field.TEMPERATURES, motors, "motor")

    def temperature_limit(self, motor: int) -> float:
        return self._setting(self.board.temperature_limit, motor, "motor")

    def set_temperature_limit(self, motor: int, limit: float) -> None:
        self._write(limit, motor, self.board.temperature_limit, "motor")

    def gearbox_ratio(self, motor: int) -> float:
        """See IMotor: the configured ratio, which can differ from that of the mechanics."""
        return self._setting(self.board.configured_gearbox, motor, "motor")

    def set_gearbox_ratio(self, motor: int, ratio: float) -> None:
        if ratio == 0:
            raise RefusedError(f"{self.name} motor {motor}: no gearbox has a ratio of 0")
        self._write(ratio, motor, self.board.configured_gearbox, "motor")

    # IAmplifierControl

    def enable_amplifier(self, joint: int) -> None:
        """See IAmplifierControl: an idle joint enters position mode."""
        axis = self._axis(joint)
        with self._between_cycles() as board:
            if board.mode[axis] == ControlMode.IDLE:
                board.request_mode(axis, ControlMode.POSITION)

    def disable_amplifier(self, joint: int) -> None:
        axis = self._axis(joint)
        with self._between_cycles() as board:
            board.request_mode(axis, ControlMode.IDLE)

    def amplifier_status(self, joints: AxisSelection = None) -> tuple[int, ...]:
        """See IAmplifierControl: the code of the fault while the joint is in fault."""
        board, axes = self.board, self._places(joints).tolist()
        return tuple(
            (board.faults[axis][0] or _FAULTY) if board.mode[axis] == ControlMode.HARDWARE_FAULT else 0 for axis in axes
        )

    def currents(self, motors: AxisSelection = None) -> FloatArray:
        """Return the currents, for both IAmplifierControl and ICurrentControl."""
        return self._measured(Field.CURRENTS, motors, "motor")

    def max_current(self, joint: int) -> float:
        return self._setting(self.board.max_current, joint)

    def set_max_current(self, joint: int, current: float) -> None:
        axis, (most,) = self._axis(joint), values_for(1, current).tolist()
        with self._between_cycles() as board:
            board.set_max_current(axis, most)

    def nominal_current(self, motor: int) -> float:
        return self._setting(self.board.nominal_current, motor, "motor")

    def set_nominal_current(self, motor: int, current: float) -> None:
        self._write(current, motor, self.board.nominal_current, "motor")

    def peak_current(self, motor: int) -> float:
        return self._setting(self.board.peak_current, motor, "motor")

    def set_peak_current(self, motor: int, current: float) -> None:
        self._write(current, motor, self.board.peak_current, "motor")

    def pwm(self, motor: int) -> float:
        return float(self._measured(Field.DUTY_CYCLES, motor, "motor")[0])

    def pwm_limit(self, motor: int) -> float:
        return self._setting(self.board.duty_limit, motor, "motor")

    def set_pwm_limit(self, motor: int, limit: float) -> None:
        if not 0 <= limit <= 100:  # noqa: PLR2004 - per cent
            raise RefusedError(
                f"{self.name} motor {motor}: a duty cycle limit must be from 0 to 100 per cent, not {limit:g}"
            )
        self._write(limit, motor, self.board.duty_limit, "motor")

    def supply_voltage(self, motor: int) -> float:
        return self._setting(self.board.supply_voltage, motor, "motor")


def _positive(value: float, what: str) -> float:
    if not value > 0:
        raise RefusedError(f"{what} must be greater than 0, not {value:g}")
    return value
