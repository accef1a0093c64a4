"""The sensors on the buses: force-torque sensors, hall sensors of a hand, inertial units, skin.

All have a group ``CAN`` for the bus, see :func:`rtf.robot.devices.can.bus_settings.bus_settings`, and ``timeout`` (ms).
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from rtf.bottle import as_string
from rtf.robot import parameters
from rtf.robot.devices.can import sensor_messages as messages
from rtf.robot.devices.can.codes import BoardType, InertialKind, StrainMode
from rtf.robot.devices.can.messages import MessageClass
from rtf.robot.devices.can.sensor_base import CanSensors, Sensor, address_of, addresses_of, check_type
from rtf.robot.devices.rows import Rows
from rtf.robot.interfaces import SensorCategory, SensorInfo

if TYPE_CHECKING:
    from rtf.bottle import Property
    from rtf.robot.devices.can.codec import Decoded
    from rtf.robot.devices.can.exchange import Exchange
    from rtf.robot.devices.can.messages import Frame
    from rtf.robot.interfaces import FloatArray

#: The raw value of zero, and its distance from full scale.
_MIDDLE = 0x8000
_AXES, _CHANNELS, _MAIS = 3, 6, 15
_STRAIN = frozenset({BoardType.STRAIN, BoardType.STRAIN2})
_TRIANGLES, _TAXELS, _FIRST = 16, 12, 7  # triangles of a board, taxels of a triangle, and of its first message
_SECOND_PART, _SIZE = 0x80, 8  # of a message of skin, in bytes
_PERIOD, _LONGEST_PERIOD = 10, 255  # ms: one byte


class CanStrain(CanSensors):
    """``canBusStrain``: a board with a force-torque sensor at ``canAddress``.

    ``period`` (ms, 10) is that of its messages. The board calibrates by its own matrix, and is asked for its full
    scales (N, Nm), unless ``fullScale`` has six. With ``useCalibration no`` it sends raw values, and ``matrix`` (36
    numbers, row by row) makes N and Nm of them, as shares of the range. A saturated channel is the status OVERFLOW.
    """

    #: From shares of the range to N and Nm; None until the full scales are known.
    _units: FloatArray | None = None

    def configure(self, configuration: Property) -> list[Sensor]:
        self._address = address_of(configuration)
        self._period = parameters.count(configuration, "period", _PERIOD, _LONGEST_PERIOD)
        self._calibrated = parameters.flag(configuration, "useCalibration", default=True)
        name = as_string(configuration.get("sensorName", self.name))
        scales, matrix = Rows(configuration, None, _CHANNELS), Rows(configuration, None, _CHANNELS**2)
        if not self._calibrated:
            self._units = matrix.row("matrix").reshape(_CHANNELS, _CHANNELS)
        self._asks = self._calibrated and scales.values("fullScale") is None
        if self._calibrated and not self._asks:
            self._units = np.diag(scales.row("fullScale"))
        self._force: tuple[FloatArray, bool] | None = None
        info = SensorInfo(name, as_string(configuration.get("frameName", name)))
        self._together = Sensor(SensorCategory.FORCE_TORQUE, info, np.zeros(_CHANNELS))
        return [self._together]

    def identifiers(self) -> list[int]:
        return [MessageClass.SENSOR_PERIODIC << 8 | self._address << 4 | code for code in range(16)]

    def begin(self, exchange: Exchange) -> None:
        check_type(exchange, self._address, _STRAIN)
        if self._asks:
            found = [exchange.ask(messages.FULL_SCALE, self._address, channel) for channel in range(_CHANNELS)]
            self._units = np.diag([float(scale) for _, scale in found])
        mode = StrainMode.CALIBRATED if self._calibrated else StrainMode.RAW
        start(exchange, self._address, self._period, mode)

    def take(self, got: Decoded, stamp: float) -> None:
        code = got.message.code
        force, torque = (
            (messages.FORCE, messages.TORQUE) if self._calibrated else (messages.RAW_FORCE, messages.RAW_TORQUE)
        )
        if code not in (force.code, torque.code) or self._units is None:
            return
        shares = (np.array(got.values[:_AXES], dtype=np.float64) - _MIDDLE) / _MIDDLE
        saturated = len(got.values) > _AXES and bool(got.values[_AXES])
        if code == force.code:
            self._force = shares, saturated
        elif self._force is not None:
            values = np.concatenate([self._force[0], shares])
            self._together.put(self._units @ values, stamp, saturated=saturated or self._force[1])
            self._force = None


class CanMais(CanSensors):
    """``canBusMais``: a board with the fifteen hall sensors of a hand at ``canAddress``; values are 0 to 255.

    ``period`` (ms, 10) is that of its messages.
    """

    def configure(self, configuration: Property) -> list[Sensor]:
        self._address = address_of(configuration)
        self._period = parameters.count(configuration, "period", _PERIOD, _LONGEST_PERIOD)
        self._low: tuple[float, ...] | None = None
        self._array = Sensor(SensorCategory.ENCODER_ARRAY, SensorInfo(self.name), np.zeros(_MAIS))
        return [self._array]

    def identifiers(self) -> list[int]:
        return [one.identifier(self._address) for one in (messages.MAIS_LOW, messages.MAIS_HIGH)]

    def begin(self, exchange: Exchange) -> None:
        start(exchange, self._address, self._period, StrainMode.CALIBRATED)

    def take(self, got: Decoded, stamp: float) -> None:
        values = tuple(float(value) for value in got.values)
        if got.message is messages.MAIS_LOW:
            self._low = values
        elif self._low is not None:
            self._array.put(np.array([*self._low, *values]), stamp)
            self._low = None


class CanInertial(CanSensors):
    """``canBusInertialMTB``: a gyroscope and an accelerometer on each board of ``canAddresses``.

    ``gyroscopeScale`` (deg/s a count) and ``accelerometerScale`` (m/s² a count) are required: boards do not say them.
    With ``magnetometerScale`` (T a count) and ``orientationScale`` (deg a count) they have these, too. ``sensorName``
    is the name of the sensors; those of several boards have its address behind it.
    """

    def configure(self, configuration: Property) -> list[Sensor]:
        self._addresses = addresses_of(configuration)
        self._scales = {
            category: parameters.positive(configuration, key)
            for category, key in _SCALES.items()
            if category in _REQUIRED or configuration.check(key)
        }
        name = as_string(configuration.get("sensorName", ""))
        names = {
            board: name if name and len(self._addresses) == 1 else f"{name or self.name}_{board}"
            for board in self._addresses
        }
        frame = as_string(configuration.get("frameName", ""))
        self._by_board = {
            (board, category): Sensor(category, SensorInfo(names[board], frame or names[board]), np.zeros(_AXES))
            for category, board in product(self._scales, self._addresses)
        }
        return list(self._by_board.values())

    def identifiers(self) -> list[int]:
        kinds = (messages.GYROSCOPE, messages.ACCELEROMETER, messages.INERTIAL_VECTOR)
        return [kind.identifier(board) for board, kind in product(self._addresses, kinds)]

    def take(self, got: Decoded, stamp: float) -> None:
        category = {
            messages.GYROSCOPE.code: SensorCategory.GYROSCOPE,
            messages.ACCELEROMETER.code: SensorCategory.ACCELEROMETER,
        }.get(got.message.code)
        if got.message is messages.INERTIAL_VECTOR:
            category = _VECTORS.get(int(got.values[1]))
        if category in self._scales:
            values = np.array(got.values[-_AXES:], dtype=np.float64) * self._scales[category]
            self._by_board[got.source, category].put(values, stamp)


_VECTORS = {
    int(InertialKind.ACCELERATION): SensorCategory.ACCELEROMETER,
    int(InertialKind.ANGULAR_VELOCITY): SensorCategory.GYROSCOPE,
    int(InertialKind.MAGNETIC_FIELD): SensorCategory.MAGNETOMETER,
    int(InertialKind.ORIENTATION): SensorCategory.ORIENTATION,
}
_SCALES = {
    SensorCategory.GYROSCOPE: "gyroscopeScale",
    SensorCategory.ACCELEROMETER: "accelerometerScale",
    SensorCategory.MAGNETOMETER: "magnetometerScale",
    SensorCategory.ORIENTATION: "orientationScale",
}
_REQUIRED = frozenset({SensorCategory.GYROSCOPE, SensorCategory.ACCELEROMETER})


def start(exchange: Exchange, board: int, period: int, mode: StrainMode) -> None:
    """Have a board send, every ``period`` ms."""
    exchange.bus.send(
        messages.SET_SENSOR_RATE.frame(board, period),
        messages.SET_STRAIN_MODE.frame(board, mode),
    )


class CanSkin(CanSensors):
    """``canBusSkin``: the taxels of the boards of ``canAddresses``, twelve for each of their sixteen triangles.

    Values are those of the boards, 0 to 255. A board is well while any of its triangles sends. With ``triangles``, the
    number of all of them, the last board has the rest of them.
    """

    def configure(self, configuration: Property) -> list[Sensor]:
        addresses = addresses_of(configuration)
        all_of_them = _TRIANGLES * len(addresses)
        triangles = parameters.count(configuration, "triangles", all_of_them, all_of_them)
        sizes = [min(max(triangles - place * _TRIANGLES, 0), _TRIANGLES) for place in range(len(addresses))]
        self._patches = {
            board: Sensor(SensorCategory.SKIN_PATCH, SensorInfo(f"{self.name}_{board}"), np.zeros(size * _TAXELS))
            for board, size in zip(addresses, sizes, strict=True)
        }
        #: The latest messages of the triangles of each board in order, by identifier and whether it is the second one.
        self._parts = {
            board: {
                (message.identifier(board), second): bytes(_SIZE)
                for message in messages.SKIN[: one.values.size // _TAXELS]
                for second in (False, True)
            }
            for board, one in self._patches.items()
        }
        return list(self._patches.values())

    def identifiers(self) -> list[int]:
        return [one.identifier(board) for board in self._patches for one in messages.SKIN]

    def receive(self, frame: Frame, stamp: float) -> None:
        """Keep a message until the taxels are read: fifty readings a second are asked for, and hundreds come."""
        identifier, data = frame
        if len(data) != _SIZE:
            super().receive(frame, stamp)
            return
        key, board = (identifier, data[0] >= _SECOND_PART), identifier >> 4 & 0xF
        if key in self._parts[board]:  # others are of a triangle that the configuration does not know
            self._parts[board][key] = data
            self._patches[board].stamp = stamp

    def take(self, got: Decoded, stamp: float) -> None:
        """See CanSensors. No other message has these identifiers."""

    def refresh(self) -> None:
        for board, parts in self._parts.items():
            table = np.frombuffer(b"".join(parts.values()), np.uint8).reshape(-1, 2, _SIZE)
            first, second = table[:, 0, 1 : 1 + _FIRST], table[:, 1, 1 : 1 + _TAXELS - _FIRST]
            self._patches[board].values = np.hstack([first, second]).ravel().astype(np.float64)
