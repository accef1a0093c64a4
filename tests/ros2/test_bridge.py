"""A robot on topics of ROS 2: states in radians, pictures and forces, from real ports to real DDS."""

from __future__ import annotations

import math
from contextlib import closing
from typing import TYPE_CHECKING

import numpy as np
import pytest

from rtf import clock
from rtf.bottle import Bottle
from rtf.middleware.ports.port import Port
from rtf.middleware.types import Image as Picture
from rtf.robot.boards.client import connect
from rtf.robot.devices.fake_board import FakeBoard
from rtf.ros.errors import RosError
from rtf.ros2.bridge import RobotBridge
from rtf.ros2.messages import Image, Imu, JointState, WrenchStamped
from served import served
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.ports.network import Network
    from rtf.ros2.node import Node


def test_states_are_published_in_radians(node: Callable[..., Node], network: Network):
    """Each new state of a board, with its stamp, names and efforts."""
    got: list[JointState] = []
    node("listener").subscribe("/joint_states", JointState, got.append)
    board = FakeBoard("board", network=network)
    with (
        served(board, "/robot/arm", network=network, period=0.01),
        connect("/robot/arm", carrier="tcp", network=network) as client,
        closing(RobotBridge(node("bridge"), network)) as bridge,
    ):
        board.set_encoders([90.0, 0.0, -45.0])
        bridge.add_part("arm", client)
        bridge.start()
        eventually(lambda: any(len(one.position) == 3 and one.position[0] > 1.5 for one in got), "no state came")
    state = next(one for one in got if one.position[0] > 1.5)
    assert state.position == pytest.approx([math.pi / 2, 0.0, -math.pi / 4], abs=1e-6)
    assert len(state.name) == len(state.velocity) == 3
    stamps = [one.header.stamp.seconds for one in got]
    assert stamps == sorted(set(stamps))
    assert abs(stamps[-1] - clock.now()) < 60


def test_pictures_and_forces_are_passed_on(node: Callable[..., Node], network: Network):
    """With the stamps of their envelopes, and encodings of ROS."""
    images: list[Image] = []
    wrenches: list[WrenchStamped] = []
    listener = node("listener")
    listener.subscribe("/camera/image_raw", Image, images.append)
    listener.subscribe("/foot/wrench", WrenchStamped, wrenches.append)
    pixels = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    with (
        Port("/camera", network=network) as camera,
        Port("/foot", network=network) as foot,
        closing(RobotBridge(node("bridge"), network)) as bridge,
    ):
        bridge.add_camera("/camera", "camera/image_raw")
        bridge.add_wrench("/foot", "foot/wrench")

        def both() -> bool:
            camera.write(Picture(pixels), envelope="3 12.5")
            foot.write(Bottle([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), envelope="4 13.25")
            return bool(images and wrenches)

        eventually(both, "they did not arrive")
    image, wrench = images[0], wrenches[0]
    assert (image.height, image.width, image.encoding, image.step) == (2, 4, "rgb8", 12)
    assert bytes(image.data) == pixels.tobytes()
    assert (image.header.stamp.seconds, image.header.frame_id) == (12.5, "camera")
    assert (wrench.wrench.force.z, wrench.wrench.torque.z, wrench.header.stamp.seconds) == (3.0, 6.0, 13.25)


def test_inertial_units_are_passed_on(node: Callable[..., Node], network: Network):
    """Orientation as a quaternion, rad/s."""
    got: list[Imu] = []
    node("listener").subscribe("/head/imu", Imu, got.append)
    with Port("/inertial", network=network) as unit, closing(RobotBridge(node("bridge"), network)) as bridge:
        bridge.add_imu("/inertial", "head/imu")

        def arrived() -> bool:
            unit.write(Bottle([0.0, 0.0, 180.0, 1.0, 2.0, 9.8, 0.0, 0.0, 90.0, 0.0, 0.0, 0.0]), envelope="1 7.5")
            return bool(got)

        eventually(arrived, "nothing arrived")
    one = got[0]
    assert (one.header.frame_id, one.header.stamp.seconds, one.linear_acceleration.z) == ("head", 7.5, 9.8)
    assert (one.orientation.z, one.angular_velocity.z) == (pytest.approx(1.0), pytest.approx(math.pi / 2))


def test_what_cannot_be_published_is_told_once(node: Callable[..., Node], network: Network):
    """A force that is none."""
    said: list[str] = []
    network.report = said.append
    with Port("/foot", network=network) as foot, closing(RobotBridge(node("bridge"), network)) as bridge:
        bridge.add_wrench("/foot", "foot/wrench")
        foot.write(Bottle([1.0]))
        foot.write(Bottle([1.0]))
    assert said == ["/foot: 1 numbers are no force and torque"]


def test_a_rate_is_checked(node: Callable[..., Node], network: Network):
    """It is a number above 0."""
    for rate in (0.0, -1.0, math.nan, 1e4):
        with pytest.raises(RosError, match="a rate is above 0"):
            RobotBridge(node("bridge"), network, rate=rate)
