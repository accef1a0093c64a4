"""Base class of sensors on a CAN bus: readings that boards send by themselves, through both interfaces of sensors."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rtf import clock
from rtf.bottle import Bottle
from rtf.robot import parameters
from rtf.robot.device import Device
from rtf.robot.devices.can.axis_link import NEVER
from rtf.robot.devices.can.bus import CanBus, share, unshare
from rtf.robot.devices.can.bus_settings import bus_settings
from rtf.robot.devices.can.codec import decode
from rtf.robot.devices.can.exchange import TIMEOUT as ANSWER
from rtf.robot.devices.can.exchange import Exchange
from rtf.robot.devices.can.messages import ADDRESSES
from rtf.robot.errors import DeviceError, MessageError, RefusedError, StaleStateError
from rtf.robot.interfaces import (
    FloatArray,
    IAnalogSensor,
    IMultipleAnalogSensors,
    SensorCategory,
    SensorInfo,
    SensorReading,
    SensorStatus,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from rtf.bottle import Property
    from rtf.robot.devices.can.codec import Decoded
    from rtf.robot.devices.can.codes import BoardType
    from rtf.robot.devices.can.messages import Frame

#: Seconds after which a reading is too old, unless the parameter ``timeout`` (ms) says otherwise.
TIMEOUT = 0.1


@dataclass(slots=True)
class Sensor:
    """A sensor: its latest values, which are replaced and never changed, and their time (s)."""

    category: SensorCategory
    info: SensorInfo
    values: FloatArray
    stamp: float = NEVER
    saturated: bool = False

    def put(self, values: FloatArray, stamp: float, *, saturated: bool = False) -> None:
        """Replace the values."""
        self.values, self.stamp, self.saturated = values, stamp, saturated


class CanSensors(Device, IAnalogSensor, IMultipleAnalogSensors):
    """Sensors of some boards. A subclass says which, what is asked at the start, and what their messages mean.

    As an analog sensor, the channels are the values of all sensors in order, minus the offsets of ``calibrate``.
    """

    _bus: CanBus | None = None
    _end: Callable[[], None] | None = None

    @abstractmethod
    def configure(self, configuration: Property) -> list[Sensor]:
        """Read the parameters, and return the sensors. Raises ConfigurationError."""

    @abstractmethod
    def identifiers(self) -> Iterable[int]:
        """Return the identifiers of the messages of the boards."""

    @abstractmethod
    def take(self, got: Decoded, stamp: float) -> None:
        """Keep the values of a message. Called by the thread of the bus."""

    def refresh(self) -> None:
        """Bring the values up to date before they are read; for sensors whose messages are many."""

    def begin(self, exchange: Exchange) -> None:
        """Have the boards send. Raises DeviceError."""

    def open(self, configuration: Property) -> None:
        self.close()
        self.all_sensors = self.configure(configuration)
        self.offsets = np.zeros(sum(one.values.size for one in self.all_sensors))
        self._timeout = parameters.positive(configuration, "timeout", TIMEOUT * 1e3) * 1e-3
        self._damaged = 0
        self._bus = share(bus_settings(configuration), self.network.report)
        try:
            self._end = self._bus.subscribe(self.receive, self.identifiers())
            can = parameters.group_of(configuration, "CAN")
            exchange = Exchange(self._bus, parameters.positive(can, "CanTimeout", ANSWER * 1e3) * 1e-3)
            try:
                self.begin(exchange)
            finally:
                exchange.close()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Give the bus back. The boards go on sending."""
        if self._end is not None:
            self._end()
        if self._bus is not None:
            unshare(self._bus)
        self._bus = self._end = None

    def receive(self, frame: Frame, stamp: float) -> None:
        """Take a frame of the boards. Called by the thread of the bus."""
        try:
            got = decode(*frame)
        except MessageError as error:
            self._damaged += 1
            if self._damaged == 1:
                self.network.report(f"{self.name}: {error} (the first of such frames; they are ignored)")
            return
        self.take(got, stamp)

    # IMultipleAnalogSensors ------------------------------------------------------------------------------------------

    def _of(self, category: SensorCategory) -> list[Sensor]:
        return [one for one in self.all_sensors if one.category is category]

    def sensors(self, category: SensorCategory) -> Sequence[SensorInfo]:
        return [one.info for one in self._of(category)]

    def sensor_status(self, category: SensorCategory, index: int) -> SensorStatus:
        return self._status(self._sensor(category, index))

    def read_sensor(self, category: SensorCategory, index: int) -> SensorReading:
        one = self._sensor(category, index)
        status = self._status(one)
        if status is not SensorStatus.OK:
            raise RefusedError(f"{self.name}: {one.info.name} has the status {status.name}")
        self.refresh()
        return SensorReading(one.values, one.stamp)

    def _sensor(self, category: SensorCategory, index: int) -> Sensor:
        found = self._of(category)
        if not 0 <= index < len(found):
            raise RefusedError(f"{self.name} has {len(found)} sensors of the category {category.name}, and no {index}")
        return found[index]

    def _status(self, one: Sensor) -> SensorStatus:
        if self._bus is None or one.stamp == NEVER:
            return SensorStatus.WAITING_FOR_FIRST_READ
        if clock.current().now() - one.stamp > self._timeout:
            return SensorStatus.TIMEOUT
        return SensorStatus.OVERFLOW if one.saturated else SensorStatus.OK

    # IAnalogSensor ---------------------------------------------------------------------------------------------------

    def channels(self) -> int:
        return int(self.offsets.size)

    def read(self) -> SensorReading:
        """See IAnalogSensor. A reading with saturated channels is one, too."""
        values, stamp = self._raw()
        return SensorReading(values - self.offsets, stamp)

    def _raw(self) -> tuple[FloatArray, float]:
        for one in self.all_sensors:
            if self._status(one) in (SensorStatus.TIMEOUT, SensorStatus.WAITING_FOR_FIRST_READ):
                raise StaleStateError(f"{self.name}: {one.info.name} has sent nothing for {self._timeout:g} s")
        self.refresh()
        return np.concatenate([one.values for one in self.all_sensors]), min(one.stamp for one in self.all_sensors)

    def calibrate(self, channel: int | None = None, value: float | None = None) -> None:
        offsets = self._raw()[0] - (value or 0.0)
        if channel is None:
            self.offsets = offsets
        elif 0 <= channel < self.offsets.size:
            changed = self.offsets.copy()
            changed[channel] = offsets[channel]
            self.offsets = changed
        else:
            raise RefusedError(f"{self.name} has {self.offsets.size} channels, counted from 0, and no {channel}")


def address_of(configuration: Property, key: str = "canAddress") -> int:
    """Return the address of a board. Raises ConfigurationError."""
    found = addresses_of(configuration, key)
    if len(found) != 1:
        raise parameters.wrong(configuration, key, f"{found} is not the address of one board")
    return found[0]


def addresses_of(configuration: Property, key: str = "canAddresses") -> list[int]:
    """Return addresses of boards, ``1 2 3`` or ``(1 2 3)``. Raises ConfigurationError."""
    group = configuration.find_group(key)
    given = [] if group is None else list(group[1:])
    if given and isinstance(given[0], Bottle):
        given = list(given[0])
    found = [one for one in given if isinstance(one, int) and one in ADDRESSES]
    if not found or len(found) != len(given) or len(set(found)) != len(found):
        raise parameters.wrong(configuration, key, "it is a list of addresses of boards, 1 to 14, each once")
    return found


def check_type(exchange: Exchange, board: int, types: frozenset[BoardType]) -> None:
    """Ask a board for its version. Raises DeviceError if it does not answer, or is of another type."""
    found = exchange.version(board, sensor=True)
    if found.board_type not in types:
        wanted = " or ".join(sorted(one.name for one in types))
        raise DeviceError(f"board {board} on {exchange.bus.name} is a {found.type_name}, not a {wanted}")
