"""The base class of devices: opened with a configuration, possibly attached to others, and closed."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, TypeVar

from rtf.bottle import Property
from rtf.errors import did_you_mean
from rtf.robot.errors import ConfigurationError, DeviceError, NotSupportedError
from rtf.testing.plugins import PluginNotFoundError, PluginRef, find, installed, load_class

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from rtf.middleware.ports.network import Network

T = TypeVar("T")
#: The names of types that can be plug-ins; one with a slash would name any file.
_NAME = re.compile(r"[\w.-]+")


def _family(module: str, **classes: str) -> dict[str, str]:
    """Return the rows of device types whose classes are in one module: the driver, the server and the client."""
    return {kind: f"{module}:{name}" for kind, name in classes.items()}


#: The devices of this package, as entry points have them: type -> module and class, imported on use.
SHIPPED: Mapping[str, str] = {
    "fakeMotionControl": "rtf.robot.devices.fake_board:FakeBoard",
    "fakeIMU": "rtf.robot.devices.fake_sensors:FakeImu",
    "fakeFrameGrabber": "rtf.robot.devices.fake_camera:FakeFrameGrabber",
    "fakeAnalogSensor": "rtf.robot.devices.fake_sensors:FakeAnalogSensor",
    "controlBoard_nws_yarp": "rtf.robot.boards.server:ControlBoardDevice",
    "controlboardwrapper2": "rtf.robot.boards.server:ControlBoardWrapperDevice",
    "controlboardremapper": "rtf.robot.devices.remapper:ControlBoardRemapper",
    "remote_controlboard": "rtf.robot.yarp3.client:RemoteControlBoard",
    "controlBoard_nwc_yarp": "rtf.robot.yarp4.client:ControlBoardServiceClient",
    "remotecontrolboardremapper": "rtf.robot.boards.remapper:RemoteControlBoardRemapper",
    "multipleanalogsensorsserver": "rtf.robot.sensors.analog_sensors:AnalogSensorsDevice",
    "multipleanalogsensorsclient": "rtf.robot.sensors.analog_sensors:AnalogSensorsClient",
    "multipleanalogsensorsremapper": "rtf.robot.devices.analog_sensors_remapper:AnalogSensorsRemapper",
    "analogServer": "rtf.robot.sensors.analog:AnalogDevice",
    "analogsensorclient": "rtf.robot.sensors.analog:AnalogClient",
    "skinWrapper": "rtf.robot.sensors.skin_wrapper:SkinWrapper",
    "inertial": "rtf.robot.sensors.inertial:InertialDevice",
    "frameGrabber_nws_yarp": "rtf.robot.sensors.camera:FrameGrabberDevice",
    "frameGrabber_nwc_yarp": "rtf.robot.sensors.camera:FrameGrabberClient",
    "canBus": "rtf.robot.devices.can.bus_device:CanBusDevice",
    "canMotionControl": "rtf.robot.devices.can.motion_control:CanMotionControl",
    "canBusMotionControl": "rtf.robot.devices.can.motion_control:CanMotionControl",
    "canbusmotioncontrol": "rtf.robot.devices.can.motion_control:CanMotionControl",
    "canmotioncontrol": "rtf.robot.devices.can.motion_control:CanMotionControl",
    "canBusAnalogSensor": "rtf.robot.devices.can.analog:CanAnalog",
    "canBus_nws_yarp": "rtf.robot.boards.can_frames:CanFramesDevice",
    **_family(
        "rtf.robot.devices.can.sensors",
        canBusStrain="CanStrain",
        canBusMais="CanMais",
        canBusInertialMTB="CanInertial",
        canBusSkin="CanSkin",
    ),
    "cartesiancontrollerserver": "rtf.robot.cartesian.device:CartesianControllerDevice",
    "cartesiancontrollerclient": "rtf.robot.cartesian.client:CartesianClient",
    "gazecontrollerserver": "rtf.robot.gaze.device:GazeControllerDevice",
    "gazecontrollerclient": "rtf.robot.gaze.client:GazeClient",
    "icubCalibrator": "rtf.robot.devices.calibrator:BoardCalibrator",
    **_family(
        "rtf.robot.sensors.battery",
        fakeBattery="FakeBattery",
        battery_nws_yarp="BatteryServerDevice",
        battery_nwc_yarp="BatteryClient",
    ),
    **_family(
        "rtf.robot.sensors.rgbd",
        fakeDepthCamera="FakeDepthCamera",
        rgbdSensor_nws_yarp="RgbdServerDevice",
        RGBDSensor_nws_yarp="RgbdServerDevice",
        RGBDSensorClient="RgbdClient",
        RGBDSensor_nwc_yarp="RgbdClient",
    ),
    **_family(
        "rtf.ros1.devices",
        controlBoard_nws_ros="ControlBoardTopic",
        frameGrabber_nws_ros="FrameGrabberTopic",
        imu_nws_ros="ImuTopic",
        wrenchStamped_nws_ros="WrenchTopic",
    ),
    "ros2ControlBoard": "rtf.ros2.board:Ros2Board",
    **_family(
        "rtf.ros2.sensors",
        ros2ForceTorque="Ros2ForceTorque",
        ros2Imu="Ros2Imu",
        ros2Camera="Ros2Camera",
    ),
    "simulatedRobot": "rtf.simulator.simulation_device:SimulationDevice",
    "simulatedICub": "rtf.simulator.simulation_device:SimulationDevice",
    **_family(
        "rtf.simulator.attached_devices",
        simulatedBoard="AttachedBoard",
        simulatedForceTorque="AttachedForceTorque",
        simulatedImu="AttachedImu",
        simulatedAngles="AttachedAngles",
        simulatedSkin="AttachedSkin",
        simulatedBattery="AttachedBattery",
        simulatedCamera="AttachedCamera",
        simulatedDepthCamera="AttachedDepthCamera",
    ),
}


class DeviceProvider(ABC):
    """A class that a device type may name: a device, or a driver from which a device is made."""

    @classmethod
    @abstractmethod
    def device_type(cls) -> type[Device]:
        """Return the class of the device."""


class Device(DeviceProvider):
    """A driver, a network stub or a controller: constructed, opened, perhaps attached to other devices, closed.

    ``name`` is the name in the configuration, for messages; ``network`` the network of its ports, None: that of the
    process. One thread opens and closes it; the methods of its interfaces may be called from any thread.
    """

    def __init__(self, name: str = "", *, network: Network | None = None) -> None:
        self.name = name or type(self).__name__
        self._given_network = network

    @classmethod
    def device_type(cls) -> type[Device]:
        """Return this class."""
        return cls

    @property
    def network(self) -> Network:
        """The network of the device's ports."""
        from rtf.middleware.ports.network import default_network

        return self._given_network or default_network()

    @abstractmethod
    def open(self, configuration: Property) -> None:
        """Open the device. Raises ConfigurationError for invalid parameters, DeviceError if it cannot be opened.

        A device whose ``open`` failed holds no resources.
        """

    @abstractmethod
    def close(self) -> None:
        """Close the device and release its resources; allowed in any state, and repeatedly."""

    def attach(self, devices: Mapping[str, Device]) -> None:
        """Use these open devices from now on; the keys are their names in the configuration.

        Raises NotSupportedError if this device does not use others, DeviceError if these are not suitable.
        """
        raise NotSupportedError(f"{self.name} ({type(self).__name__}) cannot be attached to {', '.join(devices)}")

    def detach(self) -> None:
        """Stop using the attached devices. Has no effect if there are none."""

    @property
    def implementation(self) -> Device:
        """The device that has the interfaces: itself, unless it stands for a device that another one has.

        Raises DeviceError while there is none.
        """
        return self

    def view(self, interface: type[T]) -> T:
        """Return the device as an interface. Raises NotSupportedError, naming both, if it does not implement it."""
        found = self.implementation
        if isinstance(found, interface):
            return found
        raise NotSupportedError(f"{self.name} ({type(found).__name__}) has no {interface.__name__}")


class Calibrator(Device):
    """A device that calibrates another one, and brings it to its home or parking pose.

    The calls block until the movement is done. ``abort`` may be called from another thread and makes them raise
    DeviceError soon.
    """

    @abstractmethod
    def calibrate(self, target: Device) -> None:
        """Find the zero of every joint of the target, and leave it at the startup pose."""

    @abstractmethod
    def home(self, target: Device) -> None:
        """Move every joint of the target to its home pose."""

    @abstractmethod
    def park(self, target: Device) -> None:
        """Move every joint of the target to its parking pose, where it may be switched off."""

    @abstractmethod
    def abort(self) -> None:
        """Abort the movement in progress; the joints stop where they are."""


def find_device(kind: str, beside: Path | None = None) -> type[Device]:
    """Return the class of a device type.

    It is from an installed package (entry point), else from this one, else from a plug-in file of kind ``device``: one
    with the name of the type, or with a class of that name. ``beside`` is the folder to look in first, that of the
    robot's file.
    Raises ConfigurationError for an unknown type, and DeviceError if its code cannot be imported.
    """
    places = {**SHIPPED, **{name: point.value for name, point in installed("device").items()}}
    try:
        ref = PluginRef("device", kind, places[kind], "entry point") if kind in places else _in_a_file(kind, beside)
    except PluginNotFoundError as error:
        hint = did_you_mean(kind, places) or f"; the known types are {', '.join(sorted(places))}"
        raise ConfigurationError(f"there is no device type {kind!r}{hint}") from error
    try:
        return load_class(ref, DeviceProvider).device_type()  # type: ignore[type-abstract]
    except Exception as error:
        raise DeviceError(f"the device {kind!r} cannot be loaded: {type(error).__name__}: {error}") from error


def _in_a_file(kind: str, beside: Path | None) -> PluginRef:
    if not _NAME.fullmatch(kind):
        raise PluginNotFoundError(f"{kind!r} is not a name of a plug-in")
    return find("device", kind, "python", beside=beside)


def make_device(
    kind: str,
    configuration: Property | None = None,
    *,
    name: str = "",
    network: Network | None = None,
    beside: Path | None = None,
) -> Device:
    """Return an open device of a type. Raises the errors of ``find_device`` and ``Device.open``."""
    device = find_device(kind, beside)(name or kind, network=network)
    device.open(configuration or Property())
    return device
