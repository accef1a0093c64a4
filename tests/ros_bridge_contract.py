"""What a bridge publishes of a robot, on topics of either ROS."""

from __future__ import annotations

import math
from contextlib import closing
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from rtf import clock
from rtf.bottle import Bottle
from rtf.middleware.ports.port import Port
from rtf.middleware.types import Image
from rtf.robot.boards.client import connect
from rtf.robot.devices.fake_board import FakeBoard
from rtf.ros.errors import RosError
from served import served
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from rtf.middleware.ports.network import Network


class BridgeContract:
    """Subclasses give the bridge, the module of the messages, and the seconds of a stamp.

    Nodes are made by the fixture ``node``; their names are Any, as those of both ROS have no common class.
    """

    bridge: Any
    messages: ModuleType

    def seconds(self, stamp: Any) -> float:
        """Return a time of a message in s."""
        raise NotImplementedError

    def while_it_publishes(self) -> None:
        """Look at the states by other means."""

    def test_states_are_published_in_radians(self, node: Callable[..., Any], network: Network):
        """Each new state of a board, with its stamp, names and speeds."""
        self.got: list[Any] = []
        node("listener").subscribe("/joint_states", self.messages.JointState, self.got.append)
        board = FakeBoard("board", network=network)
        with (
            served(board, "/robot/arm", network=network, period=0.01),
            connect("/robot/arm", carrier="tcp", network=network, timeout=10.0) as client,
            closing(self.bridge(node("bridge"), network)) as bridge,
        ):
            board.set_encoders([90.0, 0.0, -45.0])
            bridge.add_part("arm", client)
            bridge.start()
            eventually(
                lambda: any(len(one.position) == 3 and one.position[0] > 1.5 for one in self.got), "no state came"
            )
            self.while_it_publishes()
        state = next(one for one in self.got if one.position[0] > 1.5)
        assert state.position == pytest.approx([math.pi / 2, 0.0, -math.pi / 4], abs=1e-6)
        assert len(state.name) == len(state.velocity) == 3
        stamps = [self.seconds(one.header.stamp) for one in self.got]
        assert stamps == sorted(set(stamps))
        assert abs(stamps[-1] - clock.now()) < 60

    def test_pictures_and_forces_are_passed_on(self, node: Callable[..., Any], network: Network):
        """With the stamps of their envelopes, and encodings of ROS."""
        images: list[Any] = []
        wrenches: list[Any] = []
        listener = node("listener")
        listener.subscribe("/camera/image_raw", self.messages.Image, images.append)
        listener.subscribe("/foot/wrench", self.messages.WrenchStamped, wrenches.append)
        pixels = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
        with (
            Port("/camera", network=network) as camera,
            Port("/foot", network=network) as foot,
            closing(self.bridge(node("bridge"), network)) as bridge,
        ):
            bridge.add_camera("/camera", "camera/image_raw")
            bridge.add_wrench("/foot", "foot/wrench")

            def both() -> bool:
                camera.write(Image(pixels), envelope="3 12.5")
                foot.write(Bottle([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), envelope="4 13.25")
                return bool(images and wrenches)

            eventually(both, "they did not arrive")
        image, wrench = images[0], wrenches[0]
        assert (image.height, image.width, image.encoding, image.step) == (2, 4, "rgb8", 12)
        assert bytes(image.data) == pixels.tobytes()
        assert (self.seconds(image.header.stamp), image.header.frame_id) == (12.5, "camera")
        forces = wrench.wrench.force.z, wrench.wrench.torque.z, self.seconds(wrench.header.stamp)
        assert forces == (3.0, 6.0, 13.25)

    def test_inertial_units_are_passed_on(self, node: Callable[..., Any], network: Network):
        """Orientation as a quaternion, rad/s; what is none is reported once."""
        got: list[Any] = []
        said: list[str] = []
        network.report = said.append
        node("listener").subscribe("/head/imu", self.messages.Imu, got.append)
        with Port("/inertial", network=network) as unit, closing(self.bridge(node("bridge"), network)) as bridge:
            bridge.add_imu("/inertial", "head/imu")

            def arrived() -> bool:
                unit.write(Bottle([1.0, 2.0]))
                unit.write(Bottle([0.0, 0.0, 90.0, 1.0, 2.0, 9.8, 0.0, 0.0, 180.0, 0.0, 0.0, 0.0]), envelope="1 7.5")
                return bool(got)

            eventually(arrived, "nothing arrived")
        assert said == ["/inertial: 2 numbers are no orientation, acceleration, speed and magnetic field"]
        one = got[0]
        assert (one.header.frame_id, self.seconds(one.header.stamp)) == ("head", 7.5)
        assert [one.orientation.z, one.orientation.w] == pytest.approx([math.sqrt(0.5)] * 2)
        assert (one.angular_velocity.z, one.linear_acceleration.z) == (pytest.approx(math.pi), 9.8)

    def test_a_force_that_is_none_is_reported_once(self, node: Callable[..., Any], network: Network):
        """And passed over."""
        said: list[str] = []
        network.report = said.append
        with Port("/foot", network=network) as foot, closing(self.bridge(node("bridge"), network)) as bridge:
            bridge.add_wrench("/foot", "foot/wrench")
            foot.write(Bottle([1.0]))
            foot.write(Bottle([1.0]))
        assert said == ["/foot: 1 numbers are no force and torque"]

    def test_a_rate_is_checked(self, node: Callable[..., Any], network: Network):
        """It is a number above 0."""
        for rate in (0.0, -1.0, math.nan, 1e4):
            with pytest.raises(RosError, match="a rate is above 0"):
                self.bridge(node("bridge"), network, rate=rate)
