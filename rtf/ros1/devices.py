"""Devices of a robot interface that publish other devices on topics of ROS 1.

Their parameters are ``node_name``, ``topic_name``, ``period`` in s and, where there is a frame, ``frame_id``. Servers
with a group ``ROS`` make them (:mod:`rtf.robot.network.ros_group`). Devices of one process may have the same node.
"""

from __future__ import annotations

from abc import abstractmethod
from contextlib import ExitStack
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from rtf.bottle import as_string
from rtf.robot import parameters
from rtf.robot.errors import ConfigurationError, DeviceError
from rtf.robot.interfaces import IAnalogSensor, IAxisInfo, IFrameGrabber, IMultipleAnalogSensors, SensorCategory
from rtf.robot.network.publishing_device import SHORTEST, PublishingDevice
from rtf.ros.errors import RosError
from rtf.ros.robot import Force, Inertia, PartStates, picture_from, quaternion_of
from rtf.ros1.bridge import Topics
from rtf.ros1.nodes import shared_node

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.bottle import Property
    from rtf.robot.device import Device
    from rtf.ros.robot import JointStates

_WRENCH = 6
_IMU = SensorCategory.ORIENTATION, SensorCategory.GYROSCOPE, SensorCategory.ACCELEROMETER


class TopicServer:
    """A topic to which something is published every ``period`` s, on a node that it uses until it is closed."""

    def __init__(self, period: float, publish: Callable[[float], None], opened: ExitStack) -> None:
        self.period, self._publish, self._opened = period, publish, opened

    def publish(self, now: float) -> None:
        """Publish what is newest."""
        self._publish(now)

    def close(self) -> None:
        """Leave the node."""
        self._opened.close()


class TopicDevice(PublishingDevice):
    """The base class of these devices."""

    default_period: ClassVar[float | None] = 0.02

    def open(self, configuration: Property) -> None:
        """Read the configuration. Raises ConfigurationError."""
        self.node_name = _required(configuration, "node_name", "/icub/left_arm")
        self.topic = _required(configuration, "topic_name", "/joint_states")
        self.frame = as_string(configuration.get("frame_id", ""))
        self.period = parameters.positive(configuration, "period", self.default_period)
        if self.period < SHORTEST:
            raise parameters.wrong(configuration, "period", f"{self.period:g} s is shorter than {SHORTEST:g} s")
        self.configure(configuration)
        self._configuration = configuration

    def serve(self, device: Device) -> TopicServer:
        """Publish a device. Raises DeviceError without a master, NotSupportedError for a device of another kind."""
        with ExitStack() as opened:
            try:
                node = opened.enter_context(shared_node(self.node_name, self.network.report))
                return TopicServer(self.period, self.reader(device, Topics(node)), opened.pop_all())
            except RosError as error:
                raise DeviceError(f"{self.name} cannot publish on {self.topic}: {error}") from error

    @abstractmethod
    def reader(self, device: Device, topics: Topics) -> Callable[[float], None]:
        """Return the function that publishes the device."""


class ControlBoardTopic(TopicDevice):
    """``controlBoard_nws_ros``: each new state of a board as ``sensor_msgs/JointState``, in rad and m.

    ``jointNames`` are the names in the messages; the default are those of the axes.
    """

    def configure(self, configuration: Property) -> None:
        self._names = list(parameters.names(configuration, "jointNames"))

    def reader(self, device: Device, topics: Topics) -> Callable[[float], None]:
        board = device.implementation
        axes = board.view(IAxisInfo).axes()  # type: ignore[type-abstract]  # it is only looked for
        if self._names and len(self._names) != axes:
            raise ConfigurationError(f"{self.name}: {len(self._names)} jointNames for {axes} axes")
        states, send = PartStates(board), topics.joint_states(self.topic)

        def publish(_now: float) -> None:
            state = states.newest()
            if state is not None:
                send(self._named(state))

        return publish

    def _named(self, state: JointStates) -> JointStates:
        return replace(state, names=self._names) if self._names else state


class FrameGrabberTopic(TopicDevice):
    """``frameGrabber_nws_ros``: each new picture of a camera as ``sensor_msgs/Image``."""

    default_period = 0.033

    def reader(self, device: Device, topics: Topics) -> Callable[[float], None]:
        camera = device.view(IFrameGrabber)  # type: ignore[type-abstract]  # it is only looked for
        send = topics.pictures(self.topic)
        last: list[float] = []

        def publish(_now: float) -> None:
            image, time = camera.image()
            if last != [time]:
                last[:] = [time]
                send(picture_from(image, time, self.name, self.frame))

        return publish


class WrenchTopic(TopicDevice):
    """``wrenchStamped_nws_ros``: the six channels of an analogue sensor as ``geometry_msgs/WrenchStamped``."""

    def reader(self, device: Device, topics: Topics) -> Callable[[float], None]:
        sensor = device.view(IAnalogSensor)  # type: ignore[type-abstract]  # it is only looked for
        if sensor.channels() != _WRENCH:
            raise ConfigurationError(f"{self.name}: {sensor.channels()} channels are no force and torque")
        send = topics.forces(self.topic)

        def publish(_now: float) -> None:
            reading = sensor.read()
            send(Force(reading.time, self.frame, reading.values.tolist()))

        return publish


class ImuTopic(TopicDevice):
    """``imu_nws_ros``: the first orientation, gyroscope and accelerometer of a device as ``sensor_msgs/Imu``."""

    def reader(self, device: Device, topics: Topics) -> Callable[[float], None]:
        sensors = device.view(IMultipleAnalogSensors)  # type: ignore[type-abstract]  # it is only looked for
        missing = [one.name for one in _IMU if not sensors.sensors(one)]
        if missing:
            raise ConfigurationError(f"{self.name}: there is no {' and no '.join(missing)}")
        send = topics.inertias(self.topic)

        def publish(_now: float) -> None:
            angles, speed, acceleration = (sensors.read_sensor(one, 0) for one in _IMU)
            turn, radians = quaternion_of(*angles.values), np.radians(speed.values).tolist()
            send(Inertia(angles.time, self.frame, turn, radians, acceleration.values.tolist()))

        return publish


def _required(configuration: Property, key: str, example: str) -> str:
    found = as_string(configuration.get(key, ""))
    if not found:
        raise parameters.wrong(configuration, key, f"it is missing; it is a name such as {example}")
    return found
