"""Sensors of a ROS 2 robot as devices: force-torque sensors, inertial units, cameras."""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import TYPE_CHECKING, ClassVar, Generic

import numpy as np

from rtf import clock
from rtf.middleware.types import Image as Picture
from rtf.robot import parameters
from rtf.robot.device import Device
from rtf.robot.errors import DeviceError, NotSupportedError, RefusedError, StaleStateError
from rtf.robot.interfaces import (
    IAnalogSensor,
    IFrameGrabber,
    IMultipleAnalogSensors,
    SensorCategory,
    SensorInfo,
    SensorReading,
    SensorStatus,
)
from rtf.ros2.errors import Ros2Error
from rtf.ros2.messages import Image, Imu, Vector3, WrenchStamped
from rtf.ros2.node import M, Node, make_node
from rtf.ros2.stamps import StampMapping

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.bottle import Property
    from rtf.robot.interfaces import FloatArray

_CHANNELS = 6
#: Encodings of ROS, with the formats of YARP, and how the pixels lie.
_FORMATS = {
    "rgb8": ("rgb", np.uint8, 3),
    "bgr8": ("bgr", np.uint8, 3),
    "rgba8": ("rgba", np.uint8, 4),
    "mono8": ("mono", np.uint8, 1),
    "mono16": ("mo16", np.uint16, 1),
    "32FC1": ("dec", np.float32, 1),
}


class TopicDevice(Device, Generic[M]):
    """A device with the latest message of ``topic``. ``timeout`` (s, 0.5) is the greatest age of a message.

    ``namespace`` (``/``) and ``domain`` (ROS_DOMAIN_ID) are those of its node.
    """

    kind: ClassVar[type]
    _node: Node | None = None
    _message: M | None = None

    def open(self, configuration: Property) -> None:
        self.close()
        topic = parameters.text(configuration, "topic")
        self._timeout = parameters.positive(configuration, "timeout", 0.5)
        self._mapping = StampMapping()
        self._time, self._arrived = 0.0, -math.inf
        try:
            self._node = make_node(configuration, "rtf_sensor", self.network.report)
            self._node.subscribe(topic, self.kind, self._take)
        except Ros2Error as error:
            self.close()
            raise DeviceError(f"{self.name}: {error}") from error
        self.topic = self._node.full_name(topic)

    def close(self) -> None:
        """Leave the topic."""
        node, self._node, self._message = self._node, None, None
        if node is not None:
            node.close()

    def _take(self, message: M) -> None:
        now = clock.current().now()
        self._time = self._mapping.time_of(message.header.stamp.seconds, now)  # type: ignore[attr-defined]
        self._message, self._arrived = message, now

    def latest(self) -> M:
        """Return the latest message. Raises StaleStateError if there is none that is new enough."""
        message = self._message
        if message is None or clock.current().now() - self._arrived > self._timeout:
            raise StaleStateError(f"{self.name}: nothing has come on {self.topic} for {self._timeout:g} s")
        return message


class TopicSensors(TopicDevice[M], IMultipleAnalogSensors):
    """Sensors, one of each category, whose readings are in one message."""

    categories: ClassVar[tuple[SensorCategory, ...]]

    @abstractmethod
    def values(self, message: M, category: SensorCategory) -> FloatArray:
        """Return the reading of a category. Raises NotSupportedError if the message has none."""

    def sensors(self, category: SensorCategory) -> Sequence[SensorInfo]:
        if category not in self.categories:
            return ()
        message = self._message
        return (SensorInfo(self.name, message.header.frame_id if message else ""),)  # type: ignore[attr-defined]

    def sensor_status(self, category: SensorCategory, index: int) -> SensorStatus:
        self._check(category, index)
        if self._message is None:
            return SensorStatus.WAITING_FOR_FIRST_READ
        late = clock.current().now() - self._arrived > self._timeout
        return SensorStatus.TIMEOUT if late else SensorStatus.OK

    def read_sensor(self, category: SensorCategory, index: int) -> SensorReading:
        self._check(category, index)
        return SensorReading(self.values(self.latest(), category), self._time)

    def _check(self, category: SensorCategory, index: int) -> None:
        if category not in self.categories or index:
            raise RefusedError(f"{self.name} has no sensor {index} of the category {category.name}")


class Ros2ForceTorque(TopicSensors[WrenchStamped], IAnalogSensor):
    """``ros2ForceTorque``: a ``geometry_msgs/WrenchStamped``, N and Nm."""

    kind = WrenchStamped
    categories = (SensorCategory.FORCE_TORQUE,)
    _offsets = np.zeros(_CHANNELS)

    def values(self, message: WrenchStamped, category: SensorCategory) -> FloatArray:  # noqa: ARG002 - there is one
        return np.array([*_numbers(message.wrench.force), *_numbers(message.wrench.torque)]) - self._offsets

    def channels(self) -> int:
        return _CHANNELS

    def read(self) -> SensorReading:
        return self.read_sensor(SensorCategory.FORCE_TORQUE, 0)

    def calibrate(self, channel: int | None = None, value: float | None = None) -> None:
        if channel is not None and not 0 <= channel < _CHANNELS:
            raise RefusedError(f"{self.name} has {_CHANNELS} channels, counted from 0, and no {channel}")
        offsets = self._offsets + self.read().values - (value or 0.0)
        chosen = np.arange(_CHANNELS) == channel if channel is not None else np.ones(_CHANNELS, dtype=bool)
        self._offsets = np.where(chosen, offsets, self._offsets)


class Ros2Imu(TopicSensors[Imu]):
    """``ros2Imu``: a ``sensor_msgs/Imu``, as gyroscope (deg/s), accelerometer (m/s²) and orientation (deg)."""

    kind = Imu
    categories = (SensorCategory.GYROSCOPE, SensorCategory.ACCELEROMETER, SensorCategory.ORIENTATION)

    def values(self, message: Imu, category: SensorCategory) -> FloatArray:
        covariance, numbers = {
            SensorCategory.GYROSCOPE: (message.angular_velocity_covariance, message.angular_velocity),
            SensorCategory.ACCELEROMETER: (message.linear_acceleration_covariance, message.linear_acceleration),
        }.get(category, (message.orientation_covariance, None))
        if covariance[0] == -1:
            raise NotSupportedError(f"{self.name}: the messages of {self.topic} have no {category.name.lower()}")
        if numbers is None:
            return np.degrees(_angles(message))
        found = np.array(_numbers(numbers))
        return np.degrees(found) if category is SensorCategory.GYROSCOPE else found


class Ros2Camera(TopicDevice[Image], IFrameGrabber):
    """``ros2Camera``: a ``sensor_msgs/Image``. ``horizontalFov`` and ``verticalFov`` (deg) are not in messages."""

    kind = Image

    def open(self, configuration: Property) -> None:
        angles = [parameters.positive(configuration, key, 60.0) for key in ("horizontalFov", "verticalFov")]
        self._field_of_view = (angles[0], angles[1])
        super().open(configuration)

    def width(self) -> int:
        return self.latest().width

    def height(self) -> int:
        return self.latest().height

    def image(self) -> tuple[Picture, float]:
        message = self.latest()
        code, kind, channels = _FORMATS.get(message.encoding, ("", np.uint8, 0))
        if not code:
            raise NotSupportedError(f"{self.name}: YARP has no format for pictures of the encoding {message.encoding}")
        data = bytes(message.data)
        there = np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")
        row = message.width * channels * np.dtype(kind).itemsize
        if message.step < row or len(data) < message.height * message.step:
            raise RefusedError(f"{self.name}: {len(data)} bytes are no picture of {message.width} x {message.height}")
        rows = np.frombuffer(data, np.uint8)[: message.height * message.step].reshape(message.height, message.step)
        pixels = np.ascontiguousarray(rows[:, :row]).view(there).astype(kind)
        shape = (message.height, message.width, channels) if channels > 1 else (message.height, message.width)
        return Picture(pixels.reshape(shape), code), self._time

    def field_of_view(self) -> tuple[float, float]:
        return self._field_of_view


def _numbers(vector: Vector3) -> list[float]:
    return [vector.x, vector.y, vector.z]


def _angles(message: Imu) -> FloatArray:
    """Return roll, pitch and yaw (rad) of an orientation, as YARP has them: about x, then y, then z, all fixed."""
    x, y, z, w = message.orientation.x, message.orientation.y, message.orientation.z, message.orientation.w
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = math.asin(min(max(2 * (w * y - z * x), -1.0), 1.0))
    return np.array([roll, pitch, math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))])
