"""The skin wrapper: an analog server that brings its sensor with it, and whose ports are called after the robot."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import as_string
from rtf.robot import parameters
from rtf.robot.device import make_device
from rtf.robot.errors import ConfigurationError
from rtf.robot.interfaces import IAnalogSensor
from rtf.robot.sensors.analog import MAX_CHANNELS, AnalogDevice

if TYPE_CHECKING:
    from rtf.bottle import Property
    from rtf.robot.device import Device
    from rtf.robot.sensors.analog import AnalogServer


class SkinWrapper(AnalogDevice):
    """``skinWrapper``: publishes ``total_taxels`` channels at ``/ROBOT/skin``, ROBOT being ``robotName``.

    Without ``robotName`` they are at ``name``; ``ports`` and ``period`` are those of ``analogServer``. ``subdevice`` is
    the type of a sensor that is opened with the same configuration, and with ``total_taxels`` as its ``channels`` if it
    names none; without it a sensor is attached.
    """

    default_name = ""  # robotName stands for it
    _sensor: Device | None = None

    def open(self, configuration: Property) -> None:
        """Read the configuration, and open and serve the ``subdevice``. Raises ConfigurationError, DeviceError."""
        super().open(configuration)
        kind = configuration.find("subdevice")
        if kind is None:
            return
        inner = configuration.copy()
        if not inner.check("channels"):
            inner.put("channels", self._taxels)
        kind = as_string(kind)
        self._sensor = make_device(kind, inner, name=f"{self.name}.{kind}", network=self._given_network)
        try:
            self.attach({self._sensor.name: self._sensor})
        except BaseException:
            self.close()
            raise

    def configure(self, configuration: Property) -> None:
        if configuration.check("robotName"):
            robot = as_string(configuration.find("robotName")).strip("/")
            if not robot:
                raise parameters.wrong(configuration, "robotName", "it is the name of a robot, such as icub")
            self.port_name = f"/{robot}/skin"
        elif not self.port_name:
            raise parameters.wrong(configuration, "robotName", "it is missing, and so is name")
        if not configuration.check("total_taxels"):
            raise parameters.wrong(configuration, "total_taxels", "it is missing; it is the number of channels")
        self._taxels = parameters.count(configuration, "total_taxels", 1, MAX_CHANNELS)
        super().configure(configuration)

    def serve(self, device: Device) -> AnalogServer:
        """Open the server. Raises ConfigurationError for a sensor that has not ``total_taxels`` channels."""
        channels = device.view(IAnalogSensor).channels()  # type: ignore[type-abstract]  # it is only looked for
        if channels != self._taxels:
            raise ConfigurationError(f"total_taxels is {self._taxels}, and {device.name} has {channels} channels")
        return super().serve(device)

    def close(self) -> None:
        super().close()
        if self._sensor is not None:
            self._sensor.close()
            self._sensor = None
