"""The guard: each limit stops its joint and names it; what a test changed is put back; a board that is gone is told."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

import pytest

from rtf import clock
from rtf.bottle import Property
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.network import Network
from rtf.robot.client.control_board import RemoteControlBoard, connect
from rtf.robot.control_modes import ControlMode
from rtf.robot.devices.fake_board import FakeBoard
from rtf.robot.errors import RefusedError, RobotError
from rtf.robot.interfaces import PidType
from rtf.robot.server.control_board import ControlBoardServer
from rtf.robot.server.outlets import PostingOutlets
from rtf.robot_testing.guard import GuardError, Limits, MotionGuard

from ..robot.sensor_bench import ManualClock  # noqa: TID252 - a neighbour among the tests

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.robot.extended_state import ExtendedState
    from rtf.robot.interfaces import AxisSelection, FloatArray


class WrongBoard(FakeBoard):
    """A board of which single measurements can be made to be what they should not: field, joint and value."""

    wrong: tuple[str, int, float] | None = None
    knows_torques = True

    def fill_state(self, state: ExtendedState) -> float:
        """See IStateSource."""
        time = super().fill_state(state)
        if self.wrong is not None:
            field, joint, value = self.wrong
            getattr(state, field)[joint] = value
        return time

    def temperatures(self, motors: AxisSelection = None) -> FloatArray:
        """See IMotor."""
        values = super().temperatures(motors)
        if self.wrong is not None and self.wrong[0] == "temperatures":
            values[self.wrong[1]] = self.wrong[2]
        return values

    def torque_range(self, joint: int) -> tuple[float, float]:
        """See ITorqueControl."""
        super().torque_range(joint)
        if not self.knows_torques:
            raise RefusedError(f"joint {joint} has no torque control")
        return -20.0, 20.0


class Bench:
    """A board of three joints behind its ports, a client of it, and a guard."""

    def __init__(self, stack: ExitStack) -> None:
        self.network = Network(LocalNames())
        self.time = stack.enter_context(clock.use(ManualClock()))
        self.device = WrongBoard("fake", network=self.network)
        self.device.open(Property.parse("(GENERAL (Joints 3))"))
        stack.callback(self.device.close)
        self.server = ControlBoardServer(
            self.device, "/fake", network=self.network, outlets=PostingOutlets(self.network)
        )
        stack.callback(self.server.close)
        self.board: RemoteControlBoard = stack.enter_context(connect("/fake", carrier="tcp", network=self.network))
        self.said: list[str] = []
        self.publish()

    def publish(self) -> None:
        """Let the client have the state of now."""
        self.server.publish(self.time.now())
        self.server.settle()

    def guard(self, limits: Limits | None = None) -> MotionGuard:
        """A guard that has just seen how the part is."""
        return MotionGuard(self.board, "/fake", clock=self.time, report=self.said.append, limits=limits)

    def measure(self, field: str, joint: int, value: float) -> None:
        """Have the board measure this from now on."""
        self.device.wrong = (field, joint, value)
        self.publish()


@pytest.fixture
def bench() -> Iterator[Bench]:
    """The bench."""
    with ExitStack() as stack:
        yield Bench(stack)


WRONG = [
    pytest.param(
        "joint_positions", 106.0, r"joint1 \(/fake joint 1\) is at 106.0 deg, beyond its limits", id="position"
    ),
    pytest.param("joint_velocities", -76.0, "turns at 76 deg/s, too fast", id="speed"),
    pytest.param("currents", 10.5, "draws 10.50 A, too much", id="current"),
    pytest.param("torques", -31.0, "bears 31.0 Nm, too much", id="torque"),
    pytest.param("temperatures", 90.0, "has 90 degC, too hot", id="temperature"),
]


@pytest.mark.parametrize(("field", "value", "said"), WRONG)
def test_each_limit_stops_its_joint_and_names_it(bench: Bench, field: str, value: float, said: str):
    """The sentence has joint, part and value, and the joint that moved stands."""
    guard = bench.guard()
    bench.board.position_move([50.0], [1])
    guard.watch()
    bench.time.sleep(1.5)  # temperatures are asked for once a second
    bench.measure(field, 1, value)
    with pytest.raises(GuardError, match=said) as caught:
        guard.watch()
    assert caught.value.joint == 1
    assert bench.device.motion_done(1)


@pytest.mark.parametrize(("field", "value"), [(row.values[0], row.values[1]) for row in WRONG])
def test_just_within_the_limits_is_fine(bench: Bench, field: str, value: float):
    """A tenth less is no reason to stop anything."""
    guard = bench.guard()
    bench.time.sleep(1.5)
    bench.measure(field, 1, value * 0.9)
    guard.watch()


def test_what_is_not_limited_is_not_watched(bench: Bench):
    """A test that has to go beyond a limit says so."""
    guard = bench.guard(Limits(torque=None, current=None, temperature=None))
    for field in ("torques", "currents", "temperatures"):
        bench.time.sleep(1.5)
        bench.measure(field, 1, 1000.0)
        guard.watch()


def test_limits_that_a_board_does_not_have_are_none(bench: Bench):
    """It says 0, or refuses to say: neither may stop a joint."""
    bench.device.set_temperature_limit(1, 0.0)
    bench.device.knows_torques = False
    guard = bench.guard()
    for field in ("torques", "temperatures"):
        bench.time.sleep(1.5)
        bench.measure(field, 1, 1000.0)
        guard.watch()


def test_joint_that_was_given_up_is_not_watched(bench: Bench):
    """It is left idle, and said so."""
    guard = bench.guard()
    guard.give_up(1, "it does not obey")
    assert bench.device.control_modes(1) == (ControlMode.IDLE,)
    assert bench.said == ["joint1 is left idle: it does not obey"]
    bench.measure("joint_positions", 1, 1000.0)
    guard.watch()


def test_what_was_changed_is_put_back(bench: Bench):
    """Settings, speeds, modes and places; and each that was put back is told."""
    board, guard = bench.board, bench.guard()
    gains = board.pid(PidType.POSITION, 1)
    board.set_limits(1, -5.0, 5.0)
    board.set_max_current(1, 3.0)
    board.set_reference_speeds([77.0], [1])
    bench.device.set_control_modes(ControlMode.VELOCITY, 2)
    bench.publish()
    guard.restore()
    assert board.limits(1) == guard.snapshot.limits[1]
    assert board.max_current(1) == guard.snapshot.max_currents[1]
    assert board.reference_speeds(1) == guard.snapshot.speeds[1]
    assert board.pid(PidType.POSITION, 1) == gains
    assert bench.device.control_modes(2) == (ControlMode.POSITION,)
    assert [text.split(":")[0] for text in bench.said] == ["joint1", "joint1", "joint2"]


def test_nothing_is_written_where_nothing_was_changed(bench: Bench):
    """A test that leaves everything as it was has nothing put back."""
    guard = bench.guard()
    guard.restore()
    assert bench.said == []


def test_board_that_is_gone_is_tried_once(bench: Bench):
    """The end of a test does not wait for the same board again and again; the problem is told in one sentence."""
    guard = bench.guard()
    bench.server.close()
    with pytest.raises(
        RobotError, match=r"^/fake could not be put back as it was: .*cannot be reached again"
    ) as caught:
        guard.restore()
    assert str(caught.value).count("cannot be reached again") == 1


def test_joint_that_does_what_it_may_not_on_its_way_back_stops_all(bench: Bench):
    """Nobody looks on when a robot is put back: the guard does. Where joints are is no matter, as they come back."""
    guard = bench.guard()
    bench.device.position_move([50.0, 50.0], [0, 2])
    bench.time.sleep(10.0)
    bench.measure("joint_velocities", 2, -76.0)
    with pytest.raises(RobotError, match=r"on the way back joint2 \(/fake joint 2\) turns at 76 deg/s, too fast"):
        guard.restore()
    assert bench.device.motion_done()
    assert bench.device.encoders([0]) > 40.0
