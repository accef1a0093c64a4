"""An axis on a bus, as the driver has it: what its board has said, and what is to be sent to it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from rtf.robot.control_modes import ControlMode
from rtf.robot.devices.can.codes import BoardMode
from rtf.robot.devices.can.messages import Setting
from rtf.robot.devices.can.motor_messages import SET_CONTROL_MODE

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from enum import IntFlag

    from rtf.robot.devices.board_driver import DrivenBoard
    from rtf.robot.devices.can.axis_scale import AxisScale
    from rtf.robot.devices.can.axis_settings import CanAxis
    from rtf.robot.devices.can.messages import Dialect, Frame, Message, Question
    from rtf.robot.extended_state import Field

    #: A command, or a setting that can be read back, with its values.
    Sent = tuple[Message | Setting, tuple[int, ...]]

#: Seconds in which the status says that a board has taken a mode: it does within 0.1 s; the rest is for a busy host.
MODE_PATIENCE = 0.5
NEVER = float("-inf")


@dataclass(slots=True)
class Feedback:
    """The latest measurements of an axis, in the robot's units, and when its position arrived (s)."""

    stamp: float = NEVER
    position: float = 0.0
    velocity: float = 0.0
    acceleration: float = 0.0
    motor_position: float = 0.0
    motor_velocity: float = 0.0
    motor_acceleration: float = 0.0  # which no board measures
    current: float = 0.0
    duty: float = 0.0
    torque: float = 0.0
    temperature: float = 0.0
    mode: int = BoardMode.UNKNOWN
    faults: int = 0
    warnings: tuple[str, ...] = ()
    errors: tuple[int, int] = (0, 0)  # of transmission and of reception, as the board counts them


class AxisLink(ABC):
    """An axis on a bus. ``take`` is called by the thread of the bus, all else with the lock of the motor board held."""

    dialect: ClassVar[Dialect]
    #: The names of the bits of faults.
    faults: ClassVar[type[IntFlag]]
    #: What is measured, if the board is configured for it.
    measures: ClassVar[frozenset[Field]]
    #: The modes of the robot, and those of the board.
    modes: ClassVar[dict[ControlMode, BoardMode]]

    #: What keeps the values of a periodic message and their time (s).
    kept: ClassVar[dict[Message, Callable[[Any, tuple[Any, ...], float], None]]]  # Any: a link, numbers of the message

    #: The question for the mode of an axis.
    mode_question: ClassVar[Question]

    def __init__(self, settings: CanAxis, scale: AxisScale) -> None:
        self.board, self.index = settings.board, settings.index
        self.settings = settings
        self.scale = scale
        self.feedback = Feedback()
        self.verified = False  # its settings were read back once; that waits for answers, which no later cycle may
        self.wanted = BoardMode.UNKNOWN
        self.settles = NEVER  # until when the board may still be in another mode than the wanted one, s
        self.mode: ControlMode | None = None
        self._sent: dict[bytes, Frame] = {}

    def measured(self) -> frozenset[Field]:
        """Return what is measured of this axis, as it is configured."""
        return self.measures

    def supported(self) -> frozenset[ControlMode]:
        """Return the modes of the robot that this axis has, as it is configured."""
        return frozenset(self.modes)

    # To the board --------------------------------------------------------------------------------------------------

    @abstractmethod
    def all_settings(self, board: DrivenBoard, axis: int) -> Iterator[Sent]:
        """Yield the settings of an axis, in the order in which they are sent."""

    def changed_settings(self, board: DrivenBoard, axis: int) -> list[tuple[Message | Setting, tuple[int, ...], Frame]]:
        """Return the settings that differ from what was sent, each with its frame. They count as sent from now on."""
        changed = []
        for what, values in self.all_settings(board, axis):
            message = what.set if isinstance(what, Setting) else what
            frame = message.frame(self.board, *values, axis=self.index)
            if self._sent.get(frame.data[:1]) != frame:
                self._sent[frame.data[:1]] = frame
                changed.append((what, values, frame))
        return changed

    def forget(self) -> None:
        """Send all settings again next time, as the board was reset."""
        self._sent.clear()
        self.mode = None

    def request(self, mode: ControlMode, now: float) -> list[Frame]:
        """Return the commands for a mode of the robot, which the board takes within ``MODE_PATIENCE`` s."""
        self.mode = mode
        self.wanted = self.modes.get(mode, BoardMode.IDLE)
        self.settles = now + MODE_PATIENCE
        command = BoardMode.FORCE_IDLE if mode is ControlMode.IDLE else self.wanted  # which also ends a fault
        return [SET_CONTROL_MODE.frame(self.board, command, axis=self.index)]

    # From the board ------------------------------------------------------------------------------------------------

    def fault_names(self) -> str:
        """Return the faults that the board reports, in words."""
        names = [str(one.name).lower().replace("_", " ") for one in self.faults(self.feedback.faults)]
        return ", ".join(names) or "no cause"

    @property
    def first_fault(self) -> int:
        """The number of the lowest bit of the faults; 0 if there is none."""
        return max((self.feedback.faults & -self.feedback.faults).bit_length() - 1, 0)
