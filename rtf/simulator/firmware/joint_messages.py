"""What a joint board does with each request: it sets, it obeys, or it answers once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import TRAJECTORY_MODES, VELOCITY_MODES, ControlMode, InteractionMode
from rtf.robot.devices.can import motor_messages as m
from rtf.robot.devices.can.codes import BoardInteraction, BoardMode
from rtf.robot.errors import RefusedError
from rtf.simulator.firmware.board import number, set_information
from rtf.simulator.firmware.parameters import FULL_OUTPUT, IMPEDANCE_COUNTS, PARTS_OF_PID, SETTINGS, TORQUE_COUNTS
from rtf.simulator.firmware.readings import MODES, short

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rtf.robot.devices.can.messages import Question, Setting
    from rtf.simulator.firmware.board import Values
    from rtf.simulator.firmware.joint_state import JointBoardState

    #: Does something with a request for an axis of the board, 0 or 1.
    Handler = Callable[[JointBoardState, int, Values], None]
    Answer = Callable[[JointBoardState, int], Values]

_PER_CENT = FULL_OUTPUT / 100.0
#: The protocol has no time-out of torques and duty cycles.
_NEVER = float("inf")
_DIRECT, _TORQUE = frozenset({ControlMode.POSITION_DIRECT}), frozenset({ControlMode.TORQUE})
_PWM = frozenset({ControlMode.PWM})
#: The modes that a board which lacks its gains and limits enters.
_WITHOUT_POWER = frozenset({BoardMode.IDLE, BoardMode.FORCE_IDLE})


def _accepted(board: JointBoardState, axis: int, what: str, modes: frozenset[ControlMode]) -> NDArray[np.intp] | None:
    """Return the column of an axis, as an array, if it is in one of the modes."""
    column = board.axes[axis]
    return np.array([column]) if board.boards.accept(what, [column], modes) else None


# Commands ---------------------------------------------------------------------------------------------------------


def _set_control_mode(board: JointBoardState, axis: int, values: Values) -> None:
    mode = int(number(values))
    wanted = MODES[BoardMode(mode)] if mode in _KNOWN_MODES else None
    if wanted is None or not (board.parameters[axis].configured or mode in _WITHOUT_POWER):
        board.rejected += 1
        return
    try:
        board.boards.request_mode(board.axes[axis], wanted)
    except RefusedError:  # the host sees that the mode does not change
        board.rejected += 1


def _position_move(board: JointBoardState, axis: int, values: Values) -> None:
    axes = _accepted(board, axis, "position", TRAJECTORY_MODES)
    if axes is not None:
        ticks = board.parameters[axis].ticks
        board.boards.speeds[axes] = max(number(values, 1), 1.0) * m.POSITION_MOVE.fields[1].factor / ticks
        board.boards.move(axes, np.array([number(values) / ticks]))


def _velocity_move(board: JointBoardState, axis: int, values: Values) -> None:
    axes = _accepted(board, axis, "velocity", VELOCITY_MODES)
    if axes is not None:
        parameters = board.parameters[axis]
        speed, acceleration = parameters.speed(number(values)), parameters.acceleration(number(values, 1))
        board.boards.run(axes, np.array([speed]), np.array([acceleration]))
        if parameters.velocity_timeout is not None:
            board.boards.expire_after(axes, parameters.velocity_timeout)


def _command_position(board: JointBoardState, axis: int, values: Values) -> None:
    axes = _accepted(board, axis, "direct", _DIRECT)
    if axes is not None:
        board.boards.follow(axes, np.array([number(values) / board.parameters[axis].ticks]))


def _stop(board: JointBoardState, axis: int, _values: Values) -> None:
    axes = _accepted(board, axis, "stop", TRAJECTORY_MODES | VELOCITY_MODES)
    if axes is not None:
        board.boards.stop(axes)


def _calibrate(board: JointBoardState, axis: int, _values: Values) -> None:
    column = board.axes[axis]
    if board.boards.mode[column] != ControlMode.HARDWARE_FAULT:
        board.boards.calibrate(column)


def _set_current_limit(board: JointBoardState, axis: int, values: Values) -> None:
    board.boards.set_max_current(board.axes[axis], number(values) * m.CURRENT_LIMIT.fields[0].factor)


def _set_interaction(board: JointBoardState, axis: int, values: Values) -> None:
    compliant = values[0] == BoardInteraction.COMPLIANT
    try:
        board.boards.request_interaction(
            board.axes[axis], InteractionMode.COMPLIANT if compliant else InteractionMode.STIFF
        )
    except RefusedError:
        board.rejected += 1


def _set_broadcasts(board: JointBoardState, _axis: int, values: Values) -> None:
    board.mask = int(number(values))


def _set_velocity_shift(board: JointBoardState, axis: int, values: Values) -> None:
    board.parameters[axis].velocity_shift = min(max(int(number(values)), 0), _GREATEST_SHIFT)


def _set_estimator_shifts(board: JointBoardState, axis: int, values: Values) -> None:
    shifts = [min(int(number(values, place)), _GREATEST_SHIFT) for place in range(4)]
    board.readings.set_shifts(board.axes[axis], shifts)


def _set_velocity_timeout(board: JointBoardState, axis: int, values: Values) -> None:
    board.parameters[axis].velocity_timeout = number(values) * m.VELOCITY_TIMEOUT.fields[0].factor


def _write_flash(board: JointBoardState, _axis: int, _values: Values) -> None:
    board.flash = tuple(dict(parameters.written) for parameters in board.parameters)


def _read_flash(board: JointBoardState, _axis: int, _values: Values) -> None:
    for axis, (parameters, written) in enumerate(zip(board.parameters, board.flash, strict=True)):
        parameters.written = dict(written)
        for setting in SETTINGS:
            if setting.set.name in written:
                _apply(board, axis, setting)


# Settings: a command that is kept, applied, and read back ---------------------------------------------------------


def _set(setting: Setting) -> Handler:
    def handle(board: JointBoardState, axis: int, values: Values) -> None:
        board.parameters[axis].write(setting, values)
        _apply(board, axis, setting)

    return handle


def _get(setting: Setting) -> Handler:
    def handle(board: JointBoardState, axis: int, _values: Values) -> None:
        live = _LIVE.get(setting.value.name)
        values = live(board, axis) if live is not None else board.parameters[axis].value(setting)
        board.send(setting.value, *values, axis=axis)

    return handle


def _apply(board: JointBoardState, axis: int, setting: Setting) -> None:
    """Have a setting take effect."""
    effect = _EFFECTS.get(setting.set.name)
    if effect is not None:
        effect(board, axis)


def _apply_limits(board: JointBoardState, axis: int) -> None:
    parameters, column = board.parameters[axis], board.axes[axis]
    if parameters.written.keys() >= {"set_min_position", "set_max_position"}:
        board.boards.minimum[column], board.boards.maximum[column] = parameters.limits()
        board.boards.refresh(column)


def _apply_pid(board: JointBoardState, axis: int) -> None:
    if board.parameters[axis].configured:
        board.boards.set_pid(board.axes[axis], board.parameters[axis].pid())


def _apply_impedance(board: JointBoardState, axis: int) -> None:
    boards, column = board.boards, board.axes[axis]
    stiffness, damping, offset = board.parameters[axis].impedance()
    boards.stiffness[column] = min(max(stiffness, 0.0), float(boards.max_stiffness[column]))
    boards.damping[column] = min(max(damping, 0.0), float(boards.max_damping[column]))
    boards.impedance_offset[column] = offset
    boards.configure(column)


def _apply_impedance_offset(board: JointBoardState, axis: int) -> None:
    column = board.axes[axis]
    board.boards.impedance_offset[column] = board.parameters[axis].number(m.IMPEDANCE_OFFSET) / IMPEDANCE_COUNTS
    board.boards.configure(column)


def _apply_max_velocity(board: JointBoardState, axis: int) -> None:
    parameters = board.parameters[axis]
    board.boards.max_velocity[board.axes[axis]] = abs(parameters.speed(parameters.number(m.MAX_VELOCITY)))


def _apply_pwm_limit(board: JointBoardState, axis: int) -> None:
    column = board.axes[axis]
    board.boards.duty_limit[column] = min(abs(board.parameters[axis].number(m.PWM_LIMIT)) / _PER_CENT, 100.0)
    board.boards.configure(column)


def _exert(board: JointBoardState, axis: int) -> None:
    board.readings.set_desired_torque(board.axes[axis], board.parameters[axis].number(m.DESIRED_TORQUE))
    axes = _accepted(board, axis, "torque", _TORQUE)
    if axes is not None:
        board.boards.exert(axes, np.array([board.parameters[axis].number(m.DESIRED_TORQUE) / TORQUE_COUNTS]))
        board.boards.expire_after(axes, _NEVER)


def _drive(board: JointBoardState, axis: int) -> None:
    axes = _accepted(board, axis, "duty", _PWM)
    if axes is not None:
        board.boards.drive(axes, np.array([board.parameters[axis].number(m.OPEN_LOOP) / _PER_CENT]))
        board.boards.expire_after(axes, _NEVER)


def _set_address(board: JointBoardState, _axis: int, values: Values) -> None:
    if not board.take_address(values):
        board.rejected += 1


def _set_information(board: JointBoardState, _axis: int, values: Values) -> None:
    set_information(board, values)


def _get_information(board: JointBoardState, axis: int, _values: Values) -> None:
    for block, content in enumerate(board.information):
        board.send(m.INFORMATION.value, block, content, axis=axis)


_EFFECTS: dict[str, Callable[[JointBoardState, int], None]] = {
    m.MIN_POSITION.set.name: _apply_limits,
    m.MAX_POSITION.set.name: _apply_limits,
    m.MAX_VELOCITY.set.name: _apply_max_velocity,
    m.PWM_LIMIT.set.name: _apply_pwm_limit,
    m.IMPEDANCE.set.name: _apply_impedance,
    m.IMPEDANCE_OFFSET.set.name: _apply_impedance_offset,
    m.DESIRED_TORQUE.set.name: _exert,
    m.OPEN_LOOP.set.name: _drive,
    **{one.set.name: _apply_pid for one in PARTS_OF_PID},
}

# Questions --------------------------------------------------------------------------------------------------------


def _answer(question: Question, answer: Answer) -> Handler:
    def handle(board: JointBoardState, axis: int, _values: Values) -> None:
        board.send(question.value, *answer(board, axis), axis=axis)

    return handle


def _encoder(board: JointBoardState, axis: int) -> Values:
    column = board.axes[axis]
    return board.readings.position(column), board.readings.speed(column)


def _reference(board: JointBoardState, axis: int) -> Values:
    column = np.array([board.axes[axis]])
    return (round(float(board.boards.trajectories.at(board.boards.tick, column)[0][0]) * board.parameters[axis].ticks),)


def _velocity_reference(board: JointBoardState, axis: int) -> Values:
    parameters, speed = board.parameters[axis], float(board.boards.velocities[board.axes[axis]])
    return (short(speed * parameters.ticks / 1e3 * 2.0**parameters.velocity_shift),)


def _interaction(board: JointBoardState, axis: int) -> BoardInteraction:
    compliant = board.boards.interaction[board.axes[axis]] == InteractionMode.COMPLIANT
    return BoardInteraction.COMPLIANT if compliant else BoardInteraction.STIFF


def _calibration(board: JointBoardState, axis: int) -> Values:
    return int(board.boards.calibrated[board.axes[axis]]), board.mode(axis), int(_interaction(board, axis))


def _version(board: JointBoardState, axis: int, values: Values) -> None:
    board.answer_version(m.VERSION, values, axis)


_LIVE: dict[str, Answer] = {
    m.BOARD_ID.value.name: lambda board, _: (board.address or 0,),
    m.DESIRED_POSITION.value.name: _reference,
    m.DESIRED_VELOCITY.value.name: _velocity_reference,
}
_KNOWN_MODES = frozenset(map(int, MODES))
_GREATEST_SHIFT = 16
_QUESTIONS: tuple[tuple[Question, Answer], ...] = (
    (m.CONTROL_MODE, lambda board, axis: (board.mode(axis),)),
    (m.MOTION_DONE, lambda board, axis: (int(board.boards.trajectories.done(board.axes[axis], board.boards.tick)),)),
    (m.ENCODER, _encoder),
    (m.PID_ERROR, lambda board, axis: (board.readings.error(board.axes[axis]),)),
    (m.PID_OUTPUT, lambda board, axis: (board.readings.output(board.axes[axis]),)),
    (m.CALIBRATION_STATUS, _calibration),
    (m.POSITION_REFERENCE, _reference),
    (m.VELOCITY_REFERENCE, _velocity_reference),
    (m.ERROR_STATUS, lambda _board, _axis: (0,)),
    (m.ENCODER_SPEED, lambda board, axis: (board.readings.speed(board.axes[axis]),)),
    (m.INTERACTION, lambda board, axis: (int(_interaction(board, axis)),)),
)
#: By the name of the message.
HANDLERS: dict[str, Handler] = (
    {one.set.name: _set(one) for one in SETTINGS}
    | {one.get.name: _get(one) for one in SETTINGS}
    | {question.get.name: _answer(question, answer) for question, answer in _QUESTIONS}
    | {
        m.SET_CONTROL_MODE.name: _set_control_mode,
        m.POSITION_MOVE.name: _position_move,
        m.VELOCITY_MOVE.name: _velocity_move,
        m.COMMAND_POSITION.name: _command_position,
        m.STOP.name: _stop,
        m.CALIBRATE.name: _calibrate,
        m.CURRENT_LIMIT.name: _set_current_limit,
        m.SET_INTERACTION.name: _set_interaction,
        m.BROADCASTS.name: _set_broadcasts,
        m.VELOCITY_SHIFT.name: _set_velocity_shift,
        m.ESTIMATOR_SHIFTS.name: _set_estimator_shifts,
        m.VELOCITY_TIMEOUT.name: _set_velocity_timeout,
        m.WRITE_FLASH.name: _write_flash,
        m.READ_FLASH.name: _read_flash,
        m.BOARD_ID.set.name: _set_address,
        m.INFORMATION.set.name: _set_information,
        m.INFORMATION.get.name: _get_information,
        m.VERSION.get.name: _version,
    }
)
