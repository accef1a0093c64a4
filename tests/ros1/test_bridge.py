"""A robot on topics of ROS 1: states in radians, pictures and forces, from real ports to a real master's topics."""

from __future__ import annotations

import math
from contextlib import closing
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf import clock
from rtf.bottle import Bottle
from rtf.middleware.ports.port import Port
from rtf.middleware.types import Image as Picture
from rtf.robot.boards.client import connect
from rtf.robot.devices.fake_board import FakeBoard
from rtf.ros.robot import quaternion_of
from rtf.ros1.bridge import RobotBridge
from rtf.ros1.messages import Image, Imu, JointState, WrenchStamped, seconds_of, time_of
from served import served
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable

    from ros1.conftest import Ros

    from rtf.middleware.ports.network import Network
    from rtf.ros1.node import Node


def test_states_are_published_in_radians(ros: Ros, node: Callable[..., Node], network: Network):
    """Each new state of a board, with its stamp, names and number; ``rostopic`` shows it."""
    got: list[Any] = []
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
        assert "position: [1.57" in ros.run("rostopic", "echo", "-n", "1", "/joint_states")
    state = next(one for one in got if one.position[0] > 1.5)
    assert state.position == pytest.approx([math.pi / 2, 0.0, -math.pi / 4], abs=1e-6)
    assert len(state.name) == len(state.velocity) == 3
    stamps = [seconds_of(one.header.stamp) for one in got]
    assert stamps == sorted(set(stamps))
    assert abs(stamps[-1] - clock.now()) < 60
    numbers = [one.header.seq for one in got]
    assert numbers == [*range(numbers[0], numbers[0] + len(numbers))]


def test_pictures_and_forces_are_passed_on(node: Callable[..., Node], network: Network):
    """With the stamps of their envelopes, and encodings of ROS."""
    images: list[Any] = []
    wrenches: list[Any] = []
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
    assert (seconds_of(image.header.stamp), image.header.frame_id) == (12.5, "camera")
    assert (wrench.wrench.force.z, wrench.wrench.torque.z, seconds_of(wrench.header.stamp)) == (3.0, 6.0, 13.25)


def test_inertial_units_are_passed_on(node: Callable[..., Node], network: Network, said: list[str]):
    """Orientation as a quaternion, rad/s; what is none is told once."""
    got: list[Any] = []
    network.report = said.append
    node("listener").subscribe("/head/imu", Imu, got.append)
    with Port("/inertial", network=network) as unit, closing(RobotBridge(node("bridge"), network)) as bridge:
        bridge.add_imu("/inertial", "head/imu")

        def arrived() -> bool:
            unit.write(Bottle([1.0, 2.0]))
            unit.write(Bottle([0.0, 0.0, 90.0, 1.0, 2.0, 9.8, 0.0, 0.0, 180.0, 0.0, 0.0, 0.0]), envelope="1 7.5")
            return bool(got)

        eventually(arrived, "nothing arrived")
    assert said == ["/inertial: 2 numbers are no orientation, acceleration, speed and magnetic field"]
    one = got[0]
    assert (one.header.frame_id, seconds_of(one.header.stamp)) == ("head", 7.5)
    half = math.sqrt(0.5)
    assert [one.orientation.z, one.orientation.w] == pytest.approx([half, half])
    assert (one.angular_velocity.z, one.linear_acceleration.z) == (pytest.approx(math.pi), 9.8)


@given(*[st.floats(-180, 180)] * 3)
def test_quaternions_turn_as_the_angles_do(roll: float, pitch: float, yaw: float):
    """First about x, then about y, then about z."""
    x, y, z, w = quaternion_of(roll, pitch, yaw)
    turned = np.eye(3) + 2 * w * _cross([x, y, z]) + 2 * _cross([x, y, z]) @ _cross([x, y, z])
    (sr, cr), (sp, cp), (sy, cy) = ((math.sin(one), math.cos(one)) for one in np.radians([roll, pitch, yaw]))
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    assert turned == pytest.approx(about_z @ about_y @ about_x, abs=1e-9)


def _cross(axis: list[float]) -> np.ndarray:
    """The matrix that multiplies crosswise."""
    x, y, z = axis
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


@pytest.mark.parametrize("seconds", [0.0, 1.5, 1.8e9, 2.0**31 - 1])
def test_times_are_those_of_ros(seconds: float):
    """Whole seconds, and billionths."""
    assert seconds_of(time_of(seconds)) == pytest.approx(seconds, abs=1e-6)


@pytest.mark.parametrize(("seconds", "found"), [(-1.0, 0.0), (1e12, 2.0**31 - 1)])
def test_times_that_do_not_fit(seconds: float, found: float):
    """Are the nearest that do."""
    assert seconds_of(time_of(seconds)) == pytest.approx(found, abs=1.0)
