"""What all emulated boards have: an address on a bus, versions, and the answers to a search."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar

from rtf.robot.devices.can import sensor_messages as s
from rtf.robot.devices.can.codec import decode
from rtf.robot.devices.can.messages import ADDRESSES, Dialect, Frame
from rtf.robot.errors import MessageError

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.robot.devices.can.codec import Decoded
    from rtf.robot.devices.can.codes import BoardType
    from rtf.robot.devices.can.messages import Message, Question
    from rtf.simulator.firmware.wire import Connection, Wire

    Values = tuple[float | bytes, ...]

_BLOCKS, _BLOCK = 8, 4  # of the text that a user may keep on a board


class Board(ABC):
    """A board at ``address`` on a wire, from the construction on.

    ``firmware`` and ``protocol`` are the versions that it claims. ``silent``: it is in its boot loader and neither
    listens nor speaks. ``rejected`` counts the frames that were no messages for it; ``ignored`` has the names of
    messages that a faulty board does not obey.
    """

    dialect: ClassVar[Dialect] = Dialect.JOINT
    connection: Connection

    def __init__(self, wire: Wire, address: int, board_type: BoardType) -> None:
        self.wire = wire
        self.address: int | None = address
        self.board_type = board_type
        self.firmware, self.protocol = (3, 5, 0), (1, 6)
        self.rejected = 0
        self.ignored: set[str] = set()
        self.silent = False
        self.information = [bytes(_BLOCK)] * _BLOCKS
        self.connection = wire.attach(self)

    @abstractmethod
    def handle(self, got: Decoded) -> bool:
        """Take a request; return whether the board knows it."""

    @abstractmethod
    def stop(self) -> None:
        """Stop motors and broadcasts, as a search and a jump to the boot loader ask for."""

    def clear(self) -> None:
        """Be as after the start, without faults and commands, as the robot is reset; what was set is kept."""
        self.silent = False

    def take_address(self, values: Values) -> bool:
        """Answer at another address from now on, also after a reset; return whether it is one."""
        address = int(number(values))
        if address not in ADDRESSES:
            return False
        self.address = address
        self.wire.forget_addresses()
        return True

    def receive(self, frame: Frame, time: float) -> None:
        """Take a request; what is none for this board is dropped, as boards do."""
        del time
        if self.silent:
            return
        try:
            got = decode(frame.identifier, frame.data, self.dialect)
        except MessageError:
            self.rejected += 1
            return
        name = got.message.name
        if name in self.ignored:
            self.rejected += 1
        elif name in _MANAGEMENT:
            _MANAGEMENT[name](self, got.values)
        elif not self.handle(got):
            self.rejected += 1

    def send(self, message: Message, *values: float | bytes, axis: int = 0) -> None:
        """Send a message of this board."""
        if self.address is not None and not self.silent:
            self.connection.send(message.frame(self.address, *values, axis=axis))

    def answer_version(self, question: Question, values: Values, axis: int = 0) -> None:
        """Answer a question for the versions, and whether that of the host's protocol is agreed to."""
        major, minor = self.protocol
        agreed = major == values[0] and minor >= number(values, 1)
        self.send(question.value, self.board_type, *self.firmware, major, minor, int(agreed), axis=axis)


def number(values: Values, place: int = 0) -> float:
    """Return a number of a message. Raises TypeError for a text."""
    value = values[place]
    if isinstance(value, bytes):
        raise TypeError(f"a text in the place {place} of a message of numbers")
    return value


# Management -------------------------------------------------------------------------------------------------------


def _set_address(board: Board, values: Values) -> None:
    if not board.take_address(values):
        board.rejected += 1


def _discovered(board: Board, _values: Values) -> None:
    board.send(s.DISCOVER.value, board.board_type, *board.firmware)
    board.stop()


def _ping(board: Board, _values: Values) -> None:
    board.send(s.PING.value, 1)


def _jump_to_loader(board: Board, _values: Values) -> None:
    board.stop()
    board.silent = True


def set_information(board: Board, values: Values) -> None:
    """Keep a block of the text of a user."""
    block, content = int(number(values)), values[1]
    if block < len(board.information) and isinstance(content, bytes):
        board.information[block] = content


def _get_information(board: Board, _values: Values) -> None:
    for block, content in enumerate(board.information):
        board.send(s.BOARD_INFORMATION.value, block, content)


_MANAGEMENT: dict[str, Callable[[Board, Values], None]] = {
    s.DISCOVER.get.name: _discovered,
    s.PING.get.name: _ping,
    s.SET_ADDRESS.name: _set_address,
    s.JUMP_TO_LOADER.name: _jump_to_loader,
    s.BOARD_INFORMATION.set.name: set_information,
    s.BOARD_INFORMATION.get.name: _get_information,
}
