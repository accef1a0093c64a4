"""A board that controls two joints: its state, and the schedule of its broadcasts.

The control of the motors, trajectories and limits are those of :class:`rtf.simulator.boards.Boards`, at 1 kHz; a board
is a view of two of its axes through a bus. What it does with messages is in :mod:`joint_messages`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.control_modes import InteractionMode
from rtf.robot.devices.can import motor_messages as m
from rtf.robot.devices.can.codes import BoardType
from rtf.robot.devices.can.messages import MessageClass, make_frame
from rtf.simulator.firmware.joint_messages import HANDLERS
from rtf.simulator.firmware.joint_state import JointBoardState

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
        self._cycle = CYCLE_OF_FOUR if board_type is BoardType.MC_4DC else CYCLE
        super().__init__(wire, address, boards, axes, readings, board_type=board_type)

    def reset(self) -> None:
        super().reset()
        self._status: tuple[int, ...] = ()
        self._status_at = 0

    @property
    def mask(self) -> int:
        """The broadcasts that the host has asked for."""
        return self._mask

    @mask.setter
    def mask(self, mask: int) -> None:
        self._mask = mask
        #: The types of broadcasts in each millisecond of a cycle.
        self._due = [[one.code for one in phase if mask & 1 << one.code - 1] for phase in _PHASES]
        self._due += [[]] * (self._cycle - len(_PHASES))

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
        due = self._due[tick % self._cycle]
        if not due or self.silent:
            return
        for code in due:
            if code == _STATUS:
                self._send_status(tick)
            elif self.address is not None:
                data = self.readings.broadcast(code, self.place)
                self.connection.send(make_frame((_BROADCAST | self.address << 4 | code, data)))

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


_BROADCAST = MessageClass.MOTOR_PERIODIC << 8
_STATUS = m.STATUS.code
_ADDITIONAL = 1 << m.ADDITIONAL_STATUS.code - 1
#: What is sent in the milliseconds of a cycle, if the host has asked for it; the status if it has changed, or is due.
_PHASES: tuple[tuple[Message, ...], ...] = (
    (m.BROADCAST_POSITION,),
    (m.BROADCAST_PID,),
    (m.STATUS,),
    (m.BROADCAST_CURRENT, m.BROADCAST_VELOCITY, m.BROADCAST_ERROR, m.MOTOR_POSITION, m.MOTOR_SPEED),
)
