"""Base class of server devices of a configuration, which publish another device's data periodically."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, ClassVar, Protocol, TypeVar

from rtf.middleware.errors import MiddlewareError
from rtf.robot import parameters
from rtf.robot.device import Device
from rtf.robot.errors import ConfigurationError, DeviceError, NotSupportedError
from rtf.robot.periodic_thread import PeriodicThread, Publisher

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.bottle import Property

T = TypeVar("T")
#: The shortest period in seconds; a shorter one would keep a thread busy all the time.
SHORTEST = 1e-4


class Server(Publisher, Protocol):
    """A publisher with ports."""

    def close(self) -> None:
        """Close the ports."""


class PublishingDevice(Device):
    """A server as a device of a configuration: ``name`` is the prefix of its ports, ``period`` its period.

    ``attach`` takes the one device to serve, opens the ports and starts the publishing thread.
    """

    #: The unit of ``period`` in seconds, and its default; None: it is required.
    unit: ClassVar[float] = 1.0
    default_period: ClassVar[float | None] = None
    default_name: ClassVar[str | None] = None

    server: Server | None = None
    _thread: PeriodicThread | None = None
    _configuration: Property | None = None

    def open(self, configuration: Property) -> None:
        """Read the configuration. Raises ConfigurationError."""
        self.port_name = parameters.port_name(configuration, "name", self.default_name)
        self.period = parameters.positive(configuration, "period", self.default_period) * self.unit
        if self.period < SHORTEST:
            raise parameters.wrong(configuration, "period", f"{self.period:g} s is shorter than {SHORTEST:g} s")
        self.configure(configuration)
        self._configuration = configuration

    def configure(self, configuration: Property) -> None:
        """Read the parameters of this kind of device. Raises ConfigurationError."""

    @abstractmethod
    def serve(self, device: Device) -> Server:
        """Open the server of a device. Raises NotSupportedError for a device of another kind."""

    def attach(self, devices: Mapping[str, Device]) -> None:
        """Serve a device. Raises DeviceError."""
        if self._configuration is None:
            raise DeviceError(f"{self.name} is not open; open it before it is attached")
        if self.server is not None:
            raise DeviceError(f"{self.name} is attached already; detach it first")
        if len(devices) != 1:
            raise DeviceError(f"{self.name} serves one device, not {len(devices)} ({', '.join(devices) or 'none'})")
        [(name, device)] = devices.items()
        try:
            self.server = self.serve(device)
        except (MiddlewareError, NotSupportedError, ConfigurationError) as error:
            raise DeviceError(f"{self.name} cannot be attached to {name}: {error}") from error
        report = self.network.report
        self._thread = PeriodicThread(self.server, name=self.name, report=lambda said: report(f"{self.name}: {said}"))

    def detach(self) -> None:
        """Stop publishing and close the ports."""
        if self._thread is not None:
            self._thread.stop()
            self._thread = None
        if self.server is not None:
            self.server.close()
            self.server = None

    def close(self) -> None:
        self.detach()
        self._configuration = None
