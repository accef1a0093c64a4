"""What the boards of all buses measure and broadcast, computed once a step for all of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

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

    #: Computes the numbers of all axes.
    _Row = Callable[["Readings"], FloatArray]

#: mA an ampere, and ms a second.
_THOUSAND = 1e3
_TURN = 360.0
_PER_CENT = FULL_OUTPUT / 100.0
_I16, _I32 = 1 << 15, 1 << 31
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
_UNKNOWN, _IDLE = int(BoardMode.UNKNOWN), int(BoardMode.IDLE)


def short(number: float) -> int:
    """Return a number rounded, and saturated at 16 bits with a sign."""
    return max(-_I16, min(_I16 - 1, round(number)))


class Readings:
    """The measurements of all axes, in the order of the axes, with a zero at the end, in the column ``none``.

    Each row of numbers, and the data of each broadcast, is computed when it is first asked for in a step. Numbers are
    rounded, and saturated, never wrapped. Positions are in ticks; speeds in ticks/ms and accelerations in ticks/ms²,
    times two to the power of the shifts of their axis.
    """

    def __init__(self, boards: Boards) -> None:
        self.none = boards.count
        self._boards = boards
        self._columns = np.zeros((0, 2), np.intp)  # of both axes of each board
        self._shifts = np.zeros((4, boards.count + 1), np.int32)
        self._desired_torques = np.zeros(boards.count + 1)
        self._tick = -1
        self._rows: dict[_Row, FloatArray] = {}
        self._data: dict[int, list[bytes]] = {}  # of all boards, by the type of the broadcast
        self._modes: list[int] = []

    def add(self, first: int, second: int) -> int:
        """Return the place of a board with these columns in what is broadcast."""
        self._columns = np.concatenate([self._columns, [[first, second]]])
        return len(self._columns) - 1

    def set_shifts(self, axis: int, shifts: list[int]) -> None:
        """Set the shifts of the speed and the acceleration of a joint, and those of its motor."""
        self._shifts[:, axis] = shifts

    def set_desired_torque(self, axis: int, torque: float) -> None:
        """Set the torque (counts) from which the broadcast errors of the torque are measured."""
        self._desired_torques[axis] = torque

    # What is broadcast -----------------------------------------------------------------------------------------------

    def broadcast(self, code: int, place: int) -> bytes:
        """Return the data of a broadcast of the board in a place."""
        self._follow()
        data = self._data.get(code)
        if data is None:
            data = self._data[code] = self._pack(*self.BROADCASTS[code])
        return data[place]

    def _pack(self, message: Message, rows: tuple[_Row, ...]) -> list[bytes]:
        """Return the data of all boards: of each row the numbers of both axes, and zeros."""
        kind = np.dtype(f"<{message.layout[0].layout}")
        table = np.zeros((len(self._columns), MAX_DATA // kind.itemsize), kind)
        for place, row in enumerate(rows):
            table[:, 2 * place : 2 * place + 2] = self._row(row)[self._columns]
        data = table.tobytes()
        return [data[begin : begin + MAX_DATA] for begin in range(0, len(data), MAX_DATA)]

    # Numbers of one axis ---------------------------------------------------------------------------------------------

    def position(self, axis: int) -> int:
        """Return the position of a joint."""
        return self._one(Readings._positions, axis)

    def speed(self, axis: int) -> int:
        """Return the speed of a joint."""
        return self._one(Readings._speeds, axis)

    def error(self, axis: int) -> int:
        """Return the error of a position."""
        return self._one(Readings._errors, axis)

    def output(self, axis: int) -> int:
        """Return the output of a controller."""
        return self._one(Readings._outputs, axis)

    def modes(self) -> list[int]:
        """Return the control modes that the boards show."""
        self._follow()
        if not self._modes:
            shown = self._boards.shown_modes()[0].tolist()
            self._modes = [*(_SHOWN.get(mode, _UNKNOWN) for mode in shown), _IDLE]
        return self._modes

    # Rows ------------------------------------------------------------------------------------------------------------

    def _follow(self) -> None:
        """Forget what was measured in an earlier step."""
        if self._tick != self._boards.tick:
            self._tick = self._boards.tick
            self._rows.clear()
            self._data.clear()
            self._modes = []

    def _one(self, row: _Row, axis: int) -> int:
        self._follow()
        return int(self._row(row)[axis])

    def _row(self, row: _Row) -> FloatArray:
        known = self._rows.get(row)
        if known is None:
            known = self._rows[row] = row(self)
        return known

    def _numbers(self, values: FloatArray, size: int = _I16, shift: NDArray[np.int32] | None = None) -> FloatArray:
        """Return numbers rounded and saturated, with a zero at the end."""
        numbers = np.zeros(self.none + 1)
        numbers[:-1] = values if shift is None else np.ldexp(values, shift[:-1])
        np.rint(numbers, out=numbers)
        np.maximum(numbers, -size, out=numbers)
        np.minimum(numbers, size - 1, out=numbers)
        return numbers

    def _positions(self) -> FloatArray:
        return self._numbers(self._boards.position * self._boards.resolution, _I32)

    def _speeds(self) -> FloatArray:
        speeds = self._boards.velocity * self._boards.resolution / _THOUSAND
        return self._numbers(speeds, shift=self._shifts[0])

    def _accelerations(self) -> FloatArray:
        accelerations = self._boards.accelerations_now() * self._boards.resolution / _THOUSAND**2
        return self._numbers(accelerations, shift=self._shifts[0] + self._shifts[1])

    def _motor_positions(self) -> FloatArray:
        return self._numbers(self._of_motors(Field.MOTOR_POSITIONS), _I32)

    def _motor_speeds(self) -> FloatArray:
        return self._numbers(self._of_motors(Field.MOTOR_VELOCITIES) / _THOUSAND, shift=self._shifts[2])

    def _currents(self) -> FloatArray:
        return self._numbers(self._boards.motor_currents() * _THOUSAND)  # mA

    def _outputs(self) -> FloatArray:
        return self._numbers(self._boards.output * _PER_CENT)

    def _duties(self) -> FloatArray:
        return self._numbers(self._boards.motor_duties() * _PER_CENT)

    def _errors(self) -> FloatArray:
        return self._numbers(self._boards.controller_errors() * self._boards.resolution)

    def _torque_errors(self) -> FloatArray:
        """Desired minus measured torques, by the sensors."""
        measured = self._numbers(self._boards.measured_torques() * TORQUE_COUNTS, _I32)
        return self._numbers((self._desired_torques - measured)[:-1])

    def _of_motors(self, field: Field) -> FloatArray:
        found: FloatArray = self._boards.measured(field) * self._boards.rotor_resolution / _TURN
        return found

    #: The broadcasts by type, and the rows that they are made of.
    BROADCASTS: ClassVar[dict[int, tuple[Message, tuple[_Row, ...]]]] = {
        message.code: (message, rows)
        for message, rows in (
            (m.BROADCAST_POSITION, (_positions,)),
            (m.BROADCAST_PID, (_outputs, _duties)),
            (m.BROADCAST_CURRENT, (_currents,)),
            (m.BROADCAST_VELOCITY, (_speeds, _accelerations)),
            (m.BROADCAST_ERROR, (_errors, _torque_errors)),
            (m.MOTOR_POSITION, (_motor_positions,)),
            (m.MOTOR_SPEED, (_motor_speeds,)),
        )
    }
