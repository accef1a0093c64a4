"""Base class of server devices of a configuration, which publish another device's data periodically."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, ClassVar, Protocol, TypeVar

from rtf import clock
from rtf.middleware.errors import MiddlewareError
from rtf.robot import parameters
from rtf.robot.device import Device, make_device
from rtf.robot.errors import DeviceError, RobotError
from rtf.robot.network.ros_group import read_ros_group
from rtf.robot.publishing import PeriodicPublishing, Publisher, PublishingClock

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.bottle import Property
    from rtf.robot.network.ros_group import RosGroup
    from rtf.robot.publishing import Outlets

T = TypeVar("T")
#: The shortest period in seconds; a shorter one would keep a thread busy all the time.
SHORTEST = 1e-4


class Server(Publisher, Protocol):
    """A publisher with ports."""

    def close(self) -> None:
        """Close the ports."""


class PublishingDevice(Device):
    """A server as a device of a configuration: ``name`` is the prefix of its ports, ``period`` its period.

    ``attach`` takes the one device to serve, opens the ports and starts to publish: in a thread of its own, or by the
    simulation whose clock is that of this process.
    """

    #: The unit of ``period`` in seconds, and its default; None: it is required.
    unit: ClassVar[float] = 1.0
    default_period: ClassVar[float | None] = None
    default_name: ClassVar[str | None] = None
    #: The type of the device that publishes the same data on a topic of ROS 1, and that of the messages; see the group
    #: ``ROS``. Empty: there is none.
    ros_device: ClassVar[str] = ""
    ros_message: ClassVar[str] = ""

    server: Server | None = None
    _publishing: PeriodicPublishing | None = None
    _ros_group: RosGroup | None = None
    _topic: Device | None = None
    _configuration: Property | None = None

    @property
    def outlets(self) -> Outlets | None:
        """Where the server opens its streams: those of a simulation; None: ports that send in the background."""
        time = clock.current()
        return time.outlets if isinstance(time, PublishingClock) else None

    def open(self, configuration: Property) -> None:
        """Read the configuration. Raises ConfigurationError."""
        self.port_name = parameters.port_name(configuration, "name", self.default_name)
        self.period = parameters.positive(configuration, "period", self.default_period) * self.unit
        if self.period < SHORTEST:
            raise parameters.wrong(configuration, "period", f"{self.period:g} s is shorter than {SHORTEST:g} s")
        self._ros_group = read_ros_group(configuration, self.period, self.ros_message)
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
        if self.server is not None or self._topic is not None:
            raise DeviceError(f"{self.name} is attached already; detach it first")
        if len(devices) != 1:
            raise DeviceError(f"{self.name} serves one device, not {len(devices)} ({', '.join(devices) or 'none'})")
        if self._ros_group is not None:
            self._topic = self._publish_on_topic(self._ros_group, devices)
        if self._ros_group is None or not self._ros_group.alone:
            self._publish_on_ports(*devices.items())

    def _publish_on_ports(self, attached: tuple[str, Device]) -> None:
        name, device = attached
        try:
            self.server = self.serve(device)
        except (MiddlewareError, RobotError) as error:
            self.detach()
            raise DeviceError(f"{self.name} cannot be attached to {name}: {error}") from error
        report = self.network.report
        self._publishing = PeriodicPublishing(
            self.server, name=self.name, report=lambda said: report(f"{self.name}: {said}")
        )

    def _publish_on_topic(self, group: RosGroup, devices: Mapping[str, Device]) -> Device:
        topic = make_device(self.ros_device, group.configuration, name=f"{self.name}.ROS", network=self._given_network)
        try:
            topic.attach(devices)
        except Exception:
            topic.close()
            raise
        return topic

    def detach(self) -> None:
        """Stop publishing and close the ports."""
        if self._topic is not None:
            self._topic.close()
            self._topic = None
        if self._publishing is not None:
            self._publishing.stop()
            self._publishing = None
        if self.server is not None:
            self.server.close()
            self.server = None

    def close(self) -> None:
        self.detach()
        self._configuration = None
