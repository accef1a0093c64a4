"""Sensors over ROS 2: forces, inertial units, pictures, in the units of boards; what is missing is reported."""

from __future__ import annotations

import math
from contextlib import closing
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from rtf import clock
from rtf.bottle import Property
from rtf.robot.device import make_device
from rtf.robot.errors import DeviceError, NotSupportedError, RefusedError, StaleStateError
from rtf.robot.interfaces import SensorCategory, SensorStatus
from rtf.ros2.messages import Header, Image, Imu, Quaternion, Time, Vector3, Wrench, WrenchStamped
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.ports.network import Network
    from rtf.ros2.node import Node

FT = SensorCategory.FORCE_TORQUE


def opened(kind: str, domain: int, network: Network, text: str = "") -> Any:
    """Return an open device; ``Any`` as it has several interfaces."""
    return make_device(kind, Property.parse(f"(topic there) (domain {domain}) {text}"), network=network)


def header() -> Header:
    """Return a header of now."""
    return Header(Time.of(clock.now()), "wrist")


def test_forces(node: Callable[..., Node], network: Network, domain: int):
    """Both interfaces of sensors have them; one can be made zero."""
    there = node("robot").publisher("there", WrenchStamped)
    with closing(opened("ros2ForceTorque", domain, network, "(timeout 0.3)")) as sensor:
        assert sensor.sensor_status(FT, 0) is SensorStatus.WAITING_FOR_FIRST_READ
        with pytest.raises(StaleStateError, match="nothing has come on /there for"):
            sensor.read()

        def arrived() -> bool:
            there.publish(WrenchStamped(header(), Wrench(Vector3(1.0, 2.0, 3.0), Vector3(4.0, 5.0, 6.0))))
            return bool(sensor.sensor_status(FT, 0) is SensorStatus.OK)

        eventually(arrived, "nothing came")
        assert sensor.read().values.tolist() == sensor.read_sensor(FT, 0).values.tolist() == [1, 2, 3, 4, 5, 6]
        assert abs(sensor.read().time - clock.now()) < 5.0
        sensor.calibrate(2)
        assert sensor.read().values.tolist() == [1, 2, 0, 4, 5, 6]
        with pytest.raises(RefusedError, match="no sensor 1"):
            sensor.read_sensor(FT, 1)
        eventually(lambda: sensor.sensor_status(FT, 0) is SensorStatus.TIMEOUT, "it is not late")


def test_inertial_units(node: Callable[..., Node], network: Network, domain: int):
    """Degrees, and roll, pitch and yaw; a quantity with a covariance of -1 does not exist."""
    there = node("robot").publisher("there", Imu)
    half = math.radians(15.0)
    message = Imu(
        orientation=Quaternion(0.0, math.sin(half), 0.0, math.cos(half)),
        angular_velocity=Vector3(0.0, 0.0, math.pi),
        linear_acceleration=Vector3(0.0, 0.0, 9.81),
        linear_acceleration_covariance=[-1.0] + [0.0] * 8,
    )
    with closing(opened("ros2Imu", domain, network)) as sensor:

        def arrived() -> bool:
            message.header = header()
            there.publish(message)
            return bool(sensor.sensor_status(SensorCategory.GYROSCOPE, 0) is SensorStatus.OK)

        eventually(arrived, "nothing came")
        assert sensor.read_sensor(SensorCategory.GYROSCOPE, 0).values == pytest.approx([0.0, 0.0, 180.0])
        assert sensor.read_sensor(SensorCategory.ORIENTATION, 0).values == pytest.approx([0.0, 30.0, 0.0])
        with pytest.raises(NotSupportedError, match="the messages of /there have no accelerometer"):
            sensor.read_sensor(SensorCategory.ACCELEROMETER, 0)
        assert sensor.sensors(SensorCategory.GYROSCOPE)[0].frame == "wrist"
        assert sensor.sensors(FT) == ()


@pytest.mark.parametrize(
    ("encoding", "kind", "shape"), [("rgb8", np.uint8, (2, 3, 3)), ("mono16", ">u2", (2, 3)), ("32FC1", "<f4", (2, 3))]
)
def test_pictures(
    node: Callable[..., Node], network: Network, domain: int, encoding: str, kind: str, shape: tuple[int, ...]
):
    """Their rows may be longer than their pixels, and the bytes in either order."""
    there = node("robot").publisher("there", Image)
    pixels = np.arange(math.prod(shape)).reshape(shape).astype(kind)
    rows = np.hstack([pixels.reshape(2, -1).view(np.uint8), np.full((2, 5), 99, np.uint8)])
    big = pixels.dtype.str[0] == ">"
    with closing(opened("ros2Camera", domain, network, "(horizontalFov 50.0)")) as camera:

        def arrived() -> bool:
            there.publish(Image(header(), 2, 3, encoding, int(big), rows.shape[1], rows.tobytes()))
            try:
                return bool(camera.width())
            except StaleStateError:
                return False

        eventually(arrived, "nothing came")
        image, _ = camera.image()
        assert image.pixels.tolist() == pixels.tolist()
        assert (camera.height(), camera.field_of_view()) == (2, (50.0, 60.0))


@pytest.mark.parametrize(
    ("image", "complaint"),
    [
        (
            Image(height=2, width=2, encoding="bayer_rggb8", step=2, data=bytes(4)),
            "no format for pictures",
        ),
        (Image(height=2, width=2, encoding="rgb8", step=6, data=bytes(6)), "6 bytes are no picture of 2 x 2"),
        (Image(height=2, width=2, encoding="rgb8", step=2, data=bytes(60)), "60 bytes are no picture of 2 x 2"),
    ],
)
def test_a_picture_that_is_none_is_reported(
    node: Callable[..., Node], network: Network, domain: int, image: Image, complaint: str
):
    """When it is asked for."""
    there = node("robot").publisher("there", Image)
    with closing(opened("ros2Camera", domain, network, "(timeout 5.0)")) as camera:

        def reported() -> bool:
            there.publish(image)
            try:
                camera.image()
            except StaleStateError:
                return False
            except (NotSupportedError, RefusedError) as error:
                return complaint in str(error)
            return False

        eventually(reported, "nothing was reported")


def test_a_topic_that_is_none_is_reported(network: Network, domain: int):
    """When the device is opened."""
    with pytest.raises(DeviceError, match="'a b' is no name of a topic"):
        make_device("ros2Imu", Property.parse(f'(topic "a b") (domain {domain})'), network=network)
