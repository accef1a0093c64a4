"""What every device is: something that is opened with a configuration, may be attached to others, and is closed."""

from __future__ import annotations

from abc import ABC, abstractmethod
from importlib import import_module, metadata
from typing import TYPE_CHECKING, TypeVar

from rtf.bottle import Property
from rtf.robot.errors import ConfigurationError, DeviceError, NotSupportedError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.middleware.network import Network

T = TypeVar("T")
#: The group of entry points by which packages offer devices: the name is the type that a configuration names.
ENTRY_POINTS = "rtf.devices"

#: The devices that come with the framework: type -> module and class. Loaded when they are named.
SHIPPED: Mapping[str, str] = {
    "fakeMotionControl": "rtf.robot.devices.fake_board:FakeBoard",
    "fakeIMU": "rtf.robot.devices.fake_sensors:FakeImu",
    "fakeFrameGrabber": "rtf.robot.devices.fake_camera:FakeFrameGrabber",
    "fakeAnalogSensor": "rtf.robot.devices.fake_sensors:FakeAnalogSensor",
    "controlBoard_nws_yarp": "rtf.robot.server.control_board:ControlBoardDevice",
    "controlboardwrapper2": "rtf.robot.server.control_board:ControlBoardWrapperDevice",
    "controlboardremapper": "rtf.robot.devices.remapper:ControlBoardRemapper",
    "remote_controlboard": "rtf.robot.client.control_board:RemoteControlBoard",
    "controlBoard_nwc_yarp": "rtf.robot.client.control_board_service:ControlBoardServiceClient",
    "remotecontrolboardremapper": "rtf.robot.client.remapper:RemoteControlBoardRemapper",
    "multipleanalogsensorsserver": "rtf.robot.server.analog_sensors:AnalogSensorsDevice",
    "multipleanalogsensorsclient": "rtf.robot.client.analog_sensors:AnalogSensorsClient",
    "multipleanalogsensorsremapper": "rtf.robot.devices.analog_sensors_remapper:AnalogSensorsRemapper",
    "analogServer": "rtf.robot.server.analog:AnalogDevice",
    "analogsensorclient": "rtf.robot.client.analog:AnalogClient",
    "inertial": "rtf.robot.server.inertial:InertialDevice",
    "frameGrabber_nws_yarp": "rtf.robot.server.frame_grabber:FrameGrabberDevice",
    "frameGrabber_nwc_yarp": "rtf.robot.client.frame_grabber:FrameGrabberClient",
    "icubCalibrator": "rtf.robot.devices.calibrator:BoardCalibrator",
    "simulatedICub": "rtf.simulator.device:SimulatedRobot",
    "simulatedBoard": "rtf.simulator.device:SimulatedBoard",
    "simulatedForceTorque": "rtf.simulator.sensor_devices:SimulatedForceTorqueDevice",
    "simulatedImu": "rtf.simulator.sensor_devices:SimulatedImuDevice",
}


class Device(ABC):
    """A driver, a stub or a controller. It is made, opened, perhaps attached to other devices, and closed.

    ``name`` is what the configuration calls it, for messages; ``network`` the network it opens ports in, the process's
    own without one. Opening and closing happen in one thread; what an interface says may be called from any.
    """

    def __init__(self, name: str = "", *, network: Network | None = None) -> None:
        self.name = name or type(self).__name__
        self._given_network = network

    @property
    def network(self) -> Network:
        """The network it opens ports in."""
        from rtf.middleware.network import default_network

        return self._given_network or default_network()

    @abstractmethod
    def open(self, configuration: Property) -> None:
        """Begin. Raises ConfigurationError for parameters that make no sense, DeviceError when it cannot be opened.

        A device whose opening failed holds nothing.
        """

    @abstractmethod
    def close(self) -> None:
        """End, and give back everything; safe in any state, and more than once."""

    def attach(self, devices: Mapping[str, Device]) -> None:
        """Work with these devices from now on, which are open; the keys are what the configuration calls them.

        Raises NotSupportedError when this device does not use others, DeviceError when these do not fit.
        """
        raise NotSupportedError(f"{self.name} ({type(self).__name__}) cannot be attached to {', '.join(devices)}")

    def detach(self) -> None:  # noqa: B027 - a device that is attached to nothing lets go of nothing
        """Let go of what it is attached to; nothing happens if it is not attached."""

    def view(self, interface: type[T]) -> T:
        """This device as an interface. Raises NotSupportedError, naming both, when it has not got it."""
        if isinstance(self, interface):
            return self
        raise NotSupportedError(f"{self.name} ({type(self).__name__}) has no {interface.__name__}")


class Calibrator(Device):
    """A device that brings another one to where it knows its position, and back to rest.

    The calls block until it is done; ``abort`` may come from another thread and makes them end soon with DeviceError.
    """

    @abstractmethod
    def calibrate(self, target: Device) -> None:
        """Find the zero of every joint of the target and leave it at its home pose."""

    @abstractmethod
    def home(self, target: Device) -> None:
        """Bring every joint of the target to its home pose."""

    @abstractmethod
    def park(self, target: Device) -> None:
        """Bring every joint of the target to its parking pose, where it may be switched off."""

    @abstractmethod
    def abort(self) -> None:
        """End what is going on; the joints stop where they are."""


def find_device(kind: str) -> type[Device]:
    """The class of a type of device: an installed package's (entry point), else one of the shipped.

    Raises ConfigurationError for a type that nobody offers, and DeviceError when its code cannot be loaded.
    """
    offered = {entry.name: entry for entry in metadata.entry_points(group=ENTRY_POINTS)}
    if kind not in offered and kind not in SHIPPED:
        known = ", ".join(sorted({*offered, *SHIPPED}))
        raise ConfigurationError(f"there is no type of device {kind!r}; known are {known}")
    try:
        found = offered[kind].load() if kind in offered else _load(SHIPPED[kind])
    except Exception as error:
        raise DeviceError(f"the device {kind!r} cannot be loaded: {type(error).__name__}: {error}") from error
    if not (isinstance(found, type) and issubclass(found, Device)):
        raise DeviceError(f"the entry point {kind!r} is no Device but {found!r}")
    return found


def make_device(
    kind: str, configuration: Property | None = None, *, name: str = "", network: Network | None = None
) -> Device:
    """A device of a type, opened. Errors as for ``find_device`` and ``Device.open``."""
    device = find_device(kind)(name or kind, network=network)
    device.open(configuration or Property())
    return device


def _load(place: str) -> object:
    module, _, attribute = place.partition(":")
    return getattr(import_module(module), attribute)
