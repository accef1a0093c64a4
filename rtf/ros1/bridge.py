"""A robot of the network on topics of ROS 1, see :mod:`rtf.ros.bridge`."""

from __future__ import annotations

from itertools import count
from typing import TYPE_CHECKING, Any

from rtf.ros import bridge
from rtf.ros1.messages import Clock, Header, Image, Imu, JointState, Quaternion, Vector3, Wrench, WrenchStamped, time_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rtf.middleware.ports.network import Network
    from rtf.ros.robot import Force, Inertia, JointStates, Picture
    from rtf.ros1.node import Node


class Topics:
    """The topics of a robot on a node."""

    def __init__(self, node: Node) -> None:
        self._node = node

    def joint_states(self, topic: str) -> Callable[[JointStates], None]:
        """Publish states of joints. Raises Ros1Error, as the others do."""
        publisher, numbers = self._node.publisher(topic, JointState), count()

        def publish(state: JointStates) -> None:
            header = _header(numbers, state.time, "")
            publisher.publish(JointState(header, state.names, state.positions, state.speeds, state.efforts))

        return publish

    def pictures(self, topic: str) -> Callable[[Picture], None]:
        """Publish pictures."""
        publisher, numbers = self._node.publisher(topic, Image), count()

        def publish(picture: Picture) -> None:
            header = _header(numbers, picture.time, picture.frame)
            size = picture.height, picture.width
            publisher.publish(Image(header, *size, picture.encoding, 0, picture.step, picture.data))

        return publish

    def forces(self, topic: str) -> Callable[[Force], None]:
        """Publish forces and torques."""
        publisher, numbers = self._node.publisher(topic, WrenchStamped), count()

        def publish(force: Force) -> None:
            wrench = Wrench(Vector3(*force.values[:3]), Vector3(*force.values[3:]))
            publisher.publish(WrenchStamped(_header(numbers, force.time, force.frame), wrench))

        return publish

    def inertias(self, topic: str) -> Callable[[Inertia], None]:
        """Publish what inertial units measure."""
        publisher, numbers = self._node.publisher(topic, Imu), count()

        def publish(inertia: Inertia) -> None:
            header = _header(numbers, inertia.time, inertia.frame)
            turn, speed = Quaternion(*inertia.orientation), Vector3(*inertia.speed)
            publisher.publish(
                Imu(header, turn, angular_velocity=speed, linear_acceleration=Vector3(*inertia.acceleration))
            )

        return publish

    def times(self, topic: str) -> Callable[[float], None]:
        """Publish the time."""
        publisher = self._node.publisher(topic, Clock)
        return lambda now: publisher.publish(Clock(time_of(now)))


class RobotBridge(bridge.RobotBridge):
    """Publishes a robot of ``network`` on topics of ``node`` until it is closed. States have the ``rate`` in Hz."""

    def __init__(self, node: Node, network: Network, *, rate: float = 100.0) -> None:
        super().__init__(Topics(node), network, ports=f"/ros1/{node.name}", rate=rate)


def _header(numbers: Iterator[int], seconds: float, frame: str) -> Any:
    return Header(next(numbers) % (1 << 32), time_of(seconds), frame)
