"""Questions to boards, and their answers: with time-outs, retries, and the discovery of boards."""

from __future__ import annotations

import threading
from collections import Counter, deque
from typing import TYPE_CHECKING, NamedTuple

from rtf import clock
from rtf.robot.devices.can.codec import decode
from rtf.robot.devices.can.codes import BoardType
from rtf.robot.devices.can.messages import ADDRESSES, EVERYONE, POLLING, Dialect, MessageClass
from rtf.robot.devices.can.motor_messages import VERSION
from rtf.robot.devices.can.sensor_messages import DISCOVER, SENSOR_VERSION
from rtf.robot.errors import DeviceError, MessageError

if TYPE_CHECKING:
    from rtf.robot.devices.can.bus import CanBus
    from rtf.robot.devices.can.codec import Decoded
    from rtf.robot.devices.can.messages import Frame, Message, Question, Setting

#: Seconds until an answer is missed, and how often a question is repeated then.
TIMEOUT, RETRIES = 0.02, 3
#: The version of the protocol that the host speaks: boards refuse to be configured by one that they do not know.
PROTOCOL = (1, 6)
#: The greatest identifier of an answer of a motor board.
_LAST_OF_MOTORS = 0xFF
#: Seconds in which boards answer a search.
_SEARCH = 0.1


class Version(NamedTuple):
    """What a board says about itself. ``protocol`` is (0, 0) where it was not asked."""

    board: int
    board_type: int
    firmware: tuple[int, int, int]
    protocol: tuple[int, int] = (0, 0)
    acknowledged: bool = True

    @property
    def type_name(self) -> str:
        """The name of the type of board; its number if there is none."""
        return BoardType(self.board_type).name if self.board_type in set(BoardType) else f"type {self.board_type}"

    @property
    def firmware_text(self) -> str:
        """The version of the firmware, such as ``1.2.3``."""
        return ".".join(map(str, self.firmware))


class Exchange:
    """Questions to the boards on a bus; one at a time, from any thread. ``close`` ends it, but not the bus."""

    def __init__(self, bus: CanBus, timeout: float = TIMEOUT, retries: int = RETRIES) -> None:
        self.bus = bus
        self.timeout = timeout
        self.retries = retries
        self._lock = threading.Lock()
        self._arrived = threading.Event()
        self._wanted: tuple[int, int] | None = None  # identifier and command of the answer
        self._answers: deque[Frame] = deque()
        self._asked: Counter[int] = Counter()  # questions for the version of a board, and answers to them
        self._answered: Counter[int] = Counter()
        self._end = bus.subscribe(self._take, [kind << 8 | board << 4 for kind in POLLING for board in ADDRESSES])

    def close(self) -> None:
        """Receive nothing any more."""
        self._end()

    def ask(
        self, question: Question | Setting, board: int, *values: float, axis: int = 0, dialect: Dialect | None = None
    ) -> tuple[float | bytes, ...]:
        """Return the values of the answer of a board.

        Where an answer repeats what was asked for, such as a channel, others are not taken for it. Raises DeviceError
        if the board does not answer, and BusError if the question cannot be sent.
        """
        frame = question.get.frame(board, *values, axis=axis)
        spoken = dialect or _dialect(question.value)
        repeated = values if question.repeats else ()
        with self._lock:
            for _ in range(self.retries + 1):
                self._begin(question.value.identifier(board), frame.data[0])
                self._asked[board] += question is VERSION
                self.bus.send(frame)
                answer = self._await(question.value, spoken, clock.Deadline.after(self.timeout), repeated)
                if answer is not None:
                    self._wanted = None
                    return answer.values
        raise DeviceError(
            f"board {board} on {self.bus.name} does not answer {question.get.name} within {self.timeout * 1e3:g} ms, "
            f"asked {self.retries + 1} times"
        )

    def version(self, board: int, *, sensor: bool = False) -> Version:
        """Return the version of a board, by the question for boards of motors or of sensors. Raises as ``ask``."""
        question = SENSOR_VERSION if sensor else VERSION
        values = self.ask(question, board, *PROTOCOL)
        kind, major, minor, build, protocol_major, protocol_minor, acknowledged = map(int, values)
        return Version(
            board, kind, (major, minor, build), (protocol_major, protocol_minor), acknowledged=bool(acknowledged)
        )

    def clashes(self) -> list[int]:
        """Return the boards with more answers about their version than questions: two boards have this address."""
        return sorted(board for board, answers in [*self._answered.items()] if answers > self._asked[board])

    def discover(self, seconds: float = _SEARCH) -> list[Version]:
        """Return all boards that answer a search, in the order of their addresses; two with one address are both there.

        Boards of joints stop their motors and broadcasts when they are searched for.
        """
        found: list[Version] = []
        deadline = clock.Deadline.after(seconds)
        with self._lock:
            self._begin(-1, DISCOVER.value.code)
            self.bus.send(DISCOVER.get.frame(EVERYONE))
            while True:
                answer = self._await(DISCOVER.value, Dialect.JOINT, deadline)
                if answer is None:
                    self._wanted = None
                    return sorted(found)
                kind, major, minor, build = map(int, answer.values)
                found.append(Version(answer.source, kind, (major, minor, build)))

    # The answers -----------------------------------------------------------------------------------------------------

    def _begin(self, identifier: int, command: int) -> None:
        self._answers.clear()
        self._arrived.clear()
        self._wanted = identifier, command

    def _take(self, frame: Frame, stamp: float) -> None:
        """Keep an answer to the present question. Called by the thread of the bus."""
        del stamp
        if frame.data and frame.data[0] == VERSION.value.code and frame.identifier <= _LAST_OF_MOTORS:
            self._answered[frame.identifier >> 4] += 1
        wanted = self._wanted
        if wanted is None or not frame.data or frame.data[0] != wanted[1]:
            return
        if frame.identifier == wanted[0] or (wanted[0] < 0 and frame.identifier >> 8 == MessageClass.MANAGEMENT):
            self._answers.append(frame)
            self._arrived.set()

    def _await(
        self, message: Message, dialect: Dialect, deadline: clock.Deadline, repeated: tuple[float, ...] = ()
    ) -> Decoded | None:
        """Return the next answer that can be decoded, and begins with these values; None after the deadline."""
        while True:
            while self._answers:
                try:
                    got = decode(*self._answers.popleft(), dialect)
                except MessageError:  # counted by what arrives, as another answer may be right
                    continue
                if got.message is message and got.values[: len(repeated)] == repeated:
                    return got
            left = deadline.remaining()
            if not left:
                return None
            if self.bus.threaded:
                self._arrived.wait(left)
                self._arrived.clear()
            else:
                self.bus.poll(left)


def _dialect(message: Message) -> Dialect:
    return Dialect.FOC if message.dialect is Dialect.FOC else Dialect.JOINT
