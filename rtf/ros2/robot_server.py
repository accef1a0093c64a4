"""What a robot of ros2_control has beside its states: a description, and controllers with their services."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from rtf.errors import RtfError
from rtf.ros2.commands import CommandedPart
from rtf.ros2.controllers import LIST, Interface
from rtf.ros2.description import described, make_description
from rtf.ros2.messages import String
from rtf.ros2.node import default_qos
from rtf.ros2.service_types import (
    GET_PARAMETERS,
    LIST_CONTROLLERS,
    TRIGGER,
    ControllerState,
    GetParametersRequest,
    GetParametersResponse,
    ListControllersRequest,
    ListControllersResponse,
    ParameterValue,
    TriggerRequest,
    TriggerResponse,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from rtf.robot.boards.client import RemoteBoard
    from rtf.ros2.node import Node

_TYPES = {Interface.TRAJECTORY: "joint_trajectory_controller/JointTrajectoryController"}
_FORWARD = "forward_command_controller/ForwardCommandController"


def publish_description(node: Node, robot: str, boards: Mapping[str, RemoteBoard], text: str = "") -> None:
    """Publish ``text``, else a description of the limits of the boards, latched on ``robot_description``."""
    joints = [joint for board in boards.values() for joint in described(board)]
    latched = default_qos(depth=1, latched=True)
    node.publisher("robot_description", String, latched).publish(String(text or make_description(robot, joints)))


class RobotServer:
    """Takes commands for boards until it is closed; the service ``NODE/stop`` stops all, for any client.

    Raises RobotError, Ros2Error.
    """

    def __init__(self, node: Node, boards: Mapping[str, RemoteBoard], report: Callable[[str], None]) -> None:
        self._parts: list[CommandedPart] = []
        try:
            for name, board in boards.items():
                self._parts.append(CommandedPart(name, board, node, report))
        except BaseException:
            self.close()
            raise
        for part in self._parts:
            for interface in Interface:
                answer = partial(_parameters, part, interface)
                node.serve(f"{part.controller(interface)}/get_parameters", GET_PARAMETERS, answer)
        node.serve(LIST, LIST_CONTROLLERS, self._controllers)
        node.serve(f"{node.name}/stop", TRIGGER, self._stop)

    def close(self) -> None:
        """Take no more commands."""
        for part in self._parts:
            part.close()

    def _controllers(self, _: ListControllersRequest) -> ListControllersResponse:
        states = [
            ControllerState(
                part.controller(interface),
                "active",
                _TYPES.get(interface, _FORWARD),
                required_command_interfaces=[f"{joint.name}/{_interface_name(interface)}" for joint in part.joints],
            )
            for part in self._parts
            for interface in Interface
        ]
        return ListControllersResponse(controller=states)

    def _stop(self, _: TriggerRequest) -> TriggerResponse:
        failed = []
        for part in self._parts:
            try:
                part.stop()
            except RtfError as error:
                failed.append(f"{part.name}: {error}")
        return TriggerResponse(success=not failed, message="; ".join(failed) or "stopped")


def _interface_name(interface: Interface) -> str:
    return Interface.POSITION.value if interface is Interface.TRAJECTORY else interface.value


def _parameters(part: CommandedPart, interface: Interface, request: GetParametersRequest) -> GetParametersResponse:
    name = _interface_name(interface)
    known = {
        "joints": ParameterValue.of([joint.name for joint in part.joints]),
        "interface_name": ParameterValue.of(name),
        "command_interfaces": ParameterValue.of([name]),
    }
    return GetParametersResponse(values=[known.get(one, ParameterValue()) for one in request.names])
