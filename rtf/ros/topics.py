"""The topics of a robot on a node of either ROS, whose messages have the same names and fields."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from rtf.ros.robot import Force, Inertia, JointStates, Picture


class RobotTopics(ABC):
    """Each function makes a publisher. Those raise RosError, and so do publishers.

    Any: the nodes and messages of both ROS have no common class; ``messages`` is the module of the messages.
    """

    messages: ModuleType

    def __init__(self, node: Any) -> None:
        self._node = node

    @abstractmethod
    def headers(self) -> Callable[[float, str], Any]:
        """Return what makes the headers of one topic, of a time (s) and a frame."""

    @abstractmethod
    def time(self, seconds: float) -> Any:
        """Return a time of a message."""

    def joint_states(self, topic: str) -> Callable[[JointStates], None]:
        """Publish ``sensor_msgs/JointState``."""
        kind, header = self.messages.JointState, self.headers()
        publisher = self._node.publisher(topic, kind)

        def publish(state: JointStates) -> None:
            arrays = (one.tolist() for one in (state.positions, state.speeds, state.efforts))
            publisher.publish(kind(header(state.time, ""), state.names, *arrays))

        return publish

    def pictures(self, topic: str) -> Callable[[Picture], None]:
        """Publish ``sensor_msgs/Image``."""
        kind, header = self.messages.Image, self.headers()
        publisher = self._node.publisher(topic, kind)

        def publish(picture: Picture) -> None:
            size = picture.height, picture.width
            head = header(picture.time, picture.frame)
            publisher.publish(kind(head, *size, picture.encoding, 0, picture.step, picture.data))

        return publish

    def forces(self, topic: str) -> Callable[[Force], None]:
        """Publish ``geometry_msgs/WrenchStamped``."""
        kind, header, vector = self.messages.WrenchStamped, self.headers(), self.messages.Vector3
        publisher = self._node.publisher(topic, kind)

        def publish(force: Force) -> None:
            wrench = self.messages.Wrench(vector(*force.values[:3]), vector(*force.values[3:]))
            publisher.publish(kind(header(force.time, force.frame), wrench))

        return publish

    def inertias(self, topic: str) -> Callable[[Inertia], None]:
        """Publish ``sensor_msgs/Imu``: what inertial units measure."""
        kind, header, vector = self.messages.Imu, self.headers(), self.messages.Vector3
        publisher = self._node.publisher(topic, kind)

        def publish(inertia: Inertia) -> None:
            turn, speed = self.messages.Quaternion(*inertia.orientation), vector(*inertia.speed)
            head, acceleration = header(inertia.time, inertia.frame), vector(*inertia.acceleration)
            publisher.publish(kind(head, turn, angular_velocity=speed, linear_acceleration=acceleration))

        return publish

    def times(self, topic: str) -> Callable[[float], None]:
        """Publish ``rosgraph_msgs/Clock``."""
        publisher = self._node.publisher(topic, self.messages.Clock)
        return lambda now: publisher.publish(self.messages.Clock(self.time(now)))
