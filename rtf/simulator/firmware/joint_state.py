"""The state of a board that controls two joints: its commands, what it measures, and its connection to the bus."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.control_modes import ControlMode
from rtf.robot.devices.can import motor_messages as m
from rtf.robot.devices.can.codes import BoardMode, BoardState, BoardType, CanState, JointFault
from rtf.robot.devices.motor_board import ERROR_LIMIT, OVERCURRENT, OVERHEATED
from rtf.simulator.firmware.board import Board
from rtf.simulator.firmware.parameters import ESTIMATOR_SHIFT, AxisParameters, feedforward_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.simulator.boards import Boards
    from rtf.simulator.firmware.readings import Readings
    from rtf.simulator.firmware.wire import Wire

#: The axes of a board.
AXES = 2
_FAULTS = {OVERCURRENT: JointFault.OVERCURRENT, OVERHEATED: JointFault(0), ERROR_LIMIT: JointFault.OVERLOAD}
_HOT = (int(BoardState.TEMPERATURE_1), int(BoardState.TEMPERATURE_2))
#: As numbers: members of enumerations are slow to look up.
_IN_FAULT, _OVERFLOW = int(BoardMode.HARDWARE_FAULT), int(CanState.TX_OVERFLOW)
_MOST = 255


class JointBoardState(Board):
    """The state of a board at ``address`` with one or two ``axes`` of the robot, numbers of columns in ``boards``.

    ``flash`` is what is left after a reset.
    """

    def __init__(
        self,
        wire: Wire,
        address: int,
        boards: Boards,
        axes: Sequence[int],
        readings: Readings,
        *,
        board_type: BoardType = BoardType.BLL,
    ) -> None:
        super().__init__(wire, address, board_type)
        self.boards, self.axes, self.readings = boards, tuple(axes), readings
        first, second = self.columns = (*self.axes, readings.none)[:AXES]  # of the readings
        self.place = readings.add(first, second)
        self.flash: tuple[dict[str, tuple[float | bytes, ...]], ...] = tuple(
            {m.MODEL_PARAMETERS.set.name: feedforward_of(boards.pids[axis], float(boards.resolution[axis]))}
            for axis in axes
        )
        self.reset()

    def reset(self) -> None:
        """Start as after power-up: the motors off, the settings those in flash, nothing broadcast."""
        self.mask = 0
        self.silent = False
        self.information = [bytes(4)] * 8
        self.parameters = tuple(AxisParameters(float(self.boards.resolution[axis])) for axis in self.axes)
        for parameters, written in zip(self.parameters, self.flash, strict=True):
            parameters.written = dict(written)
        for axis in self.axes:
            self.readings.set_shifts(axis, [ESTIMATOR_SHIFT] * 4)
            self.readings.set_desired_torque(axis, 0.0)
            if self.boards.mode[axis] != ControlMode.HARDWARE_FAULT:
                self.boards.enter(axis, ControlMode.IDLE)

    def stop(self) -> None:
        self.mask = 0
        for axis in self.axes:
            self.boards.request_mode(axis, ControlMode.IDLE)

    def status(self) -> tuple[int, ...]:
        """Return faults and modes of both axes, the states of CAN and of the board, and the counts of errors."""
        values: list[int] = []
        state = 0
        modes = self.readings.modes()
        for place, axis in enumerate(self.columns):
            faults, mode = 0, modes[axis]
            if mode == _IN_FAULT:
                number = self.boards.faults[axis][0]
                faults = int(_FAULTS.get(number, JointFault.EXTERNAL))
                state |= _HOT[place] if number == OVERHEATED else 0
            values += [faults, mode]
        connection = self.connection
        overflow = _OVERFLOW if connection.lost else 0
        errors = min(connection.sender_errors, _MOST), min(connection.receiver_errors, _MOST)
        return (*values, overflow, state, *errors)

    def mode(self, place: int) -> int:
        """Return the control mode of an axis of the board, a :class:`BoardMode`."""
        return self.readings.mode(self.axes[place])
