"""Controllers of ros2_control that a board commands: topics, and what is asked of them beforehand."""

from __future__ import annotations

import threading
from enum import Enum
from typing import TYPE_CHECKING

from rtf import clock
from rtf.ros2.errors import NoServiceError, Ros2Error
from rtf.ros2.messages import (
    Duration,
    Float64MultiArray,
    JointTrajectory,
    JointTrajectoryPoint,
    String,
)
from rtf.ros2.node import default_qos
from rtf.ros2.service_types import GET_PARAMETERS, LIST_CONTROLLERS, GetParametersRequest, ListControllersRequest

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.ros2.node import Node

#: The service of the controller manager, and the seconds for it to answer, as a robot may have none.
LIST = "/controller_manager/list_controllers"
_PATIENCE = 1.0


class Interface(Enum):
    """What a controller takes."""

    POSITION = "position"  # forward_command_controller, or position_controllers/JointGroupPositionController
    VELOCITY = "velocity"
    EFFORT = "effort"
    TRAJECTORY = "trajectory"  # joint_trajectory_controller


class Controller:
    """The commands of a controller of ``node``. ``period`` (s) is the time between two of them. Raises Ros2Error."""

    def __init__(self, node: Node, name: str, interface: Interface, joints: Sequence[str], period: float) -> None:
        self.interface, self._joints, self._period = interface, list(joints), period
        self.topic = f"{name}/joint_trajectory" if interface is Interface.TRAJECTORY else f"{name}/commands"
        self._send = self._trajectories(node) if interface is Interface.TRAJECTORY else self._arrays(node)

    def _arrays(self, node: Node) -> Callable[[FloatArray, FloatArray], None]:
        publisher = node.publisher(self.topic, Float64MultiArray)
        self.await_reader = publisher.await_reader
        return lambda values, _: publisher.publish(Float64MultiArray(data=values.tolist()))

    def _trajectories(self, node: Node) -> Callable[[FloatArray, FloatArray], None]:
        publisher = node.publisher(self.topic, JointTrajectory)
        self.await_reader = publisher.await_reader
        arrival = Duration.of(2 * self._period)  # the next one comes before it

        def send(positions: FloatArray, velocities: FloatArray) -> None:
            point = JointTrajectoryPoint(positions.tolist(), velocities.tolist(), time_from_start=arrival)
            publisher.publish(JointTrajectory(joint_names=self._joints, points=[point]))

        return send

    def send(self, values: FloatArray, velocities: FloatArray) -> None:
        """Command the quantity of the interface, and with a trajectory the velocities, in the units of ROS."""
        self._send(values, velocities)


def joints_of(node: Node, controller: str, timeout: float) -> list[str]:
    """Return the joints of a controller in its order. Raises Ros2Error."""
    client = node.client(f"{controller}/get_parameters", GET_PARAMETERS)
    try:
        values = client.call(GetParametersRequest(names=["joints"]), timeout).values
    except NoServiceError as error:
        raise Ros2Error(f"the joints of {controller} are unknown: {error}; or write them as 'joints'") from error
    found = values[0].value if values else None
    if not isinstance(found, list) or not found or not all(isinstance(name, str) for name in found):
        raise Ros2Error(f"the node {controller} has no parameter 'joints'; is it a controller? write them as 'joints'")
    return found


def why_inactive(node: Node, controller: str) -> str:
    """Return what is wrong with a controller by its controller manager; empty also if that does not answer."""
    client = node.client(LIST, LIST_CONTROLLERS)
    try:
        found = {one.name: one.state for one in client.call(ListControllersRequest(), _PATIENCE).controller}
    except NoServiceError:
        return ""
    name = controller.rpartition("/")[2]
    if name not in found:
        return f"the controller manager has no {name}; it has {', '.join(found) or 'none'}"
    if found[name] != "active":
        return f"{name} is {found[name]}; ros2 control switch_controllers --activate {name}"
    return ""


def description_of(node: Node, topic: str, timeout: float) -> str:
    """Return the description of the robot that a latched topic has. Raises Ros2Error."""
    arrived, found = threading.Event(), []

    def take(message: String) -> None:
        found.append(message.data)
        arrived.set()

    node.subscribe(topic, String, take, default_qos(depth=1, latched=True))
    if not arrived.wait(clock.Deadline.after(timeout).remaining()):
        raise Ros2Error(
            f"no description came on {node.full_name(topic)} within {timeout:g} s; is robot_state_publisher running? "
            "ros2 topic info shows who publishes it"
        )
    return found[-1]
