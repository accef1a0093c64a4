"""What the boards of all buses measure and broadcast, computed once a step for all of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import ControlMode
from rtf.robot.devices.can import motor_messages as m
from rtf.robot.devices.can.codes import BoardMode
from rtf.robot.devices.can.messages import MAX_DATA
from rtf.robot.extended_state import Field
from rtf.simulator.firmware.parameters import FULL_OUTPUT, TORQUE_COUNTS

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rtf.robot.devices.can.messages import Message
    from rtf.robot.interfaces import FloatArray
    from rtf.simulator.boards import Boards

    #: Broadcasts, each with what computes its rows.
    _Group = tuple[tuple[Message, tuple[Callable[["Readings"], FloatArray], ...]], ...]

#: mA an ampere, and ms a second.
_THOUSAND = 1e3
_TURN = 360.0
_PER_CENT = FULL_OUTPUT / 100.0
_I16 = 1 << 15
#: The modes of boards, and those of the robot.
MODES = {
    BoardMode.IDLE: ControlMode.IDLE,
    BoardMode.FORCE_IDLE: ControlMode.FORCE_IDLE,
    BoardMode.POSITION: ControlMode.POSITION,
    BoardMode.VELOCITY: ControlMode.VELOCITY,
    BoardMode.TORQUE: ControlMode.TORQUE,
    BoardMode.IMPEDANCE_POSITION: ControlMode.IMPEDANCE_POSITION,
    BoardMode.IMPEDANCE_VELOCITY: ControlMode.IMPEDANCE_VELOCITY,
    BoardMode.CURRENT: ControlMode.CURRENT,
    BoardMode.MIXED: ControlMode.MIXED,
    BoardMode.DIRECT: ControlMode.POSITION_DIRECT,
    BoardMode.OPEN_LOOP: ControlMode.PWM,
    BoardMode.CALIBRATING: ControlMode.CALIBRATING,
    BoardMode.HARDWARE_FAULT: ControlMode.HARDWARE_FAULT,
    BoardMode.NOT_CONFIGURED: ControlMode.NOT_CONFIGURED,
    BoardMode.CONFIGURED: ControlMode.CONFIGURED,
}
_SHOWN = {int(mode): int(board) for board, mode in MODES.items()} | {
    int(ControlMode.CALIBRATION_DONE): int(BoardMode.CALIBRATING)
}
#: The numbers of 16 and 32 bits in messages.
_SHORT, _LONG = np.dtype("<i2"), np.dtype("<i4")
_UNKNOWN, _IDLE = int(BoardMode.UNKNOWN), int(BoardMode.IDLE)


def short(number: float) -> int:
    """Return a number rounded, and saturated at 16 bits with a sign."""
    return max(-_I16, min(_I16 - 1, round(number)))


class Readings:
    """The measurements of all axes, and the broadcasts that boards make of them, computed once a step.

    Numbers are rounded and saturated, never wrapped. Positions are in ticks; speeds in ticks/ms and accelerations in
    ticks/ms², times two to the power of the shifts of their axis. The column ``none``, after those of the axes, is 0.
    """

    def __init__(self, boards: Boards) -> None:
        self.none = boards.count
        self._boards = boards
        self._columns: list[tuple[int, int]] = []  # of both axes of each board
        self._indices: dict[int, NDArray[np.intp]] = {}
        self._shifts = np.zeros((4, boards.count), np.int32)
        self._desired_torques = np.zeros(boards.count)
        self._tick = -1
        self._data: dict[int, bytes] = {}  # of the groups
        self._modes: list[int] = []

    def add(self, first: int, second: int) -> int:
        """Return the place of a board with these columns in what is broadcast."""
        self._columns.append((first, second))
        self._indices.clear()
        return len(self._columns) - 1

    def set_shifts(self, axis: int, shifts: list[int]) -> None:
        """Set the shifts of the speed and the acceleration of a joint, and those of its motor."""
        self._shifts[:, axis] = shifts

    def set_desired_torque(self, axis: int, torque: float) -> None:
        """Set the torque (counts) from which the broadcast errors of the torque are measured."""
        self._desired_torques[axis] = torque

    # What is broadcast -----------------------------------------------------------------------------------------------

    def broadcast(self, code: int, place: int) -> bytes:
        """Return the data of a broadcast, by its type, of the board in a place."""
        if self._tick != self._boards.tick:
            self._forget()
        group, number = _PLACES[code]
        data = self._data.get(group)
        if data is None:
            data = self._data[group] = self._pack(group)
        begin = MAX_DATA * (number * len(self._columns) + place)
        return data[begin : begin + MAX_DATA]

    def _pack(self, number: int) -> bytes:
        """Return the data of a group of broadcasts of all boards, one broadcast after the other."""
        group = _GROUPS[number]
        rows = [row(self) for _, rows in group for row in rows]
        kind = np.dtype(f"<{group[0][0].layout[0].layout}")
        numbers = np.zeros((len(rows), self.none + 1))
        numbers[:, :-1] = rows
        index = self._indices.get(number)
        if index is None:
            index = self._indices[number] = self._index(group, MAX_DATA // kind.itemsize)
        return _saturated(numbers, kind).ravel()[index].tobytes()

    def _index(self, group: _Group, width: int) -> NDArray[np.intp]:
        """Return where the numbers of a group are in its rows: of each row those of both axes, and zeros."""
        columns = np.array(self._columns)
        first, tables = 0, []
        for _, rows in group:
            table = np.full((len(columns), width), self.none)
            for place in range(len(rows)):
                table[:, 2 * place : 2 * place + 2] = columns + (first + place) * (self.none + 1)
            tables.append(table)
            first += len(rows)
        return np.array(tables)

    # Numbers of one axis ---------------------------------------------------------------------------------------------

    def position(self, axis: int) -> int:
        """Return the position of a joint."""
        return int(_saturated(self.positions(), _LONG)[axis])

    def speed(self, axis: int) -> int:
        """Return the speed of a joint."""
        return int(_saturated(self.speeds(), _SHORT)[axis])

    def error(self, axis: int) -> int:
        """Return the error of a position."""
        return int(_saturated(self.errors(), _SHORT)[axis])

    def output(self, axis: int) -> int:
        """Return the output of a controller."""
        return int(_saturated(self.outputs(), _SHORT)[axis])

    def mode(self, axis: int) -> int:
        """Return the control mode that a board shows."""
        return _SHOWN.get(int(self._boards.shown_modes()[0, axis]), _UNKNOWN)

    def modes(self) -> list[int]:
        """Return the control modes that the boards show at the begin of a step."""
        if self._tick != self._boards.tick:
            self._forget()
        if not self._modes:
            shown = self._boards.shown_modes()[0].tolist()
            self._modes = [*(_SHOWN.get(mode, _UNKNOWN) for mode in shown), _IDLE]
        return self._modes

    def _forget(self) -> None:
        """Forget what was measured in an earlier step."""
        self._tick = self._boards.tick
        self._data.clear()
        self._modes = []

    # Rows: the numbers of all axes, neither rounded nor saturated ----------------------------------------------------

    def positions(self) -> FloatArray:
        """Return the positions of the joints."""
        found: FloatArray = self._boards.position * self._boards.resolution
        return found

    def speeds(self) -> FloatArray:
        """Return the speeds of the joints."""
        found: FloatArray = np.ldexp(self._boards.velocity * self._boards.resolution / _THOUSAND, self._shifts[0])
        return found

    def accelerations(self) -> FloatArray:
        """Return the accelerations of the joints."""
        accelerations = self._boards.accelerations_now() * self._boards.resolution / _THOUSAND**2
        found: FloatArray = np.ldexp(accelerations, self._shifts[0] + self._shifts[1])
        return found

    def motor_positions(self) -> FloatArray:
        """Return the positions of the rotors, in ticks of their encoders."""
        return self._of_motors(Field.MOTOR_POSITIONS)

    def motor_speeds(self) -> FloatArray:
        """Return the speeds of the rotors."""
        found: FloatArray = np.ldexp(self._of_motors(Field.MOTOR_VELOCITIES) / _THOUSAND, self._shifts[2])
        return found

    def currents(self) -> FloatArray:
        """Return the currents of the motors (mA)."""
        return self._boards.motor_currents() * _THOUSAND

    def outputs(self) -> FloatArray:
        """Return the outputs of the controllers."""
        return self._boards.output * _PER_CENT

    def duties(self) -> FloatArray:
        """Return the duty cycles of the motors."""
        return self._boards.motor_duties() * _PER_CENT

    def errors(self) -> FloatArray:
        """Return the errors of the positions."""
        return self._boards.controller_errors() * self._boards.resolution

    def torque_errors(self) -> FloatArray:
        """Return desired minus measured torques, by the sensors, which are whole numbers."""
        return self._desired_torques - np.rint(self._boards.measured_torques() * TORQUE_COUNTS)

    def _of_motors(self, field: Field) -> FloatArray:
        found: FloatArray = self._boards.measured(field) * self._boards.rotor_resolution / _TURN
        return found


def _saturated(numbers: FloatArray, kind: np.dtype[np.signedinteger]) -> NDArray[np.signedinteger]:
    """Return numbers as integers, rounded and saturated."""
    limits = np.iinfo(kind)
    rounded = np.rint(numbers)
    np.maximum(rounded, limits.min, out=rounded)
    np.minimum(rounded, limits.max, out=rounded)
    return rounded.astype(kind)


#: The broadcasts with the rows that they have of both axes. Those of a group are sent, and packed, at once.
_GROUPS: tuple[_Group, ...] = (
    ((m.BROADCAST_POSITION, (Readings.positions,)),),
    ((m.BROADCAST_PID, (Readings.outputs, Readings.duties)),),
    (
        (m.BROADCAST_CURRENT, (Readings.currents,)),
        (m.BROADCAST_VELOCITY, (Readings.speeds, Readings.accelerations)),
        (m.BROADCAST_ERROR, (Readings.errors, Readings.torque_errors)),
    ),
    ((m.MOTOR_POSITION, (Readings.motor_positions,)),),
    ((m.MOTOR_SPEED, (Readings.motor_speeds,)),),
)
#: The group of a broadcast and its number there, by its type.
_PLACES = {
    message.code: (number, place) for number, group in enumerate(_GROUPS) for place, (message, _) in enumerate(group)
}
