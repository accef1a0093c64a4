"""The client of a control board: encoders, motors and amplifiers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.client.stub import BoardStub
from rtf.robot.extended_state import Field
from rtf.robot.interfaces import IAmplifierControl, IEncoders, IMotor, IMotorEncoders
from rtf.robot.vocabulary_kinds import whole

if TYPE_CHECKING:
    from rtf.robot.interfaces import AxisSelection, FloatArray, Values


class MotorsStub(BoardStub, IEncoders, IMotorEncoders, IMotor, IAmplifierControl):
    """Encoders, currents and duty cycles are those of the last state that came; all else is asked for."""

    # Encoders of joints ------------------------------------------------------------------------------------------

    def encoders(self, joints: AxisSelection = None) -> FloatArray:
        """See IEncoders."""
        return self._link.state.read(Field.JOINT_POSITIONS, joints)

    def encoder_speeds(self, joints: AxisSelection = None) -> FloatArray:
        """See IEncoders."""
        return self._link.state.read(Field.JOINT_VELOCITIES, joints)

    def encoder_accelerations(self, joints: AxisSelection = None) -> FloatArray:
        """See IEncoders."""
        return self._link.state.read(Field.JOINT_ACCELERATIONS, joints)

    def encoder_times(self, joints: AxisSelection = None) -> FloatArray:
        """See IEncoders; the message has one time for all."""
        return self._link.state.times(joints)

    def set_encoders(self, values: Values, joints: AxisSelection = None) -> None:
        """See IEncoders."""
        self._set("set_encoders", values, joints)

    def reset_encoders(self, joints: AxisSelection = None) -> None:
        """See IEncoders."""
        self._do("reset_encoders", joints)

    # Encoders of motors ------------------------------------------------------------------------------------------

    def motor_encoder_count(self) -> int:
        """See IMotorEncoders."""
        return int(self._get("motor_encoder_count"))

    def motor_encoders(self, motors: AxisSelection = None) -> FloatArray:
        """See IMotorEncoders."""
        return self._link.state.read(Field.MOTOR_POSITIONS, motors)

    def motor_encoder_speeds(self, motors: AxisSelection = None) -> FloatArray:
        """See IMotorEncoders."""
        return self._link.state.read(Field.MOTOR_VELOCITIES, motors)

    def motor_encoder_accelerations(self, motors: AxisSelection = None) -> FloatArray:
        """See IMotorEncoders."""
        return self._link.state.read(Field.MOTOR_ACCELERATIONS, motors)

    def set_motor_encoders(self, values: Values, motors: AxisSelection = None) -> None:
        """See IMotorEncoders."""
        self._set("set_motor_encoders", values, motors)

    def reset_motor_encoders(self, motors: AxisSelection = None) -> None:
        """See IMotorEncoders."""
        self._do("reset_motor_encoders", motors)

    def counts_per_revolution(self, motor: int) -> float:
        """See IMotorEncoders."""
        return float(self._get_of("counts_per_revolution", motor))

    def set_counts_per_revolution(self, motor: int, counts: float) -> None:
        """See IMotorEncoders."""
        self._set_of("set_counts_per_revolution", motor, *self._finite(counts))

    # Motors ------------------------------------------------------------------------------------------------------

    def motor_count(self) -> int:
        """See IMotor."""
        return int(self._get("motor_count"))

    def temperatures(self, motors: AxisSelection = None) -> FloatArray:
        """See IMotor."""
        return self._floats("temperatures", motors)

    def temperature_limit(self, motor: int) -> float:
        """See IMotor."""
        return float(self._get_of("temperature_limit", motor))

    def set_temperature_limit(self, motor: int, limit: float) -> None:
        """See IMotor."""
        self._set_of("set_temperature_limit", motor, *self._finite(limit))

    def gearbox_ratio(self, motor: int) -> float:
        """See IMotor."""
        return float(self._get_of("gearbox_ratio", motor))

    def set_gearbox_ratio(self, motor: int, ratio: float) -> None:
        """See IMotor."""
        self._set_of("set_gearbox_ratio", motor, *self._finite(ratio))

    # Amplifiers --------------------------------------------------------------------------------------------------

    def enable_amplifier(self, joint: int) -> None:
        """See IAmplifierControl."""
        self._set_of("enable_amplifier", joint)

    def disable_amplifier(self, joint: int) -> None:
        """See IAmplifierControl."""
        self._set_of("disable_amplifier", joint)

    def amplifier_status(self, joints: AxisSelection = None) -> tuple[int, ...]:
        """See IAmplifierControl."""
        return self._words("amplifier_status", joints, whole)

    def currents(self, motors: AxisSelection = None) -> FloatArray:
        """See IAmplifierControl and ICurrentControl."""
        return self._link.state.read(Field.CURRENTS, motors)

    def max_current(self, joint: int) -> float:
        """See IAmplifierControl."""
        return float(self._get_of("max_current", joint))

    def set_max_current(self, joint: int, current: float) -> None:
        """See IAmplifierControl."""
        self._set_of("set_max_current", joint, *self._finite(current))

    def nominal_current(self, motor: int) -> float:
        """See IAmplifierControl."""
        return float(self._get_of("nominal_current", motor))

    def set_nominal_current(self, motor: int, current: float) -> None:
        """See IAmplifierControl."""
        self._set_of("set_nominal_current", motor, *self._finite(current))

    def peak_current(self, motor: int) -> float:
        """See IAmplifierControl."""
        return float(self._get_of("peak_current", motor))

    def set_peak_current(self, motor: int, current: float) -> None:
        """See IAmplifierControl."""
        self._set_of("set_peak_current", motor, *self._finite(current))

    def pwm(self, motor: int) -> float:
        """See IAmplifierControl; the duty cycle of the last state."""
        return float(self._link.state.read(Field.DUTY_CYCLES, motor)[0])

    def pwm_limit(self, motor: int) -> float:
        """See IAmplifierControl."""
        return float(self._get_of("pwm_limit", motor))

    def set_pwm_limit(self, motor: int, limit: float) -> None:
        """See IAmplifierControl."""
        self._set_of("set_pwm_limit", motor, *self._finite(limit))

    def supply_voltage(self, motor: int) -> float:
        """See IAmplifierControl."""
        return float(self._get_of("supply_voltage", motor))
