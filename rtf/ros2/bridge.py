"""A robot of the network on topics of ROS 2, see :mod:`rtf.ros.bridge`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.ros import bridge
from rtf.ros2.messages import Clock, Header, Image, Imu, JointState, Quaternion, Time, Vector3, Wrench, WrenchStamped

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.ports.network import Network
    from rtf.ros.robot import Force, Inertia, JointStates, Picture
    from rtf.ros2.node import Node


class Topics:
    """The topics of a robot on a node."""

    def __init__(self, node: Node) -> None:
        self._node = node

    def joint_states(self, topic: str) -> Callable[[JointStates], None]:
        """Publish states of joints. Raises Ros2Error, as the others do."""
        publisher = self._node.publisher(topic, JointState)

        def publish(state: JointStates) -> None:
            arrays = state.positions, state.speeds, state.efforts
            publisher.publish(JointState(_header(state.time, ""), state.names, *(array.tolist() for array in arrays)))

        return publish

    def pictures(self, topic: str) -> Callable[[Picture], None]:
        """Publish pictures."""
        publisher = self._node.publisher(topic, Image)

        def publish(picture: Picture) -> None:
            header = _header(picture.time, picture.frame)
            size = picture.height, picture.width
            publisher.publish(Image(header, *size, picture.encoding, 0, picture.step, picture.data))

        return publish

    def forces(self, topic: str) -> Callable[[Force], None]:
        """Publish forces and torques."""
        publisher = self._node.publisher(topic, WrenchStamped)

        def publish(force: Force) -> None:
            wrench = Wrench(Vector3(*force.values[:3]), Vector3(*force.values[3:]))
            publisher.publish(WrenchStamped(_header(force.time, force.frame), wrench))

        return publish

    def inertias(self, topic: str) -> Callable[[Inertia], None]:
        """Publish what inertial units measure."""
        publisher = self._node.publisher(topic, Imu)

        def publish(inertia: Inertia) -> None:
            header = _header(inertia.time, inertia.frame)
            turn, speed = Quaternion(*inertia.orientation), Vector3(*inertia.speed)
            publisher.publish(
                Imu(header, turn, angular_velocity=speed, linear_acceleration=Vector3(*inertia.acceleration))
            )

        return publish

    def times(self, topic: str) -> Callable[[float], None]:
        """Publish the time."""
        publisher = self._node.publisher(topic, Clock)
        return lambda now: publisher.publish(Clock(Time.of(now)))


class RobotBridge(bridge.RobotBridge):
    """Publishes a robot of ``network`` on topics of ``node`` until it is closed. States have the ``rate`` in Hz."""

    def __init__(self, node: Node, network: Network, *, rate: float = 100.0) -> None:
        super().__init__(Topics(node), network, ports=f"/ros2/{node.name}", rate=rate)


def _header(seconds: float, frame: str) -> Header:
    return Header(Time.of(seconds), frame)
