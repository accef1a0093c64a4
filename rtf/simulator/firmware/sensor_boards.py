"""Boards that measure: force-torque sensors, inertial units, skin, and the hall sensors of a hand.

A board reads its own sensor only, at its rate, and sends what it has read, until a command stops it. Which of them
send from power-up on, and all that a message does not change, such as the calibration of a force-torque sensor, is what
is in their flash. What is no message for them is dropped.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.devices.can import sensor_messages as s
from rtf.robot.devices.can.codes import BoardType, InertialKind, StrainMode
from rtf.robot.devices.can.messages import MAX_DATA, MessageClass, make_frame
from rtf.simulator.board_state import AMBIENT
from rtf.simulator.firmware.board import Board, number
from rtf.simulator.firmware.readings import short

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from rtf.robot.devices.can.codec import Decoded
    from rtf.robot.devices.can.messages import Message
    from rtf.robot.interfaces import FloatArray
    from rtf.simulator.firmware.wire import Wire
    from rtf.simulator.simulation import Simulation

    #: Returns what the sensor of a board measures now.
    Measure = Callable[[], FloatArray]

#: Milliseconds between two readings, unless the host asks for others.
PERIOD, SKIN_PERIOD = 10, 20
#: Milliseconds between two temperatures of a force-torque board. No source says how often boards send them.
_TEMPERATURE_PERIOD = 1000
_MODES = frozenset(map(int, StrainMode))


class SensorBoard(Board):
    """A board that measures by ``measure`` and sends, from the construction on.

    ``period`` (ms) and ``mode`` are what the host has asked for last; ``reset`` puts back what is in flash.
    """

    #: The mode and the period after power-up.
    flash: tuple[StrainMode, int] = (StrainMode.CALIBRATED, PERIOD)

    def __init__(
        self, wire: Wire, address: int, simulation: Simulation, measure: Measure, board_type: BoardType
    ) -> None:
        super().__init__(wire, address, board_type)
        self.measure = measure
        self._simulation = simulation
        self.reset()
        self._await_next()

    def reset(self) -> None:
        """Start as after power-up."""
        self.silent = False
        self.mode, self.period = self.flash

    def stop(self) -> None:
        self.mode = StrainMode.STOPPED

    def _await_next(self) -> None:
        """Plan the next reading, at a multiple of the period: the sensors of the model are computed there."""
        tick = self._simulation.boards.tick
        self._simulation.at((tick // self.period + 1) * self.period, self._cycle, looks=True)

    def _cycle(self) -> None:
        self._await_next()
        if self.mode is not StrainMode.STOPPED and not self.silent:
            self.broadcast(self.measure())

    @abstractmethod
    def broadcast(self, values: FloatArray) -> None:
        """Send what was measured."""

    def handle(self, got: Decoded) -> bool:
        message = got.message
        if got.axis:
            return False
        if message is s.SENSOR_VERSION.get:
            self.answer_version(s.SENSOR_VERSION, got.values)
        elif message is s.SET_STRAIN_MODE and got.values[0] in _MODES:
            self.mode = StrainMode(int(number(got.values)))
        elif message is s.SET_SENSOR_RATE:
            self.period = max(int(number(got.values)), 1)
        else:
            return False
        return True


class StrainBoard(SensorBoard):
    """A force-torque sensor: six strain gauges, and the matrix in flash that makes forces and torques of them.

    It has the temperature of the room, which it sends every second beside its readings.
    ``scales`` are the full scales, whole numbers of N and Nm. ``calibration`` (6 by 6) makes shares of them of shares
    of the range of the gauges. A gauge beyond its range is saturated, and the messages say so.
    """

    flash = (StrainMode.STOPPED, PERIOD)

    def __init__(
        self,
        wire: Wire,
        address: int,
        simulation: Simulation,
        measure: Measure,
        scales: tuple[int, ...],
        calibration: FloatArray,
        *,
        board_type: BoardType = BoardType.STRAIN,
    ) -> None:
        self.scales, self.calibration = scales, calibration
        self._temperature_due = 0
        self._gauges = np.linalg.inv(calibration) / np.array(scales, dtype=np.float64)
        super().__init__(wire, address, simulation, measure, board_type)

    def broadcast(self, values: FloatArray) -> None:
        wanted = np.rint(self._gauges @ values * _MIDDLE)
        gauges = np.clip(wanted, -_MIDDLE, _MIDDLE - 1)
        saturated = np.sign(wanted - gauges)
        if self.mode in (StrainMode.CALIBRATED, StrainMode.BOTH):
            counts = np.clip(np.rint(self.calibration @ gauges), -_MIDDLE, _MIDDLE - 1)
            self._send(_CALIBRATED, counts, saturated)
        if self.mode in (StrainMode.RAW, StrainMode.BOTH):
            self._send(_RAW, gauges, saturated)
        if self._simulation.boards.tick >= self._temperature_due:
            self._temperature_due = self._simulation.boards.tick + _TEMPERATURE_PERIOD
            self.send(s.STRAIN_TEMPERATURE, 1, round(AMBIENT / s.STRAIN_TEMPERATURE.fields[1].factor), 0)

    def _send(self, pairs: Mapping[bool, tuple[Message, Message]], counts: FloatArray, saturated: FloatArray) -> None:
        """Send counts about zero, with the state of the gauges if one is saturated."""
        numbers = (counts + _MIDDLE).astype(np.int64).tolist()
        extra = (_saturation(saturated[:_AXES]), _saturation(saturated[_AXES:])) if saturated.any() else ()
        for half, message in enumerate(pairs[bool(extra)]):
            self.send(message, *numbers[half * _AXES : (half + 1) * _AXES], *extra[half : half + 1])

    def handle(self, got: Decoded) -> bool:
        if got.message is not s.FULL_SCALE.get or got.axis:
            return super().handle(got)
        channel = int(number(got.values)) & _LOW_BITS
        if channel >= len(self.scales):
            return False
        self.send(s.FULL_SCALE.value, *got.values, self.scales[channel])
        return True


def calibration_of(board: int) -> FloatArray:
    """Return a matrix as the calibration of a sensor gives it: each gauge feels a little of all forces and torques."""
    cross = np.random.default_rng([_CALIBRATION_SEED, board]).uniform(-_CROSS_TALK, _CROSS_TALK, (2 * _AXES, 2 * _AXES))
    found: FloatArray = np.eye(2 * _AXES) + cross
    return found


def _saturation(gauges: FloatArray) -> int:
    """Return the byte about three gauges, which are at their lower end (-1), within (0), or at the upper one (1)."""
    found = 0
    for place, gauge in enumerate(gauges.tolist()):
        found |= _SATURATED[int(gauge)] << 2 * (place + 1)
    return found | (_ANY if found else 0)


_MIDDLE, _AXES, _LOW_BITS = 0x8000, 3, 0xF
_ANY, _SATURATED = 0b11, {-1: 0b01, 0: 0, 1: 0b10}
_CROSS_TALK, _CALIBRATION_SEED = 0.05, 0x57A1
_CALIBRATED = {False: (s.FORCE, s.TORQUE), True: (s.FORCE_SATURATED, s.TORQUE_SATURATED)}
_RAW = {False: (s.RAW_FORCE, s.RAW_TORQUE), True: (s.RAW_FORCE_SATURATED, s.RAW_TORQUE_SATURATED)}


class InertialBoard(SensorBoard):
    """An inertial unit, with vectors of some ``kinds``; ``scales`` are their units a count.

    A board of type SKIN (MTB) has a gyroscope and an accelerometer with a message each; others have one message that
    says the kind, and a number that is that of the reading.
    """

    def __init__(
        self,
        wire: Wire,
        address: int,
        simulation: Simulation,
        measure: Measure,
        scales: Mapping[InertialKind, float],
        *,
        board_type: BoardType = BoardType.MTB4,
    ) -> None:
        super().__init__(wire, address, simulation, measure, board_type)
        self.kinds = tuple(scales)
        self._factors = 1.0 / np.repeat(list(scales.values()), _AXES)
        self._sequence = 0

    def broadcast(self, values: FloatArray) -> None:
        counts = [short(one) for one in (values * self._factors).tolist()]
        for place, kind in enumerate(self.kinds):
            vector = counts[place * _AXES : (place + 1) * _AXES]
            if self.board_type is BoardType.SKIN:
                self.send(_LEGACY[kind], *vector)
            else:
                self.send(s.INERTIAL_VECTOR, self._sequence, kind, *vector)
        self._sequence = self._sequence + 1 & _BYTE


_BYTE = 0xFF
_LEGACY = {InertialKind.ANGULAR_VELOCITY: s.GYROSCOPE, InertialKind.ACCELERATION: s.ACCELEROMETER}


class SkinBoard(SensorBoard):
    """Up to sixteen triangles of twelve taxels; two messages each."""

    flash = (StrainMode.CALIBRATED, SKIN_PERIOD)

    def broadcast(self, values: FloatArray) -> None:
        triangles = np.clip(values, 0, _BYTE).astype(np.uint8).reshape(-1, _TAXELS)
        table = np.zeros((len(triangles), 2, MAX_DATA), np.uint8)  # its parts of a triangle, each with its number
        table[:, 0, 1:] = triangles[:, :_FIRST]
        table[:, 1, 0] = _SECOND_PART
        table[:, 1, 1 : 1 + _TAXELS - _FIRST] = triangles[:, _FIRST:]
        data, address, send = table.tobytes(), self.address or 0, self.connection.send
        for place in range(2 * len(triangles)):
            number = _SKIN | address << 4 | place // 2
            send(make_frame((number, data[place * MAX_DATA : (place + 1) * MAX_DATA])))


#: The triangles of a skin board at most.
TRIANGLES = len(s.SKIN)
_TAXELS, _FIRST, _SECOND_PART = 12, 7, 0x80
_SKIN = MessageClass.SKIN_PERIODIC << 8


class MaisBoard(SensorBoard):
    """The fifteen hall sensors of a hand."""

    flash = (StrainMode.STOPPED, PERIOD)

    def broadcast(self, values: FloatArray) -> None:
        counts = values.astype(np.int64).tolist()
        low = len(s.MAIS_LOW.fields)
        self.send(s.MAIS_LOW, *counts[:low])
        self.send(s.MAIS_HIGH, *counts[low:])
