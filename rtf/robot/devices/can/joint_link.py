"""An axis on a board that controls joints: it generates trajectories and controls positions itself.

Position moves, velocities and direct positions are sent when they are commanded. Velocities are repeated, so that a
board whose host has died ends them by its own time-out; a position move ends at its target in any case.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.devices.can import motor_messages as motor
from rtf.robot.devices.can.axis_link import NEVER, AxisLink
from rtf.robot.devices.can.axis_scale import LONG
from rtf.robot.devices.can.codes import BoardInteraction, BoardMode, BoardState, CanState, JointFault
from rtf.robot.devices.can.messages import Dialect
from rtf.robot.extended_state import Field
from rtf.robot.interfaces import PidType

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.robot.devices.board_driver import DrivenBoard, Setpoints
    from rtf.robot.devices.can.axis_link import Sent
    from rtf.robot.devices.can.messages import Frame, Message

#: The periodic messages that are wanted, as a mask: positions, duty cycles, status, currents, velocities, errors.
BROADCASTS = sum(
    1 << one.code - 1
    for one in (
        motor.BROADCAST_POSITION,
        motor.BROADCAST_PID,
        motor.STATUS,
        motor.BROADCAST_CURRENT,
        motor.BROADCAST_VELOCITY,
        motor.BROADCAST_ERROR,
        motor.ADDITIONAL_STATUS,
    )
)
#: Module-level names: members of enumerations are slow to look up.
_POSITION, _VELOCITY, _MIXED = ControlMode.POSITION, ControlMode.VELOCITY, ControlMode.MIXED
_DIRECT, _TORQUE, _PWM = ControlMode.POSITION_DIRECT, ControlMode.TORQUE, ControlMode.PWM
#: A velocity is repeated so many times in the time after which the board ends it.
_REPEATS = 5


class JointLink(AxisLink):
    """An axis on such a board."""

    dialect = Dialect.JOINT
    faults = JointFault
    mode_question = motor.CONTROL_MODE
    measures = frozenset(
        {
            Field.JOINT_POSITIONS,
            Field.JOINT_VELOCITIES,
            Field.JOINT_ACCELERATIONS,
            Field.CURRENTS,
            Field.DUTY_CYCLES,
            Field.TORQUES,
        }
    )
    modes = {  # noqa: RUF012 - declared as a class variable by the base
        ControlMode.POSITION: BoardMode.POSITION,
        ControlMode.VELOCITY: BoardMode.VELOCITY,
        ControlMode.MIXED: BoardMode.MIXED,
        ControlMode.POSITION_DIRECT: BoardMode.DIRECT,
        ControlMode.TORQUE: BoardMode.TORQUE,
        ControlMode.PWM: BoardMode.OPEN_LOOP,
        ControlMode.IDLE: BoardMode.IDLE,
        ControlMode.CALIBRATING: BoardMode.CALIBRATING,
    }
    _begun = NEVER  # the step of the trajectory that was sent
    _target = 0.0
    _repeated = NEVER  # when a velocity was last sent, s
    _value: int | None = None  # of a setpoint that is sent when it changes
    _torque = 0  # the desired torque that was sent

    def measured(self) -> frozenset[Field]:
        return self.measures if self.scale.newtons else self.measures - {Field.TORQUES}

    def supported(self) -> frozenset[ControlMode]:
        return super().supported() - (frozenset() if self.scale.newtons else {ControlMode.TORQUE})

    # To the board --------------------------------------------------------------------------------------------------

    def all_settings(self, board: DrivenBoard, axis: int) -> Iterator[Sent]:
        scale, settings = self.scale, self.settings
        raw = scale.raw_pid(board.controls[PidType.POSITION].pids[axis])
        if any(raw[:3]) or raw.output_limit:
            yield motor.POSITION_PID, raw[:4]
            yield motor.POSITION_LIMITS, raw[4:7]
            yield motor.POSITION_STICTION, raw[7:9]
        if settings.torque_pid is not None:
            yield motor.TORQUE_PID, settings.torque_pid[:4]
            yield motor.TORQUE_LIMITS, settings.torque_pid[4:7]
        ends = sorted(scale.position(float(end)) for end in (board.minimum[axis], board.maximum[axis]))
        yield motor.MIN_POSITION, (ends[0],)
        yield motor.MAX_POSITION, (ends[1],)
        yield motor.VELOCITY_SHIFT, (scale.move_shift,)
        yield motor.ESTIMATOR_SHIFTS, (scale.speed_shift, scale.acceleration_shift) * 2
        yield motor.VELOCITY_TIMEOUT, (settings.velocity_timeout,)
        yield motor.MAX_VELOCITY, (abs(scale.velocity(float(board.max_velocity[axis]))),)
        yield motor.CURRENT_LIMIT, (scale.integer("current limit", float(board.max_current[axis]) * 1e3, LONG),)
        yield motor.PWM_LIMIT, (abs(scale.duty(float(board.duty_limit[axis]))),)
        yield from self._compliance(board, axis)

    def _compliance(self, board: DrivenBoard, axis: int) -> Iterator[Sent]:
        """Yield the interaction mode, and the impedance of an axis that has one."""
        settings, scale = self.settings, self.scale
        if settings.stiffness:
            yield (
                motor.IMPEDANCE,
                (
                    scale.integer("stiffness", float(board.stiffness[axis]) * settings.stiffness),
                    scale.integer("damping", float(board.damping[axis]) * settings.damping),
                    scale.integer("offset of the impedance", float(board.impedance_offset[axis]) * scale.newtons),
                ),
            )
        compliant = board.interaction[axis] == InteractionMode.COMPLIANT
        yield motor.SET_INTERACTION, (BoardInteraction.COMPLIANT if compliant else BoardInteraction.STIFF,)

    def begin(self, board: DrivenBoard, axis: int) -> None:
        """Take note that an axis has entered a mode, in which its board holds it as the trajectory does."""
        self._begun, self._target = float(board.trajectories.begins[axis]), float(board.targets[axis])
        self._repeated, self._value = NEVER, None

    def calibrate(self, board: DrivenBoard, axis: int) -> Frame:
        """Return the command of a calibration with the parameters of the axis."""
        given = board.calibration[axis]
        numbers = [self.scale.integer("calibration", value) for value in (given.param1, given.param2, given.param3)]
        return motor.CALIBRATE.frame(self.board, given.kind & 0xFF, *numbers, axis=self.index)

    def setpoint(
        self, mode: ControlMode, board: DrivenBoard, setpoints: Setpoints, axis: int, now: float
    ) -> Frame | None:
        """Return the command of an axis, if it is to be sent now."""
        scale = self.scale
        if mode is _DIRECT:
            return self._changed(motor.COMMAND_POSITION, scale.position(self._own(board, axis, board.direct[axis])))
        if mode is _TORQUE:
            self._torque = scale.torque(float(setpoints.torques[axis]))
            return self._changed(motor.DESIRED_TORQUE.set, self._torque)
        if mode is _PWM:
            return self._changed(motor.OPEN_LOOP.set, scale.duty(float(setpoints.duty_cycles[axis])))
        if mode is not _POSITION and mode is not _VELOCITY and mode is not _MIXED:
            return None
        begun, target = float(board.trajectories.begins[axis]), float(board.targets[axis])
        new = begun != self._begun or target != self._target  # two commands may come in one cycle
        moves = mode is _POSITION or (mode is _MIXED and target != self._target)
        self._begun, self._target = begun, target
        if moves:
            return self._move(board, axis, target) if new else None
        return self._run(board, axis, now, new=new)

    def _move(self, board: DrivenBoard, axis: int, target: float) -> Frame:
        speed = self.scale.move_speed(float(board.speeds[axis]))
        return motor.POSITION_MOVE.frame(
            self.board, self.scale.position(self._own(board, axis, target)), speed, axis=self.index
        )

    def _run(self, board: DrivenBoard, axis: int, now: float, *, new: bool) -> Frame | None:
        """Return the velocity of an axis, if it has changed, or is to be repeated as it is not 0."""
        velocity = float(board.trajectories.final_velocities[axis])
        due = velocity and now - self._repeated >= self.settings.velocity_timeout * 1e-3 / _REPEATS
        if not (new or due):
            return None
        self._repeated = now
        return motor.VELOCITY_MOVE.frame(
            self.board,
            self.scale.velocity(velocity),
            self.scale.acceleration(float(board.accelerations[axis])),
            axis=self.index,
        )

    def _own(self, board: DrivenBoard, axis: int, position: float) -> float:
        """Return a position as the board's own encoder counts."""
        return float(position - board.encoder_offsets[axis])

    def _changed(self, message: Message, value: int) -> Frame | None:
        """Return the frame of a setpoint, if it is another one than before."""
        if value == self._value:
            return None
        self._value = value
        return message.frame(self.board, value, axis=self.index)

    # From the board ------------------------------------------------------------------------------------------------

    def _keep_position(self, values: tuple[int, ...], stamp: float) -> None:
        self.feedback.position, self.feedback.stamp = self.scale.degrees(values[self.index]), stamp

    def _keep_velocity(self, values: tuple[int, ...], _stamp: float) -> None:
        self.feedback.velocity = self.scale.broadcast_velocity(values[self.index])
        self.feedback.acceleration = self.scale.broadcast_acceleration(values[2 + self.index])

    def _keep_duty(self, values: tuple[int, ...], _stamp: float) -> None:
        self.feedback.duty = self.scale.per_cent(values[2 + self.index])

    def _keep_current(self, values: tuple[int, ...], _stamp: float) -> None:
        self.feedback.current = values[self.index] / self.scale.amperes

    def _keep_error(self, values: tuple[int, ...], _stamp: float) -> None:
        if self.scale.newtons:
            self.feedback.torque = (self._torque - values[2 + self.index]) / self.scale.newtons

    def _keep_status(self, values: tuple[int, ...], _stamp: float) -> None:
        self.feedback.faults, self.feedback.mode = values[2 * self.index : 2 * self.index + 2]
        self.feedback.warnings = _warnings(*values[4:6])
        self.feedback.errors = values[6], values[7]

    kept = {  # noqa: RUF012 - declared as a class variable by the base
        motor.BROADCAST_POSITION: _keep_position,
        motor.BROADCAST_VELOCITY: _keep_velocity,
        motor.BROADCAST_PID: _keep_duty,
        motor.BROADCAST_CURRENT: _keep_current,
        motor.BROADCAST_ERROR: _keep_error,
        motor.STATUS: _keep_status,
    }


def _warnings(can_state: int, board_state: int) -> tuple[str, ...]:
    """Return the names of what a board reports of itself, beside faults."""
    return tuple(str(one.name).lower().replace("_", " ") for one in (*CanState(can_state), *BoardState(board_state)))
