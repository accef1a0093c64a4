"""A board that drives one motor: its states, its settings, its watchdog, and the control of the rotor's velocity.

It gets a setpoint in every frame for all boards of its bus, and answers each with what it measures at its motor. It
knows no joint: positions are those of the rotor, and a current drives the motor, whatever its gear does with that. The
velocity is controlled here, at 1 kHz, by a current or a voltage.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import ControlMode
from rtf.robot.devices.can import motor_messages as m
from rtf.robot.devices.can.codes import BoardMode, BoardType, FocFault, FocPidParameter, FocPidType, MotorFlag
from rtf.robot.devices.can.messages import HOST, Dialect
from rtf.robot.devices.motor_board import OVERCURRENT, OVERHEATED
from rtf.simulator.firmware.board import Board, number
from rtf.simulator.firmware.parameters import DRIVE_SETTINGS, FULL_OUTPUT, Settings
from rtf.simulator.firmware.readings import short

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.robot.devices.can.codec import Decoded
    from rtf.robot.devices.can.messages import Setting
    from rtf.simulator.boards import Boards
    from rtf.simulator.firmware.board import Values
    from rtf.simulator.firmware.rotors import Rotors
    from rtf.simulator.firmware.wire import Wire

#: Milliseconds without a setpoint after which a motor is switched off.
WATCHDOG = 1000
#: Milliseconds between two additional statuses.
_ADDITIONAL = 100
#: The modes with power, and those of them that control the velocity.
POWERED = frozenset({BoardMode.CURRENT, BoardMode.SPEED_VOLTAGE, BoardMode.SPEED_CURRENT, BoardMode.OPEN_LOOP})
_SPEED = frozenset({BoardMode.SPEED_VOLTAGE, BoardMode.SPEED_CURRENT})
_VOLTAGE = frozenset({BoardMode.SPEED_VOLTAGE, BoardMode.OPEN_LOOP})
_FAULTS = {OVERCURRENT: FocFault.OVERCURRENT, OVERHEATED: FocFault.OVERHEATING}
#: Errors of a node beyond which its controller warns, and is passive.
_WARNING, _PASSIVE = 96, 127
_MILLI = 1e-3
#: The parameter of a motor that is the offset of its Hall sensors, and whether they are swapped.
_HALL = 2
_PER_CENT = 100.0 / FULL_OUTPUT


class Gains:
    """The controller of a velocity: outputs for an error, for its sum over the milliseconds, and their limits."""

    kp = ki = offset = output_limit = integral_limit = 0.0
    integral = 0.0

    def output(self, error: float) -> float:
        """Return the output of a millisecond."""
        most = self.integral_limit
        self.integral = min(max(self.integral + self.ki * error, -most), most)
        return min(max(self.kp * error + self.integral + self.offset, -self.output_limit), self.output_limit)


class FocBoard(Board):
    """A board at ``address`` with the motor of one ``axis`` of the robot, a column in ``boards``, of its own alone.

    ``faults`` are those that the board has found. Its settings are lost by a reset.
    """

    dialect = Dialect.FOC
    watchdog: float = WATCHDOG

    def __init__(
        self,
        wire: Wire,
        address: int,
        boards: Boards,
        axis: int,
        rotors: Rotors,
        *,
        board_type: BoardType = BoardType.FOC_2,
    ) -> None:
        super().__init__(wire, address, board_type)
        self.boards, self.axis, self.rotors = boards, axis, rotors
        self.axes = (axis,)
        self._column = np.array([axis])
        amperes = np.zeros(boards.count)
        amperes[axis] = 1.0
        self._torque = float(boards.motors.torques_of(amperes)[axis])  # Nm an ampere
        self.reset()

    def reset(self) -> None:
        """Start as after power-up: not configured, the motor off."""
        self.silent = False
        self.settings = Settings()
        self.agreed = False
        self.faults = FocFault(0)
        self.locked: set[int] = set()  # controllers whose parameters may be changed one by one
        self.warm = False  # has a sensor of its temperature
        self.gains = Gains()
        self.hall: Values = (_HALL, 0, 0)
        self.setpoint = 0
        self._since = 0  # milliseconds since the last setpoint
        self._switch_off()
        self.mode = BoardMode.NOT_CONFIGURED

    def clear(self) -> None:
        super().clear()
        self.faults, self.setpoint, self.gains.integral = FocFault(0), 0, 0.0
        if self.mode is not BoardMode.NOT_CONFIGURED:
            self.mode = BoardMode.IDLE  # until the host gives power, the robot is held as after its start

    def stop(self) -> None:
        if self.mode in POWERED:
            self._switch_off()
            self.mode = BoardMode.IDLE

    # Messages --------------------------------------------------------------------------------------------------------

    def handle(self, got: Decoded) -> bool:
        message = got.message
        if got.source == HOST and message in m.SETPOINTS:
            return self._take_setpoint(got.values)
        handler = DRIVE_HANDLERS.get(message.name)
        return handler is not None and not got.axis and handler(self, got.values)

    def _take_setpoint(self, words: Values) -> bool:
        if self.address is None or self.address > len(words):
            return False
        self._since = 0
        self.demand(int(number(words, self.address - 1)))
        self._send_feedback()
        return True

    def demand(self, setpoint: int) -> None:
        """Take a setpoint, in the unit of the mode; without power it is 0."""
        self.setpoint = setpoint if self.mode in POWERED else 0
        if self.mode in POWERED and self.mode not in _SPEED:
            self._feed(self.setpoint)

    def _send_feedback(self) -> None:
        axis, rotors = self.axis, self.rotors
        measured = (short(rotors.currents[axis]), short(rotors.speeds[axis]), round(rotors.positions[axis]))
        self.send(m.FOC_FEEDBACK, *measured)
        self.send(m.FOC_STATUS, self.mode, 0, short(rotors.duties[axis]), int(self.faults | self._bus_faults()))

    def _bus_faults(self) -> FocFault:
        sent, received = self.connection.sender_errors, self.connection.receiver_errors
        found = FocFault.CAN_OVERRUN if self.connection.lost else FocFault(0)
        if sent > _WARNING:
            found |= FocFault.TX_PASSIVE if sent > _PASSIVE else FocFault.TX_WARNING
        if received > _WARNING:
            found |= FocFault.RX_WARNING
        return found

    # A millisecond ---------------------------------------------------------------------------------------------------

    def step(self, tick: int) -> None:
        """Supervise the motor and control its velocity for a millisecond."""
        if self.boards.mode[self.axis] == ControlMode.HARDWARE_FAULT:
            self.mode = BoardMode.HARDWARE_FAULT
            self.faults |= _FAULTS.get(self.boards.faults[self.axis][0], FocFault.EXTERNAL)
        elif self.mode in POWERED:
            self._since += 1
            if self._since > self.watchdog:
                self.faults |= FocFault.SETPOINT_EXPIRED
                self._switch_off()
                self.mode = BoardMode.HARDWARE_FAULT
            elif self.mode in _SPEED:
                self._control()
        if self.warm and not tick % _ADDITIONAL:
            self.send(m.FOC_ADDITIONAL_STATUS, short(float(self.boards.temperature[self.axis])))

    def _control(self) -> None:
        """Drive the motor by the controller of its velocity."""
        self._feed(self.gains.output(self.setpoint - self.rotors.speeds[self.axis]))

    def _feed(self, output: float) -> None:
        """Give the motor a current (mA), or a duty cycle in the modes of a voltage."""
        boards, axis = self.boards, self.axis
        if self.mode in _VOLTAGE:
            boards.drive(self._column, np.array([output * _PER_CENT]))
            boards.expire_after(self._column, float("inf"))
            return
        most = float(boards.peak_current[axis])
        current = min(max(output * _MILLI, -most), most)
        boards.currents[axis] = current
        boards.controllers.set_bias(axis, current * self._torque)

    # Modes -----------------------------------------------------------------------------------------------------------

    def enter(self, wanted: BoardMode) -> bool:
        """Change the mode as the board's states allow it; return whether they do."""
        if self.mode is BoardMode.HARDWARE_FAULT:
            if wanted is not BoardMode.FORCE_IDLE:
                return False
            self.faults = FocFault(0)
        if wanted in (BoardMode.IDLE, BoardMode.FORCE_IDLE):
            if self.mode is BoardMode.NOT_CONFIGURED:
                return False
            self._switch_off()
            self.mode = BoardMode.IDLE
            return True
        if self.mode is not BoardMode.IDLE or wanted not in POWERED:
            return self.mode is wanted
        self.mode = wanted
        self.setpoint, self._since, self.gains.integral = 0, 0, 0.0
        self.boards.enter(self.axis, ControlMode.PWM if wanted in _VOLTAGE else ControlMode.CURRENT)
        self.boards.expire_after(self._column, float("inf"))
        self._feed(0.0)
        return True

    def _switch_off(self) -> None:
        if self.boards.mode[self.axis] == ControlMode.HARDWARE_FAULT:
            self.boards.request_mode(self.axis, ControlMode.FORCE_IDLE)
        else:
            self.boards.enter(self.axis, ControlMode.IDLE)


# Requests ---------------------------------------------------------------------------------------------------------


def _set_control_mode(board: FocBoard, values: Values) -> bool:
    mode = int(number(values))
    return mode in _MODES and board.enter(BoardMode(mode))


def _get_control_mode(board: FocBoard, _values: Values) -> bool:
    board.send(m.FOC_CONTROL_MODE.value, board.mode)
    return True


def _version(board: FocBoard, values: Values) -> bool:
    board.answer_version(m.VERSION, values)
    major, minor = board.protocol
    board.agreed = major == values[0] and minor >= number(values, 1)
    if not board.agreed:
        board.faults |= FocFault.PROTOCOL_MISMATCH
    return True


def _set(setting: Setting) -> Callable[[FocBoard, Values], bool]:
    def handle(board: FocBoard, values: Values) -> bool:
        if not board.agreed:
            return False
        effect = _EFFECTS.get(setting.set.name)
        board.settings.write(setting, values)
        if effect is not None:
            effect(board, values)
        return True

    return handle


def _get(setting: Setting) -> Callable[[FocBoard, Values], bool]:
    def handle(board: FocBoard, values: Values) -> bool:
        board.send(setting.value, *board.settings.value(setting, values))
        return True

    return handle


def _configure(board: FocBoard, values: Values) -> None:
    board.warm = bool(int(number(values)) & MotorFlag.TEMPERATURE_SENSOR)
    if board.mode is BoardMode.NOT_CONFIGURED:
        board.mode = BoardMode.IDLE


def _limit_currents(board: FocBoard, _values: Values) -> None:
    nominal, peak, overload = (abs(board.settings.number(m.CURRENT_LIMITS, place)) * _MILLI for place in range(3))
    board.boards.nominal_current[board.axis] = nominal
    board.boards.peak_current[board.axis] = peak
    board.boards.set_max_current(board.axis, overload)


def _limit_current(board: FocBoard, values: Values) -> bool:
    if board.agreed:
        board.boards.peak_current[board.axis] = abs(number(values)) * _MILLI
    return board.agreed


def _demand_current(board: FocBoard, values: Values) -> None:
    if board.mode is BoardMode.CURRENT:
        board.demand(int(number(values)))


def _get_address(board: FocBoard, _values: Values) -> bool:
    board.send(m.BOARD_ID.value, board.address or 0)
    return True


def _set_address(board: FocBoard, values: Values) -> bool:
    return board.take_address(values)


def _set_hall(board: FocBoard, values: Values) -> bool:
    if board.agreed:
        board.hall = values
    return board.agreed


def _get_motor_parameter(board: FocBoard, values: Values) -> bool:
    if values == board.hall[:1]:
        board.send(m.HALL, *board.hall)
        return True
    return _get(m.MOTOR_PARAMETER)(board, values)


def _limit_temperature(board: FocBoard, values: Values) -> None:
    board.boards.temperature_limit[board.axis] = number(values)


def _set_velocity_gains(board: FocBoard, values: Values) -> None:
    kp, ki, _, shift = (number(values, place) for place in range(4))
    board.gains.kp, board.gains.ki = kp / 2.0**shift, ki / 2.0**shift


def _limit_velocity_control(board: FocBoard, values: Values) -> None:
    gains = board.gains
    gains.offset, gains.output_limit, gains.integral_limit = (number(values, place) for place in range(3))


def _set_parameter(board: FocBoard, values: Values) -> bool:
    """Set a parameter in floating point; between a lock and an unlock of its controller only."""
    controller, parameter, value = int(number(values)), int(number(values, 1)), number(values, 2)
    if not board.agreed:
        return False
    if parameter in (FocPidParameter.LOCK, FocPidParameter.UNLOCK):
        (board.locked.add if parameter == FocPidParameter.LOCK else board.locked.discard)(controller)
        return True
    if controller not in board.locked:
        return False
    board.settings.write(m.FOC_PID_PARAMETER, values)
    name = _OF_GAINS.get(parameter)
    if controller == FocPidType.VELOCITY and name is not None:
        setattr(board.gains, name, value)
    return True


_OF_GAINS: dict[int, str] = {
    FocPidParameter.KP: "kp",
    FocPidParameter.KI: "ki",
    FocPidParameter.INTEGRAL_LIMIT: "integral_limit",
    FocPidParameter.OUTPUT_LIMIT: "output_limit",
}
_MODES = frozenset(map(int, BoardMode))
_EFFECTS: dict[str, Callable[[FocBoard, Values], None]] = {
    m.MOTOR_CONFIGURATION.set.name: _configure,
    m.CURRENT_LIMITS.set.name: _limit_currents,
    m.TEMPERATURE_LIMIT.set.name: _limit_temperature,
    m.DESIRED_CURRENT.set.name: _demand_current,
    m.VELOCITY_PID.set.name: _set_velocity_gains,
    m.VELOCITY_PID_LIMITS.set.name: _limit_velocity_control,
}
#: By the name of the message; each returns whether the board has taken it.
DRIVE_HANDLERS: dict[str, Callable[[FocBoard, Values], bool]] = (
    {one.set.name: _set(one) for one in DRIVE_SETTINGS}
    | {one.get.name: _get(one) for one in DRIVE_SETTINGS}
    | {
        m.SET_CONTROL_MODE.name: _set_control_mode,
        m.FOC_CONTROL_MODE.get.name: _get_control_mode,
        m.VERSION.get.name: _version,
        m.FOC_PID_PARAMETER.set.name: _set_parameter,
        m.CURRENT_LIMIT.name: _limit_current,
        m.SET_HALL.name: _set_hall,
        m.MOTOR_PARAMETER.get.name: _get_motor_parameter,
        m.BOARD_ID.set.name: _set_address,
        m.BOARD_ID.get.name: _get_address,
    }
)
