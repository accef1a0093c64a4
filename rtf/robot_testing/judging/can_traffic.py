"""The frames of a CAN bus, recorded for some time: load, rates, repeated and overtaken frames, frames of nobody.

It judges what the protocol says (ISO 11898-1, and the schedule of the boards) and knows neither ports nor robots.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np

from rtf.robot.devices.can import motor_messages as motor
from rtf.robot.devices.can.codec import decode
from rtf.robot.devices.can.codes import FOC_BOARDS, BoardType, FocFault
from rtf.robot.devices.can.frame_bits import frame_bits
from rtf.robot.devices.can.joint_link import BROADCASTS
from rtf.robot.devices.can.messages import EVERYONE, HOST, POLLING, Dialect, MessageClass
from rtf.robot.errors import MessageError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from rtf.robot.devices.can.codec import Decoded
    from rtf.robot.devices.can.messages import Frame, Message
    from rtf.robot.interfaces import FloatArray

Key = TypeVar("Key")

#: Seconds of a board's schedule, in which it sends each broadcast once: of boards of four axes, and of others.
CYCLE_OF_FOUR, CYCLE = 0.005, 0.004
#: The broadcasts that are sent after changes, and so have no rate.
_ON_CHANGE = frozenset({motor.STATUS.code, motor.ADDITIONAL_STATUS.code, motor.PRINT.code})
_SETPOINTS = MessageClass.MOTOR_PERIODIC << 8 | HOST << 4 | EVERYONE
#: The counts of errors beyond which a node warns, and is passive (ISO 11898-1).
_WARNING, _PASSIVE = 96, 128
#: Frames with one identifier that are nearer to each other than this share of the cycle cannot both be on schedule.
_NEAR = 0.5
#: Seconds before and after a speed with which it is averaged.
_AROUND = 0.05


class BoardOnBus(NamedTuple):
    """A motor board: its address, its type, and the joints that it has."""

    address: int
    board_type: int
    joints: tuple[str, ...]

    @property
    def drives(self) -> bool:
        """Whether it drives a motor, and answers each setpoint with its state."""
        return self.board_type in FOC_BOARDS

    @property
    def dialect(self) -> Dialect:
        """The dialect of its messages."""
        return Dialect.FOC if self.drives else Dialect.JOINT

    @property
    def cycle(self) -> float:
        """The seconds of its schedule, if it controls joints."""
        return CYCLE_OF_FOUR if self.board_type == BoardType.MC_4DC else CYCLE

    def broadcasts(self) -> list[int]:
        """Return the identifiers of its broadcasts, those without a rate included, as the driver asks for them."""
        if self.drives:
            codes = [motor.FOC_FEEDBACK.code, motor.FOC_STATUS.code, motor.FOC_ADDITIONAL_STATUS.code]
        else:
            codes = [bit + 1 for bit in range(BROADCASTS.bit_length()) if BROADCASTS >> bit & 1]
        return [MessageClass.MOTOR_PERIODIC << 8 | self.address << 4 | code for code in codes]


class FrameStream(NamedTuple):
    """The frames with one identifier: their times (s), and their data."""

    times: FloatArray
    data: tuple[bytes, ...]


class Repetition(NamedTuple):
    """How many frames came twice, and how many were overtaken by the next one, or sent by somebody else."""

    repeated: int
    overtaken: int


class CanTraffic:
    """The frames of a bus with their times (s), in the order in which they arrived."""

    def __init__(self, frames: Sequence[tuple[Frame, float]], bitrate: float) -> None:
        self.frames = frames
        self.times = np.array([time for _, time in frames])
        self.seconds = float(np.ptp(self.times)) if len(frames) else 0.0
        self._bits = np.array([frame_bits(frame) for frame, _ in frames])
        self._numbers = np.array([frame.identifier for frame, _ in frames])
        self._bitrate = bitrate
        found: dict[int, list[tuple[float, bytes]]] = {}
        for frame, time in frames:
            found.setdefault(frame.identifier, []).append((time, frame.data))
        self.streams = {
            number: FrameStream(np.array([time for time, _ in rows]), tuple(data for _, data in rows))
            for number, rows in sorted(found.items())
        }

    @property
    def load(self) -> float:
        """The load, a share of the bits that the bus can carry; 0 without a time."""
        return self._share(self._bits)

    def load_of(self, identifier: int) -> float:
        """Return the share that one identifier has in the bits that the bus can carry."""
        return self._share(self._bits[self._numbers == identifier])

    def _share(self, bits: NDArray[np.int64]) -> float:
        return float(bits.sum()) / self._bitrate / self.seconds if self.seconds else 0.0

    def busiest(self, seconds: float) -> float:
        """Return the greatest load in a window of some seconds."""
        if not self.seconds:
            return 0.0
        edges = np.arange(self.times.min(), self.times.max() + seconds, seconds)
        bits, _ = np.histogram(self.times, bins=edges, weights=self._bits)
        return float(bits[:-1].max(initial=0.0)) / self._bitrate / seconds

    def of(self, identifier: int) -> FrameStream:
        """Return the frames with an identifier."""
        return self.streams.get(identifier, FrameStream(np.empty(0), ()))

    def messages(self, board: BoardOnBus, message: Message) -> list[tuple[float, Decoded]]:
        """Return the messages of one kind that a board sent, with their times, without those that cannot be read."""
        stream, found = self.of(message.identifier(board.address)), []
        for time, data in zip(stream.times.tolist(), stream.data, strict=True):
            got = decoded(message.identifier(board.address), data, board.dialect)
            if got is not None and got.message is message:
                found.append((time, got))
        return found

    def expected(self, board: BoardOnBus) -> dict[int, float]:
        """Return how often each broadcast of a board should come, by identifier.

        A board that drives a motor answers each setpoint; others follow their schedule.
        """
        if board.drives:
            return dict.fromkeys(board.broadcasts()[:2], float(len(self.of(_SETPOINTS).times)))
        regular = [one for one in board.broadcasts() if one & 0xF not in _ON_CHANGE]
        return dict.fromkeys(regular, self.seconds / board.cycle)

    def cycle_of(self, board: BoardOnBus) -> float:
        """Return the seconds between two frames of a kind of a board: of its schedule, or between two setpoints."""
        setpoints = self.of(_SETPOINTS).times
        return float(np.median(np.diff(setpoints))) if board.drives and len(setpoints) > 1 else board.cycle

    def repetition(self, identifier: int, cycle: float) -> Repetition:
        """Return how many frames with an identifier came too soon after the one before, with equal and other data."""
        stream = self.of(identifier)
        near = np.flatnonzero(np.diff(stream.times) < _NEAR * cycle)
        repeated = sum(stream.data[place] == stream.data[place + 1] for place in near.tolist())
        return Repetition(repeated, len(near) - repeated)

    def strangers(self, boards: Iterable[BoardOnBus], others: Iterable[int]) -> dict[int, int]:
        """Return how many frames came from nobody, by identifier: not from the host, nor from a board that is known.

        ``others`` are the addresses of boards that no driver of motors has, such as sensors.
        """
        motors, sensors = {board.address: board for board in boards}, set(others)
        addresses = motors.keys() | sensors
        known = {number for board in motors.values() for number in board.broadcasts()}
        known.add(_SETPOINTS)
        for kind in POLLING:
            known |= {kind << 8 | one for one in (*addresses, EVERYONE)} | {kind << 8 | one << 4 for one in addresses}
        return {
            number: len(stream.times)
            for number, stream in self.streams.items()
            if number not in known and not (number >> 4 & 0xF in sensors and number >> 8 not in POLLING)
        }

    def unreadable(self, boards: Iterable[BoardOnBus]) -> dict[int, int]:
        """Return how many frames of known boards are no messages, as their lengths are wrong, by identifier."""
        found: dict[int, int] = {}
        for board in boards:
            for number in board.broadcasts():
                wrong = sum(decoded(number, data, board.dialect) is None for data in self.of(number).data)
                if wrong:
                    found[number] = wrong
        return found

    def errors(self, board: BoardOnBus) -> tuple[int, int]:
        """Return the greatest counts of errors of transmission and of reception in the statuses of a board.

        Boards that drive a motor only say which bounds of ISO 11898-1 their counts are beyond.
        """
        counts = [(0, 0)]
        if board.drives:
            for _, got in self.messages(board, motor.FOC_STATUS):
                said = FocFault(int(got.values[3]))
                counts.append(
                    (
                        _bound(said, FocFault.TX_WARNING, FocFault.TX_PASSIVE),
                        _bound(said, FocFault.RX_WARNING, FocFault.RX_PASSIVE),
                    )
                )
        else:
            counts += [(int(got.values[6]), int(got.values[7])) for _, got in self.messages(board, motor.STATUS)]
        return max(sent for sent, _ in counts), max(got for _, got in counts)

    def longest_silence(self, identifier: int) -> tuple[float, float]:
        """Return the longest time without a frame with an identifier, and when it began (s); the ends count, too."""
        times = self.of(identifier).times
        if not len(self.frames):
            return 0.0, 0.0
        marks = np.concatenate([[self.times.min()], times, [self.times.max()]])
        gaps = np.diff(marks)
        place = int(gaps.argmax())
        return float(gaps[place]), float(marks[place])


def _bound(said: FocFault, warning: FocFault, passive: FocFault) -> int:
    return _PASSIVE if said & passive else _WARNING if said & warning else 0


def decoded(identifier: int, data: bytes, dialect: Dialect) -> Decoded | None:
    """Return the message of a frame; None if it is none."""
    try:
        return decode(identifier, data, dialect)
    except MessageError:
        return None


def longest_gap(times: Sequence[float]) -> tuple[float, float]:
    """Return the two consecutive times, of some in their order, that are farthest apart; a single one twice."""
    return max(pairwise([times[0], *times]), key=lambda pair: pair[1] - pair[0])


def rest_after(times: FloatArray, speeds: FloatArray, share: float) -> float | None:
    """Return the time (s) from which on all speeds are below a share of the greatest one; None if it never rests.

    Each is the mean of a twentieth of a second before and after it: a board reports no speed for a joint that creeps,
    and now and then a whole count, and counts of both signs for one that trembles.
    """
    sums = np.concatenate([[0.0], np.cumsum(speeds)])
    first, last = np.searchsorted(times, times - _AROUND), np.searchsorted(times, times + _AROUND, side="right")
    means = np.abs(sums[last] - sums[first]) / (last - first)
    fast = np.flatnonzero(means > share * np.abs(speeds).max(initial=0.0))
    if not len(fast):
        return None
    return float(times[fast[-1] + 1]) if fast[-1] + 1 < len(times) else None


def older_than_usual(versions: Mapping[Key, tuple[int, ...]]) -> dict[Key, tuple[int, ...]]:
    """Return the boards whose version is not that of most, each with the version of most.

    Where as many boards have one version as another, the newest is taken for the right one.
    """
    if not versions:
        return {}
    counts = {version: [*versions.values()].count(version) for version in versions.values()}
    usual = max(counts, key=lambda version: (counts[version], version))
    return {board: usual for board, version in versions.items() if version != usual}
