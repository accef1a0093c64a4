"""The device ``canBus``: keeps a bus open for the devices on it, and reports what happens on it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.device import Device
from rtf.robot.devices.can.bus import CanBus, share, unshare
from rtf.robot.devices.can.bus_settings import bus_settings
from rtf.robot.errors import DeviceError

if TYPE_CHECKING:
    from rtf.bottle import Property


class CanBusDevice(Device):
    """``canBus``: the bus of the group ``CAN``. Boards on it need no such device, but share the bus with it."""

    _bus: CanBus | None = None

    @property
    def bus(self) -> CanBus:
        """The bus. Raises DeviceError while the device is closed."""
        if self._bus is None:
            raise DeviceError(f"{self.name} is not open")
        return self._bus

    def open(self, configuration: Property) -> None:
        self.close()
        self._bus = share(bus_settings(configuration), self.network.report)

    def close(self) -> None:
        """Give the bus back."""
        if self._bus is not None:
            unshare(self._bus)
            self._bus = None
