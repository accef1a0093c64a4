"""The device of the iCub's files for analog boards on CAN, whatever they measure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import Property, as_string
from rtf.robot import parameters
from rtf.robot.device import Device
from rtf.robot.devices.can.sensors import CanMais, CanStrain
from rtf.robot.errors import DeviceError

if TYPE_CHECKING:
    from rtf.robot.devices.can.sensor_base import CanSensors

_STRAIN, _MAIS = 6, (15, 16)
#: The parameters of the iCub's files, without their capital letters, and ours.
_NAMES = {"canaddress": "canAddress", "period": "period", "usecalibration": "useCalibration", "channels": "channels"}


class CanAnalog(Device):
    """``canBusAnalogSensor``: a force-torque sensor (6 ``channels``), or the hall sensors of a hand (15 or 16).

    Parameters are those of ``canBusStrain`` and ``canBusMais``, with any capital letters; ``canAddress`` may be
    hexadecimal, such as 0x0D. A board has 15 sensors also where a file says 16 channels.
    """

    _inner: CanSensors | None = None

    @property
    def implementation(self) -> Device:
        if self._inner is None:
            raise DeviceError(f"{self.name} is not open")
        return self._inner

    def open(self, configuration: Property) -> None:
        self.close()
        given = Property()
        for key, group in configuration.items():
            given.put(_NAMES.get(key.lower(), key), *group[1:], location=configuration.location(key))
        address = as_string(given.get("canAddress", ""))
        if address.lower().startswith("0x"):
            given.put("canAddress", int(address, 16), location=given.location("canAddress"))
        channels = parameters.count(given, "channels", _STRAIN, _MAIS[-1])
        if channels != _STRAIN and channels not in _MAIS:
            raise parameters.wrong(given, "channels", f"{channels} are neither 6, of forces, nor 15 or 16, of a hand")
        made = (CanStrain if channels == _STRAIN else CanMais)(self.name, network=self.network)
        made.open(given)
        self._inner = made

    def close(self) -> None:
        """Give the bus back."""
        if self._inner is not None:
            self._inner.close()
        self._inner = None
