"""An axis on a board that drives a motor, by its velocity, current or duty cycle, with a setpoint every period.

Positions are controlled here: the velocity of the trajectory, and as much more as its error asks for. A board whose
host has died stops when no setpoint has arrived for a second.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.control_modes import ControlMode
from rtf.robot.devices.can import motor_messages as motor
from rtf.robot.devices.can.axis_link import AxisLink
from rtf.robot.devices.can.codes import BoardMode, FocFault, MotorFlag, QuadratureState
from rtf.robot.devices.can.exchange import PROTOCOL
from rtf.robot.devices.can.messages import Dialect
from rtf.robot.extended_state import Field

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.robot.devices.board_driver import DrivenBoard, Setpoints
    from rtf.robot.devices.can.axis_link import Sent
    from rtf.robot.devices.can.axis_scale import RawPid
    from rtf.robot.devices.can.messages import Frame, Message, Setting

#: The boards that setpoints are for: the frame has four.
BOARDS = range(1, 5)
_MILLIAMPERES = 1000.0
#: The bits among the faults that are warnings of the bus.
_WARNINGS = FocFault.TX_PASSIVE | FocFault.RX_PASSIVE | FocFault.TX_WARNING | FocFault.RX_WARNING | FocFault.CAN_OVERRUN


class FocLink(AxisLink):
    """An axis on such a board."""

    dialect = Dialect.FOC
    faults = FocFault
    mode_question = motor.FOC_CONTROL_MODE
    measures = frozenset(
        {
            Field.JOINT_POSITIONS,
            Field.JOINT_VELOCITIES,
            Field.MOTOR_POSITIONS,
            Field.MOTOR_VELOCITIES,
            Field.CURRENTS,
            Field.DUTY_CYCLES,
            Field.TEMPERATURES,
        }
    )
    modes = {  # noqa: RUF012 - declared as a class variable by the base
        ControlMode.POSITION: BoardMode.SPEED_CURRENT,
        ControlMode.VELOCITY: BoardMode.SPEED_CURRENT,
        ControlMode.MIXED: BoardMode.SPEED_CURRENT,
        ControlMode.POSITION_DIRECT: BoardMode.SPEED_CURRENT,
        ControlMode.CURRENT: BoardMode.CURRENT,
        ControlMode.PWM: BoardMode.OPEN_LOOP,
        ControlMode.IDLE: BoardMode.IDLE,
    }

    def measured(self) -> frozenset[Field]:
        warm = MotorFlag.TEMPERATURE_SENSOR in self.settings.drive.flags
        return self.measures if warm else self.measures - {Field.TEMPERATURES}

    # To the board --------------------------------------------------------------------------------------------------

    def all_settings(self, board: DrivenBoard, axis: int) -> Iterator[Sent]:
        drive, integer = self.settings.drive, self.scale.integer
        yield motor.VERSION.get, PROTOCOL  # without which a board that was reset takes no settings
        yield motor.MOTOR_CONFIGURATION, (int(drive.flags), drive.resolution, 0, drive.poles, 0)
        limits = (board.nominal_current[axis], board.peak_current[axis], board.max_current[axis])
        yield motor.CURRENT_LIMITS, tuple(integer("current limit", float(one) * _MILLIAMPERES) for one in limits)
        if drive.current_pid is not None:
            yield from _controller(motor.CURRENT_PID, motor.CURRENT_PID_LIMITS, drive.current_pid)
        if drive.velocity_pid is not None:
            yield from _controller(motor.VELOCITY_PID, motor.VELOCITY_PID_LIMITS, drive.velocity_pid)
        yield motor.TEMPERATURE_LIMIT, (integer("temperature limit", float(board.temperature_limit[axis])),)

    def request(self, mode: ControlMode, now: float) -> list[Frame]:
        """Return the commands: a board goes from one mode with power to another one without power in between."""
        before = self.wanted
        frames = super().request(mode, now)
        if self.wanted in _POWERED and before in _POWERED and self.wanted is not before:
            frames.insert(0, motor.SET_CONTROL_MODE.frame(self.board, BoardMode.IDLE))
        return frames

    def word(self, mode: ControlMode, setpoints: Setpoints, axis: int) -> int:
        """Return the setpoint of the board, in the unit of its mode; 0 without power."""
        board_mode = self.modes.get(mode, BoardMode.IDLE)
        if board_mode is BoardMode.CURRENT:
            return self.scale.integer("current", float(setpoints.currents[axis]) * _MILLIAMPERES)
        if board_mode is BoardMode.OPEN_LOOP:
            return self.scale.integer("duty cycle", float(setpoints.duty_cycles[axis]) / _DUTY)
        if board_mode is not BoardMode.SPEED_CURRENT:
            return 0
        error = float(setpoints.positions[axis]) - self.feedback.position
        velocity = float(setpoints.velocities[axis]) + self.settings.drive.position_gain * error
        most = self.settings.axis.max_velocity
        joint = min(max(velocity, -most), most)
        return self.scale.integer("velocity", joint * self.settings.axis.gearbox / _VELOCITY)

    # From the board ------------------------------------------------------------------------------------------------

    def _keep_feedback(self, values: tuple[int, ...], stamp: float) -> None:
        feedback, gearbox = self.feedback, self.settings.axis.gearbox
        current, velocity, position = values
        feedback.current = current / _MILLIAMPERES
        feedback.motor_velocity = velocity * _VELOCITY
        feedback.motor_position = position * _POSITION
        feedback.position = feedback.motor_position / gearbox - self.scale.zero
        feedback.velocity = feedback.motor_velocity / gearbox
        feedback.stamp = stamp

    def _keep_status(self, values: tuple[int, ...], _stamp: float) -> None:
        mode, encoder, duty, faults = values
        self.feedback.duty = duty * _DUTY
        self.feedback.mode, self.feedback.faults = mode, faults
        warnings = [*QuadratureState(encoder), *(FocFault(faults) & _WARNINGS)]
        self.feedback.warnings = tuple(str(one.name).lower().replace("_", " ") for one in warnings)

    def _keep_temperature(self, values: tuple[int, ...], _stamp: float) -> None:
        self.feedback.temperature = values[0]

    kept = {  # noqa: RUF012 - declared as a class variable by the base
        motor.FOC_FEEDBACK: _keep_feedback,
        motor.FOC_STATUS: _keep_status,
        motor.FOC_ADDITIONAL_STATUS: _keep_temperature,
    }


_POWERED = frozenset(FocLink.modes.values()) - {BoardMode.IDLE}


def _controller(gains: Setting, limits: Setting, raw: RawPid) -> Iterator[Sent]:
    yield gains, raw[:4]
    yield limits, raw[4:7]


def _factor(message: Message, name: str) -> float:
    """Return the factor of a field."""
    return next(one.factor for one in message.fields if one.name == name)


_VELOCITY, _POSITION = (_factor(motor.FOC_FEEDBACK, name) for name in ("velocity", "position"))
_DUTY = _factor(motor.FOC_STATUS, "pwm")
