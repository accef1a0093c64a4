"""Commands for a part: one owner, limits, modes, and what is refused."""

from __future__ import annotations

import math
import subprocess
import sys
import threading
from typing import TYPE_CHECKING

import numpy as np
import pytest

from ros2_robot import ros_robot
from rtf import clock
from rtf.robot.control_modes import ControlMode
from rtf.ros2.messages import Duration, Float64MultiArray, JointTrajectory, JointTrajectoryPoint
from rtf.ros2.node import Publisher
from rtf.ros2.service_types import (
    GET_PARAMETERS,
    LIST_CONTROLLERS,
    TRIGGER,
    GetParametersRequest,
    ListControllersRequest,
    TriggerRequest,
)
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.middleware.ports.network import Network
    from rtf.ros2.node import Node

COMMANDS = "/arm_position_controller/commands"


def degrees(*values: float) -> Float64MultiArray:
    """Return commands in rad."""
    return Float64MultiArray(data=[math.radians(value) for value in values])


def ready(publisher: Publisher[object]) -> None:
    """Wait until commands are heard."""
    assert publisher.await_reader(10.0)


def test_a_command_goes_no_faster_than_the_joints(node: Callable[..., Node], network: Network):
    """A step of 20 deg at 50 deg/s takes 0.4 s; beyond a limit the board clips."""
    with ros_robot(node, network) as robot:
        there = node("user").publisher(COMMANDS, Float64MultiArray)
        ready(there)
        begin = clock.now()
        there.publish(degrees(20.0, 0.0, -50.0))
        eventually(lambda: robot.board.encoders()[0] > 19.9, "it does not arrive")
        assert 0.35 < clock.now() - begin < 5.0
        assert robot.board.encoders()[2] == 0.0
        assert robot.board.control_modes() == (ControlMode.POSITION_DIRECT,) * 3


def test_a_trajectory_passes_its_points(node: Callable[..., Node], network: Network):
    """In the order of its own names."""
    with ros_robot(node, network) as robot:
        there = node("user").publisher("/arm_trajectory_controller/joint_trajectory", JointTrajectory)
        ready(there)
        names = [*reversed(robot.client.axis_names())]
        rows = [(0.1, [0.0, 0.0, 2.0]), (0.3, [1.0, 0.0, 6.0])]
        points = [JointTrajectoryPoint([*map(math.radians, row)], time_from_start=Duration.of(at)) for at, row in rows]
        there.publish(JointTrajectory(joint_names=names, points=points))
        eventually(lambda: np.allclose(robot.board.encoders(), [6.0, 0.0, 1.0]), "it does not arrive")
        assert robot.said == []


@pytest.mark.parametrize(
    ("names", "points", "complaint"),
    [
        (["x"], [([0.0], 0.1)], "a trajectory is for joint0, joint1, joint2, not for x"),
        (None, [], "a trajectory has 1 to 10000 points, not 0"),
        (None, [([0.0] * 3, 0.2), ([0.0] * 3, 0.1)], "the times of a trajectory do not increase"),
        (None, [([0.0] * 2, 0.2)], "3 finite numbers are needed, one for each joint"),
    ],
)
def test_a_wrong_trajectory_is_refused(
    node: Callable[..., Node],
    network: Network,
    names: list[str] | None,
    points: Sequence[tuple[list[float], float]],
    complaint: str,
):
    """Nothing moves."""
    with ros_robot(node, network) as robot:
        there = node("user").publisher("/arm_trajectory_controller/joint_trajectory", JointTrajectory)
        ready(there)
        made = [JointTrajectoryPoint(row, time_from_start=Duration.of(at)) for row, at in points]
        there.publish(JointTrajectory(joint_names=names or [*robot.client.axis_names()], points=made))
        eventually(lambda: robot.said == [f"arm: a command is not obeyed: {complaint}"], f"it said {robot.said}")
        assert robot.board.control_modes() == (ControlMode.POSITION,) * 3


def test_numbers_that_are_none_are_refused_once(node: Callable[..., Node], network: Network):
    """Too few, not finite; and the next command counts."""
    with ros_robot(node, network) as robot:
        there = node("user").publisher(COMMANDS, Float64MultiArray)
        ready(there)
        for _ in range(3):
            there.publish(degrees(1.0))
            there.publish(degrees(1.0, math.nan, 1.0))
        there.publish(degrees(1.0, 2.0, 3.0))
        eventually(lambda: np.allclose(robot.board.encoders(), [1.0, 2.0, 3.0]), "it does not arrive")
        assert robot.said == ["arm: a command is not obeyed: 3 finite numbers are needed, one for each joint"]


#: A program that commands a part until it is killed.
OWNER = """
import sys
from rtf import clock
from rtf.ros2.messages import Float64MultiArray
from rtf.ros2.node import Node
with Node("owner", domain=int(sys.argv[1])) as node:
    there = node.publisher("/arm_position_controller/commands", Float64MultiArray)
    there.await_reader(20.0)
    there.publish(Float64MultiArray(data=[0.1, 0.0, 0.0]))
    print("sent", flush=True)
    clock.sleep(60)
"""


def test_a_part_has_one_owner_until_that_has_gone(node: Callable[..., Node], network: Network, domain: int):
    """Another program is refused while the first is there, and obeyed when that was killed and its lease is over."""
    with ros_robot(node, network) as robot:
        there = node("user").publisher(COMMANDS, Float64MultiArray)
        ready(there)
        with subprocess.Popen([sys.executable, "-c", OWNER, str(domain)], stdout=subprocess.PIPE) as owner:
            assert owner.stdout is not None
            try:
                assert owner.stdout.readline() == b"sent\n"
                eventually(lambda: robot.board.encoders()[0] > 5.7, "it does not arrive")
                there.publish(degrees(1.0, 0.0, 0.0))
                eventually(lambda: robot.said, "nothing is reported")
                assert "another program has commanded the part, and is still there" in robot.said[0]
                assert robot.board.encoders()[0] > 5.7
            finally:
                owner.kill()

        def obeyed() -> bool:
            clock.sleep(0.1)
            there.publish(degrees(1.0, 0.0, 0.0))
            return bool(abs(robot.board.encoders()[0] - 1.0) < 1e-3)

        eventually(obeyed, "the other one is not obeyed", 30.0)


def test_controllers_are_listed_and_describe_themselves(node: Callable[..., Node], network: Network):
    """As those of ros2_control do."""
    with ros_robot(node, network):
        user = node("user")
        listed = user.client("/controller_manager/list_controllers", LIST_CONTROLLERS)
        found = {one.name: one for one in listed.call(ListControllersRequest(), 20.0).controller}
        assert [*found] == [f"arm_{kind}_controller" for kind in ("position", "velocity", "effort", "trajectory")]
        assert {one.state for one in found.values()} == {"active"}
        assert found["arm_velocity_controller"].required_command_interfaces[0] == "joint0/velocity"
        asked = user.client("/arm_trajectory_controller/get_parameters", GET_PARAMETERS)
        values = asked.call(GetParametersRequest(names=["joints", "command_interfaces", "x"]), 20.0).values
        assert [one.value for one in values] == [["joint0", "joint1", "joint2"], ["position"], None]


def test_anybody_may_stop(node: Callable[..., Node], network: Network):
    """In the middle of a motion; the next command counts again."""
    with ros_robot(node, network) as robot:
        user = node("user")
        there = user.publisher(COMMANDS, Float64MultiArray)
        ready(there)
        there.publish(degrees(90.0, 0.0, 0.0))
        eventually(lambda: robot.board.encoders()[0] > 1.0, "it does not move")
        assert node("other").client("/bridge/stop", TRIGGER).call(TriggerRequest(), 20.0).success
        assert robot.board.control_modes() == (ControlMode.POSITION,) * 3
        stopped = robot.board.encoders()[0]
        assert stopped < 89.0
        there.publish(degrees(stopped + 1.0, 0.0, 0.0))
        eventually(lambda: abs(robot.board.encoders()[0] - stopped - 1.0) < 1e-3, "it does not go on")


def test_a_joint_in_another_mode_is_not_put_back(node: Callable[..., Node], network: Network):
    """Somebody has switched it off: it is named, and nothing moves."""
    with ros_robot(node, network) as robot:
        there = node("user").publisher(COMMANDS, Float64MultiArray)
        ready(there)
        there.publish(degrees(1.0, 0.0, 0.0))
        eventually(lambda: abs(robot.board.encoders()[0] - 1.0) < 1e-3, "it does not arrive")
        robot.board.set_control_modes([ControlMode.IDLE], [1])
        eventually(lambda: robot.client.control_mode(1) is ControlMode.IDLE, "it is not idle")
        there.publish(degrees(5.0, 0.0, 0.0))
        eventually(
            lambda: robot.said == ["arm: a command is not obeyed: joint1 is in the mode idl, not posd"], "silence"
        )
        assert robot.board.control_mode(1) is ControlMode.IDLE


def test_a_stop_while_a_mode_is_entered_is_the_last_word(
    node: Callable[..., Node], network: Network, monkeypatch: pytest.MonkeyPatch
):
    """The command before it is forgotten, and one after it is obeyed, though the board had shown the mode of both."""
    with ros_robot(node, network) as robot:
        user, stopped, look = node("user"), threading.Event(), robot.client.control_modes
        stop = user.client("/bridge/stop", TRIGGER)

        def stopped_behind() -> tuple[ControlMode, ...]:
            modes, thread = look(), threading.current_thread().name
            if thread == "rtf-commands arm" and {*modes} == {ControlMode.POSITION_DIRECT} and not stopped.is_set():
                assert stop.call(TriggerRequest(), 20.0).success
                stopped.set()
            return modes

        monkeypatch.setattr(robot.client, "control_modes", stopped_behind)
        there = user.publisher(COMMANDS, Float64MultiArray)
        ready(there)
        there.publish(degrees(50.0, 0.0, 0.0))
        assert stopped.wait(10.0)
        eventually(lambda: {*look()} == {ControlMode.POSITION}, "it is not stopped")
        there.publish(degrees(1.0, 0.0, 0.0))
        eventually(lambda: abs(robot.board.encoders()[0] - 1.0) < 1e-3, "it does not obey any more", 3.0)
        assert robot.said == []
