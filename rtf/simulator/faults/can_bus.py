"""Faults of CAN buses, and of the boards on them. The robot must have buses: ``rtf simulator --can``."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from rtf.robot.devices.can import motor_messages as m
from rtf.robot.devices.can.codec import decode
from rtf.robot.devices.can.messages import Frame, MessageClass
from rtf.robot.errors import RefusedError
from rtf.simulator.faults.base import Fault, Layer, Parameter, Target
from rtf.simulator.firmware.foc_board import DRIVE_HANDLERS, WATCHDOG, FocBoard
from rtf.simulator.firmware.joint_messages import HANDLERS
from rtf.simulator.plant import TIMESTEP

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.robot.devices.can.messages import Message
    from rtf.simulator.firmware.boards_on_buses import Firmware
    from rtf.simulator.firmware.joint_board import JointBoard
    from rtf.simulator.firmware.wire import Connection, Wire

_SHARE = Parameter("share", 0.2, "", "of the frames", 0.0, 1.0)
_PERIODIC = MessageClass.MOTOR_PERIODIC


class _BusFault(Fault):
    """A fault of one bus."""

    layer = Layer.BUS
    target_kind = Target.BUS
    wire: Wire

    def aim(self) -> None:
        wires = _firmware(self).wires
        if self.target not in wires:
            raise RefusedError(f"{self.kind}: the robot has no bus {self.target!r}; its buses are {', '.join(wires)}")
        self.wire = wires[self.target]

    def chance(self, share: float) -> bool:
        """Return true for a share of the calls, at random."""
        return float(self.simulation.random.random()) < share


def _firmware(fault: Fault) -> Firmware:
    firmware = fault.robot.firmware
    if firmware is None:
        raise RefusedError(f"{fault.kind}: the boards of this robot are on no bus; start it with --can")
    return firmware


class _FramesFault(_BusFault):
    """A fault that changes what is delivered in place of a frame."""

    def begin(self) -> None:
        self.wire.filters.append(self.replace)

    def end(self) -> None:
        self.wire.filters.remove(self.replace)

    def replace(self, frame: Frame, now: float) -> Iterator[Frame]:
        """Yield what is delivered."""
        raise NotImplementedError


class FramesLost(_FramesFault):
    """Random loss of frames."""

    kind = "can_frames_lost"
    description = "Frames are lost: a receiver is too slow, or its filters are wrong."
    symptom = "Positions come less often, and commands are ignored at times."
    parameters = (_SHARE,)
    share: float

    def replace(self, frame: Frame, now: float) -> Iterator[Frame]:
        del now
        if not self.chance(self.share):
            yield frame


class FramesDuplicated(_FramesFault):
    """Frames that come twice."""

    kind = "can_frames_duplicated"
    description = "Frames come twice: a node that does not see the acknowledgement sends them again."
    symptom = "More frames of each kind arrive than are sent."
    parameters = (_SHARE,)
    share: float

    def replace(self, frame: Frame, now: float) -> Iterator[Frame]:
        del now
        yield frame
        if self.chance(self.share):
            yield frame


class FramesReordered(_FramesFault):
    """Frames that are overtaken by the next one with their identifier."""

    kind = "can_frames_reordered"
    description = "A frame is overtaken by the next one of its kind: a gateway, or a driver with several queues."
    symptom = "Positions jump back and forth while a joint moves."
    parameters = (_SHARE,)
    share: float

    def begin(self) -> None:
        self._kept: dict[int, Frame] = {}
        super().begin()

    def replace(self, frame: Frame, now: float) -> Iterator[Frame]:
        del now
        kept = self._kept.pop(frame.identifier, None)
        if kept is None and frame.identifier >> 8 == _PERIODIC and self.chance(self.share):
            self._kept[frame.identifier] = frame
            return
        yield frame
        if kept is not None:
            yield kept


class IdentifierDamaged(_FramesFault):
    """Frames with a wrong bit in their identifier."""

    kind = "can_identifier_damaged"
    description = "A bit of an identifier is wrong, with a checksum that fits: a node with faulty memory."
    symptom = "Frames of boards or types that do not exist arrive, and others are missing."
    parameters = (_SHARE,)
    share: float

    def replace(self, frame: Frame, now: float) -> Iterator[Frame]:
        del now
        if self.chance(self.share):
            frame = frame._replace(identifier=frame.identifier ^ 1 << int(self.simulation.random.integers(11)))
        yield frame


class FramesDelayed(_FramesFault):
    """A constant delay of all frames."""

    kind = "can_frames_delayed"
    description = "Frames arrive late: a gateway between the bus and the host holds them back."
    symptom = "Positions are old, and commands take effect late."
    parameters = (Parameter("delay", 0.02, "s", "of each frame", 0.0, 1.0),)
    delay: float

    def begin(self) -> None:
        self._waiting: list[tuple[float, Frame, Connection | None]] = []
        super().begin()
        self.simulation.boards.each_step.append(self._pass_on)

    def end(self) -> None:
        super().end()
        self.simulation.boards.each_step.remove(self._pass_on)

    def replace(self, frame: Frame, now: float) -> Iterator[Frame]:
        self._waiting.append((now + self.delay, frame, self.wire.sender))
        yield from ()

    def _pass_on(self, now: float) -> None:
        while self._waiting and self._waiting[0][0] <= now:
            _, frame, sender = self._waiting.pop(0)
            self.wire.hand_over(frame, now, sender)


class Termination(_BusFault):
    """Disturbed frames, the more the busier the bus is."""

    kind = "can_termination"
    description = "A termination resistor is missing: reflections damage frames, the more the busier the bus is."
    symptom = "The counts of errors of all nodes rise; frames are sent again, and are late."
    parameters = (Parameter("share", 0.3, "", "of the frames on a full bus", 0.0, 0.9),)
    share: float

    def begin(self) -> None:
        self._before = self.simulation.now, self.wire.bits
        self._load = 0.0
        self.wire.disturbances.append(self._damaged)

    def end(self) -> None:
        self.wire.disturbances.remove(self._damaged)
        self.wire.recover()

    def _damaged(self, frame: Frame, now: float) -> bool:
        del frame
        since, bits = self._before
        if now - since > _WINDOW:
            self._load = (self.wire.bits - bits) / (now - since) / _BITS
            self._before = now, self.wire.bits
        return self.chance(self.share * self._load)


class Babbling(_BusFault):
    """A node that sends without end."""

    kind = "can_babbling"
    description = "A board sends without end: its firmware has crashed in an endless loop."
    symptom = "The bus is full; frames with higher identifiers are late, or do not come at all."
    parameters = (
        Parameter("share", 1.0, "", "of the time of the bus", 0.0, 1.0),
        Parameter("identifier", 0x1FF, "", "of its frames; low ones win the arbitration", 0.0, 0x7FF, None),
    )
    share: float
    identifier: float
    address: int | None = None
    connection: Connection

    def begin(self) -> None:
        self.connection = self.wire.attach(self)
        self._owed = 0.0
        self.simulation.boards.each_step.append(self._send)

    def end(self) -> None:
        self.simulation.boards.each_step.remove(self._send)
        self.wire.detach(self.connection)

    def receive(self, frame: Frame, time: float) -> None:
        """Ignore what others send."""

    def _send(self, now: float) -> None:
        del now
        self._owed += self.share * _BITS * TIMESTEP / _FRAME_BITS
        if self.share == 1.0:  # without end: one always waits
            self._owed = float(_WAITING - self.connection.waiting)
        while self._owed >= 1.0:
            self._owed -= 1.0
            self.connection.send(Frame(int(self.identifier), bytes(8)))


_WINDOW = 0.1  # s, of the load
_BITS = 1e6  # a second
_FRAME_BITS = 130  # of a frame with eight zeros, about
_WAITING = 10  # frames, more than a millisecond has room for


class _CanBoardFault(Fault):
    """A fault of one board on a bus."""

    layer = Layer.BUS
    target_kind = Target.CAN_BOARD
    board: JointBoard | FocBoard

    @property
    def positions(self) -> Message:
        """The message with the positions of the board."""
        return m.FOC_FEEDBACK if isinstance(self.board, FocBoard) else m.BROADCAST_POSITION

    def aim(self) -> None:
        boards = {f"{board.wire.name}:{board.address}": board for board in _firmware(self).motor_boards}
        if self.target not in boards:
            raise RefusedError(
                f"{self.kind}: the robot has no board {self.target!r}; its boards are {', '.join(boards)}"
            )
        self.board = boards[self.target]


class BusOff(_CanBoardFault):
    """A board that is off the bus."""

    kind = "can_bus_off"
    description = "The controller of a board is off the bus, after too many errors."
    symptom = "The board is silent, and obeys no command."

    def begin(self) -> None:
        self.board.connection.off = True

    def end(self) -> None:
        self.board.connection.recover()


class SameAddress(_CanBoardFault):
    """Another board with the same address."""

    kind = "can_same_address"
    description = "A second board has the address of a board: it was replaced, and not configured."
    symptom = "Both answer, and spoil each other's frames until they are off the bus."
    connection: Connection

    def begin(self) -> None:
        self.address = self.board.address
        self.connection = self.board.wire.attach(self)
        self._sent = 0
        self.simulation.boards.each_step.append(self._send)

    def end(self) -> None:
        self.simulation.boards.each_step.remove(self._send)
        self.board.wire.detach(self.connection)
        self.board.connection.recover()

    def receive(self, frame: Frame, time: float) -> None:
        """Ignore requests: the broadcasts do the damage."""

    def _send(self, now: float) -> None:
        del now
        if self.address is not None and float(self.simulation.random.random()) < 1 / _CYCLE:  # its clock is another one
            self._sent += 1
            zeros = [0] * (len(self.positions.fields) - 1)
            self.connection.send(self.positions.frame(self.address, *zeros, self._sent))


_CYCLE = 4  # ms between two positions of a board, about


class BoardReset(_CanBoardFault):
    """A board that starts anew."""

    kind = "can_board_reset"
    description = "A board loses its power for a moment, and starts anew with the settings of its flash."
    symptom = "Its motors are off, it broadcasts nothing, and its settings are lost."

    def begin(self) -> None:
        self.board.reset()

    def end(self) -> None:
        """Do nothing: the host configures the board again."""


class WrongFirmware(_CanBoardFault):
    """A board with an older firmware."""

    kind = "can_wrong_firmware"
    restores = True
    description = "A board has an older firmware than the others."
    symptom = "It says another version, and may not acknowledge the protocol."

    def begin(self) -> None:
        self._before = self.board.firmware
        major, minor, build = self._before
        self.board.firmware = major - 1, minor, build

    def end(self) -> None:
        self.board.firmware = self._before


class _HandlerFault(_CanBoardFault):
    """A fault of a board that ignores some requests."""

    ignored: ClassVar[tuple[str, ...]]

    def begin(self) -> None:
        self.board.ignored.update(self.ignored)

    def end(self) -> None:
        self.board.ignored.difference_update(self.ignored)


class SettingsIgnored(_HandlerFault):
    """A board that does not take its configuration."""

    kind = "can_settings_ignored"
    description = "A board does not take new settings: its memory is write-protected."
    symptom = "Gains and limits that are read back are those of before."
    ignored = tuple(name for name in (*HANDLERS, *DRIVE_HANDLERS) if name.startswith("set_") and "mode" not in name)


class WatchdogOff(_HandlerFault):
    """A board whose velocities do not end."""

    kind = "can_watchdog_off"
    description = "A board has no watchdog of velocities, or of setpoints: an old firmware."
    symptom = "When the host falls silent, a joint in velocity mode goes on."
    ignored = (m.VELOCITY_TIMEOUT.name,)

    def begin(self) -> None:
        super().begin()
        if isinstance(self.board, FocBoard):
            self.board.watchdog = float("inf")
            return
        self._before = [own.velocity_timeout for own in self.board.parameters]
        for own in self.board.parameters:
            own.velocity_timeout = float("inf")

    def end(self) -> None:
        super().end()
        if isinstance(self.board, FocBoard):
            self.board.watchdog = WATCHDOG
            return
        for own, before in zip(self.board.parameters, self._before, strict=True):
            own.velocity_timeout = before


class EncoderFrameStuck(_CanBoardFault):
    """A board that sends the same positions again and again."""

    kind = "can_encoder_frame_stuck"
    description = "A board sends old positions: the part of its firmware that reads the encoders hangs."
    symptom = "Positions do not change while speeds and currents do."

    def begin(self) -> None:
        self._sent: tuple[float | bytes, ...] = ()
        self.board.wire.filters.append(self._replace)

    def end(self) -> None:
        self.board.wire.filters.remove(self._replace)

    def _replace(self, frame: Frame, now: float) -> Iterator[Frame]:
        del now
        board, positions = self.board, self.positions
        if board.address is not None and frame.identifier == positions.identifier(board.address):
            values = decode(*frame, board.dialect).values
            live = len(values) - len(board.axes)  # the current and the speed of a drive
            self._sent = self._sent or values
            frame = positions.frame(board.address, *values[:live], *self._sent[live:])
        yield frame


KINDS = (
    FramesLost,
    FramesDelayed,
    FramesDuplicated,
    FramesReordered,
    IdentifierDamaged,
    Termination,
    Babbling,
    BusOff,
    SameAddress,
    BoardReset,
    WrongFirmware,
    SettingsIgnored,
    WatchdogOff,
    EncoderFrameStuck,
)
