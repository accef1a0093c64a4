"""The driver of a board over ROS 2, against a robot of ROS 2 whose board is behind real ports and real DDS."""

from __future__ import annotations

import math
import subprocess
import sys
import threading
from contextlib import closing, contextmanager
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import pytest

from ros2_robot import ros_robot
from rtf import clock
from rtf.bottle import Property
from rtf.robot.control_modes import ControlMode
from rtf.robot.device import make_device
from rtf.robot.devices.control_board import ControlBoard
from rtf.robot.errors import ConfigurationError, DeviceError, NotSupportedError, RefusedError, StaleStateError
from rtf.robot.extended_state import ExtendedState
from rtf.robot.interfaces import JointType, PidType
from rtf.ros2.board import Ros2Board
from rtf.ros2.description import DescribedJoint, make_description
from rtf.ros2.messages import Float64MultiArray, Header, JointState, String, Time
from rtf.ros2.node import default_qos
from rtf.ros2.service_types import LIST_CONTROLLERS, ControllerState, ListControllersResponse
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rtf.middleware.ports.network import Network
    from rtf.ros2.node import Node


def opened(network: Network, domain: int, text: str = "", **values: object) -> Any:
    """Return the open device; ``Any`` as it has all interfaces of a board."""
    configuration = Property.parse(f"(domain {domain}) (patience 5.0) (timeout 5.0) {text}")
    for key, value in values.items():
        configuration.put(key, value)
    return make_device("ros2ControlBoard", configuration, network=network)


def test_joints_are_those_of_the_robot(node: Callable[..., Node], network: Network, domain: int):
    """Names from the controller, limits from the description, positions in degrees."""
    with ros_robot(node, network) as robot:
        robot.board.set_encoders([10.0, 20.0, 30.0])
        with closing(opened(network, domain, controller="arm_position_controller")) as board:
            assert board.axis_names() == robot.client.axis_names()
            assert board.limits(0) == pytest.approx((0.0, 100.0))
            assert board.velocity_limits(0)[1] == pytest.approx(robot.client.velocity_limits(0)[1])
            eventually(lambda: np.allclose(board.encoders(), [10.0, 20.0, 30.0]), "other positions")
            assert board.control_modes() == (ControlMode.POSITION,) * 3


@pytest.mark.parametrize("interface", ["position", "trajectory"])
def test_moves_arrive(node: Callable[..., Node], network: Network, domain: int, interface: str):
    """Trajectories, direct positions and velocities are made of positions; limits are those of the robot."""
    with (
        ros_robot(node, network) as robot,
        closing(opened(network, domain, controller=f"arm_{interface}_controller", interface=interface)) as board,
    ):
        board.set_reference_speeds([50.0] * 3)
        board.position_move([5.0, 10.0, 500.0])
        eventually(lambda: np.allclose(robot.board.encoders()[:2], [5.0, 10.0], atol=1e-6), "it does not arrive")
        eventually(lambda: np.allclose(board.encoders(), [5.0, 10.0, 100.0], atol=1e-6), "it does not end at its limit")
        board.set_control_modes(ControlMode.VELOCITY, [0])
        board.velocity_move([20.0], [0])
        eventually(lambda: robot.board.encoders()[0] > 6.0, "it does not run")
        assert robot.said == []


@pytest.mark.parametrize(
    ("interface", "mode", "command", "found"),
    [
        ("velocity", ControlMode.VELOCITY, lambda board: board.velocity_move([9.0, 0.0, 0.0]), "target_velocities"),
        ("effort", ControlMode.TORQUE, lambda board: board.set_reference_torques([2.0, 0.0, 0.0]), "reference_torques"),
    ],
)
def test_velocities_and_efforts(
    node: Callable[..., Node],
    network: Network,
    domain: int,
    interface: str,
    mode: ControlMode,
    command: Callable[[Any], None],
    found: str,
):
    """They arrive in the units of the board, and another mode is refused."""
    with (
        ros_robot(node, network) as robot,
        closing(opened(network, domain, controller=f"arm_{interface}_controller", interface=interface)) as board,
    ):
        with pytest.raises(RefusedError, match="this board does not have the mode posd"):
            board.set_control_modes(ControlMode.POSITION_DIRECT)
        board.set_control_modes(mode)
        command(board)
        wanted = 9.0 if interface == "velocity" else 2.0
        eventually(lambda: getattr(robot.board, found)()[0] == pytest.approx(wanted), "nothing arrived")
        assert robot.board.control_modes() == (mode,) * 3


def test_what_ros_2_cannot_do_is_refused(node: Callable[..., Node], network: Network, domain: int):
    """Power, currents, duty cycles, gains: with a sentence, and nothing is changed."""
    with (
        ros_robot(node, network),
        closing(opened(network, domain, controller="arm_position_controller")) as board,
    ):
        for mode in (ControlMode.IDLE, ControlMode.TORQUE, ControlMode.CURRENT, ControlMode.PWM):
            with pytest.raises(RefusedError, match=f"this board does not have the mode {mode.word}"):
                board.set_control_modes(mode)
        with pytest.raises(NotSupportedError, match="does not measure currents"):
            board.currents()
        with pytest.raises(RefusedError, match="ROS 2 has no gains, greatest currents"):
            board.set_max_current(0, 0.0)
        before = board.pid(PidType.POSITION, 1)
        with pytest.raises(RefusedError, match="ROS 2 has no gains"):
            board.set_pid(PidType.POSITION, 1, before._replace(kp=3.0))
        assert board.pid(PidType.POSITION, 1) == before
        assert board.max_current(0) > 0
        assert board.control_modes() == (ControlMode.POSITION,) * 3


class Talker:
    """Says what a robot says, as far as it is asked to: states of ``knee`` while it is used in a ``with`` statement."""

    def __init__(self, node: Node) -> None:
        self.node = node
        self.states = node.publisher("joint_states", JointState)
        self.over = threading.Event()

    def describe(self, *names: str) -> None:
        """Publish a description."""
        joints = [DescribedJoint(name, JointType.REVOLUTE, (-1.0, 1.0), 2.0, 3.0) for name in names]
        latched = default_qos(depth=1, latched=True)
        self.node.publisher("robot_description", String, latched).publish(String(make_description("robot", joints)))

    def _talk(self) -> None:
        while not self.over.wait(0.01):
            self.states.publish(JointState(Header(Time.of(clock.now())), ["other", "knee"], [9.0, 0.5]))

    def __enter__(self) -> Self:
        self.thread = threading.Thread(target=self._talk)
        self.thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.over.set()
        self.thread.join()


def why(network: Network, domain: int, text: str) -> str:
    """Return why a board with these parameters cannot be opened."""
    with pytest.raises((DeviceError, ConfigurationError)) as caught:
        opened(network, domain, text)
    return str(caught.value)


def test_what_is_missing_is_reported(node: Callable[..., Node], network: Network, domain: int):
    """Parameters, the controller, the description, a joint, states: the first that is missing."""
    assert "controller: it is missing" in why(network, domain, "")
    wrong = why(network, domain, "(controller c) (interface force)")
    assert "interface: 'force' is none of position, velocity, effort, trajectory" in wrong
    said = why(network, domain, "(controller c) (patience 0.3)")
    assert said.startswith("the joints of c are unknown: there is no service /c/get_parameters")
    silent = "(controller c) (joints (elbow)) (patience 0.3)"
    assert "no description came on /robot_description" in why(network, domain, silent)
    Talker(node("talker")).describe("knee")
    elbow, knee = (f"(controller c) (joints ({name}))" for name in ("elbow", "knee"))
    assert "the description has no joint elbow; it has knee" in why(network, domain, elbow)
    assert "no state of knee came on /joint_states within 0.3 s" in why(network, domain, f"{knee} (patience 0.3)")


def test_a_controller_that_does_not_obey_is_reported(node: Callable[..., Node], network: Network, domain: int):
    """An inactive one, an unknown one, and one that is listed while nobody listens."""
    manager = node("manager")
    states = [ControllerState("c", "inactive")]
    manager.serve(
        "/controller_manager/list_controllers", LIST_CONTROLLERS, lambda _: ListControllersResponse(controller=states)
    )
    with Talker(manager) as talker:
        talker.describe("knee")
        said = why(network, domain, "(controller c) (joints (knee))")
        assert said == "c is inactive; ros2 control switch_controllers --activate c"
        said = why(network, domain, "(controller d) (joints (knee))")
        assert said == "the controller manager has no d; it has c"
        states[0].state = "active"
        said = why(network, domain, "(controller c) (joints (knee)) (patience 1.0)")
        assert said.startswith("nobody takes commands on c/commands")


def test_only_what_is_measured_is_published(node: Callable[..., Node], network: Network, domain: int):
    """A robot without velocities and efforts has positions; nothing is sent before there is a command."""
    here, got = node("robot"), []
    here.subscribe("c/commands", Float64MultiArray, got.append)
    with Talker(here) as talker:
        talker.describe("knee")
        with closing(opened(network, domain, "(controller c) (joints (knee))")) as board:
            eventually(lambda: board.encoders()[0] == pytest.approx(math.degrees(0.5)), "no position")
            assert board.limits(0) == pytest.approx((math.degrees(-1.0), math.degrees(1.0)))
            with pytest.raises(NotSupportedError, match="does not measure joint velocities"):
                board.encoder_speeds()
            with pytest.raises(NotSupportedError, match="does not measure torques"):
                board.torques()
            assert got == []
            board.set_control_modes(ControlMode.POSITION_DIRECT)
            board.set_positions([30.0])
            eventually(lambda: any(one.data == pytest.approx([math.radians(30.0)]) for one in got), "no command")


class LateBoard(ControlBoard):
    """A board whose first cycle comes late, as on a busy machine."""

    driver_class = Ros2Board

    def _begin_cycles(self) -> None:
        """Not yet."""

    def begin(self) -> None:
        """Begin the cycles."""
        super()._begin_cycles()


def test_a_command_before_the_first_cycle_is_sent(node: Callable[..., Node], network: Network, domain: int):
    """It is the only one."""
    here, got = node("robot"), []
    here.subscribe("c/commands", Float64MultiArray, got.append)
    with Talker(here) as talker, closing(LateBoard(network=network)) as board:
        talker.describe("knee")
        board.open(Property.parse(f"(domain {domain}) (patience 5.0) (timeout 5.0) (controller c) (joints (knee))"))
        board.set_control_modes(ControlMode.POSITION_DIRECT)
        board.set_positions([30.0])
        board.begin()
        eventually(lambda: got, "no command")
        assert got[0].data == pytest.approx([math.radians(30.0)])


#: A robot with one joint that is killed.
ROBOT = """
import sys, threading
from rtf import clock
from rtf.ros2.messages import *
from rtf.ros2.node import Node
with Node("robot", domain=int(sys.argv[1])) as node:
    node.subscribe("c/commands", Float64MultiArray, print)
    states = node.publisher("joint_states", JointState)
    while True:
        states.publish(JointState(Header(Time.of(clock.now())), ["knee"], [float(sys.argv[2])]))
        clock.sleep(0.01)
"""


def position(board: Any) -> float:
    """Return the position of the joint, NaN while it is unknown."""
    try:
        return float(board.encoders()[0])
    except StaleStateError:
        return math.nan


def test_a_robot_that_is_killed_is_missed_and_comes_back(node: Callable[..., Node], network: Network, domain: int):
    """Without states measurements are stale, and it is reported once; those of the next program count."""
    said: list[str] = []
    network.report = said.append
    Talker(node("description")).describe("knee")

    @contextmanager
    def start(position: float) -> Iterator[subprocess.Popen[bytes]]:
        with subprocess.Popen([sys.executable, "-c", ROBOT, str(domain), str(position)]) as process:
            try:
                yield process
            finally:
                process.kill()

    with start(0.1) as first:
        board = opened(network, domain, "(controller c) (joints (knee)) (patience 20.0) (timeout 2.0)")
        with closing(board):
            assert board.encoders()[0] == pytest.approx(math.degrees(0.1))
            before = len(said)
            first.kill()
            eventually(lambda: any("no states of the joints come any more" in one for one in said), "it is not missed")
            eventually(lambda: math.isnan(position(board)), "an old position counts")
            state, missed = ExtendedState(1), said[before:]
            with start(0.2):
                eventually(lambda: position(board) == pytest.approx(math.degrees(0.2)), "it is not back", 20.0)
                assert board.fill_state(state) > clock.now() - 5.0
    assert len(missed) == 1


def test_after_a_pause_joints_do_not_rush(node: Callable[..., Node], network: Network, domain: int):
    """The thread of the board pauses for 0.5 s in a motion: setpoints go on from the last one, without a jump."""
    got: list[tuple[float, float]] = []
    node("listener").subscribe(
        "/arm_position_controller/commands",
        Float64MultiArray,
        lambda command: got.append((clock.monotonic(), math.degrees(command.data[0]))),
    )
    with (
        ros_robot(node, network),
        closing(opened(network, domain, controller="arm_position_controller")) as board,
    ):
        board.set_reference_speeds([10.0] * 3)
        board.position_move([10.0, 0.0, 0.0])
        eventually(lambda: got and got[-1][1] > 1.0, "it does not move")
        with board.board.lock:
            clock.SystemClock().sleep(0.5)
        eventually(lambda: got[-1][1] == pytest.approx(10.0), "it does not arrive")
    pairs = [(after[0] - before[0], after[1] - before[1]) for before, after in pairwise(got)]
    assert max(way for _, way in pairs) < 0.05 * (20.0 + 2 * 20.0) + 0.1
