"""A board that controls two joints: its state, and the schedule of its broadcasts.

The control of the motors, trajectories and limits are those of :class:`rtf.simulator.boards.Boards`, at 1 kHz; a board
is a view of two of its axes through a bus. What it does with messages is in :mod:`joint_messages`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.control_modes import InteractionMode
from rtf.robot.devices.can import motor_messages as m
from rtf.robot.devices.can.codes import BoardType
from rtf.simulator.firmware.joint_messages import HANDLERS
from rtf.simulator.firmware.joint_state import AXES, JointBoardState
from rtf.simulator.firmware.readings import short

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.devices.can.codec import Decoded
    from rtf.robot.devices.can.messages import Message
    from rtf.simulator.boards import Boards
    from rtf.simulator.firmware.readings import Readings
    from rtf.simulator.firmware.wire import Wire

#: Milliseconds between two statuses at most.
STATUS_PERIOD = 5000
#: Milliseconds of the schedule of a board of two axes, and of one of four, which answers as two boards.
CYCLE, CYCLE_OF_FOUR = 4, 5


def _bit(message: Message) -> int:
    return 1 << message.code - 1


class JointBoard(JointBoardState):
    """A board on a wire, from the construction on; ``step`` is called every millisecond."""

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
        super().__init__(wire, address, boards, axes, readings, board_type=board_type)
        #: What is sent in the milliseconds of a cycle, if the host has asked for it.
        self._phases = (
            (_POSITION, self._send_positions),
            (_PID, self._send_outputs),
            (_STATUS, self._send_status),
            (_OTHERS, self._send_others),
        )
        self._cycle = CYCLE_OF_FOUR if board_type is BoardType.MC_4DC else CYCLE

    def reset(self) -> None:
        super().reset()
        self._status: tuple[int, ...] = ()
        self._status_at = 0

    # Messages --------------------------------------------------------------------------------------------------------

    def handle(self, got: Decoded) -> bool:
        handler = HANDLERS.get(got.message.name)
        if handler is None or got.axis >= len(self.axes):
            return False
        handler(self, got.axis, got.values)
        return True

    # Broadcasts ------------------------------------------------------------------------------------------------------

    def step(self, tick: int) -> None:
        """Send what is due in this millisecond."""
        if self.silent:
            return
        phase = tick % self._cycle
        if phase < len(self._phases):
            mask, send = self._phases[phase]
            if self.mask & mask:
                send(tick)

    def _send_positions(self, _tick: int) -> None:
        self._pair(m.BROADCAST_POSITION, self.readings.positions())

    def _send_outputs(self, _tick: int) -> None:
        self._pair(m.BROADCAST_PID, self.readings.outputs(), self.readings.duties())

    def _send_others(self, _tick: int) -> None:
        """Send the broadcasts of the last phase."""
        mask, readings = self.mask, self.readings
        shifts = self.parameters[0].estimator_shifts
        if mask & _CURRENT:
            self._pair(m.BROADCAST_CURRENT, readings.currents())
        if mask & _VELOCITY:
            self._pair(m.BROADCAST_VELOCITY, readings.speeds(shifts[0]), readings.accelerations(shifts[0] + shifts[1]))
        if mask & _ERROR:
            self._send_errors()
        if mask & _MOTOR_POSITION:
            self._pair(m.MOTOR_POSITION, readings.motor_positions())
        if mask & _MOTOR_SPEED:
            self._pair(m.MOTOR_SPEED, readings.motor_speeds(shifts[2]), readings.zeros)

    def _send_errors(self) -> None:
        """Send the errors of positions, and desired minus measured torques."""
        measured, positions = self.readings.torques(), self.readings.errors()
        torques = [
            short(own.desired_torque - measured[axis]) for own, axis in zip(self.parameters, self.axes, strict=True)
        ]
        self.send(m.BROADCAST_ERROR, *(positions[axis] for axis in self.columns), *[*torques, 0][:AXES])

    def _pair(self, message: Message, first: Sequence[int], second: Sequence[int] | None = None) -> None:
        """Send the values of both axes of one quantity, or of two."""
        one, other = self.columns
        if second is None:
            self.send(message, first[one], first[other])
        else:
            self.send(message, first[one], first[other], second[one], second[other])

    def _send_status(self, tick: int) -> None:
        """Send the status, with the additional one, if it has changed or is due."""
        status = self.status()
        if status == self._status and tick - self._status_at < STATUS_PERIOD:
            return
        self._status, self._status_at = status, tick
        self.send(m.STATUS, *status)
        if self.mask & _ADDITIONAL:
            compliant = [self.boards.interaction[axis] == InteractionMode.COMPLIANT for axis in self.axes]
            self.send(m.ADDITIONAL_STATUS, sum(bool(one) << 4 * place for place, one in enumerate(compliant)))


_POSITION, _PID, _STATUS = _bit(m.BROADCAST_POSITION), _bit(m.BROADCAST_PID), _bit(m.STATUS)
_CURRENT, _VELOCITY, _ERROR = _bit(m.BROADCAST_CURRENT), _bit(m.BROADCAST_VELOCITY), _bit(m.BROADCAST_ERROR)
_MOTOR_POSITION, _MOTOR_SPEED = _bit(m.MOTOR_POSITION), _bit(m.MOTOR_SPEED)
_ADDITIONAL = _bit(m.ADDITIONAL_STATUS)
_OTHERS = _CURRENT | _VELOCITY | _ERROR | _MOTOR_POSITION | _MOTOR_SPEED
