"""The guard: each limit stops its joint and names it; what a test changed is put back; a board that is gone is told."""

from __future__ import annotations

import math
import re
from contextlib import ExitStack, nullcontext
from typing import TYPE_CHECKING

import pytest

from rtf import clock
from rtf.bottle import Bottle, Property
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.robot.client.boards import connect
from rtf.robot.client.control_board import RemoteControlBoard
from rtf.robot.control_modes import ControlMode
from rtf.robot.devices.fake_board import FakeBoard
from rtf.robot.errors import NoAnswerError, NotSupportedError, RefusedError, RobotError, StaleStateError
from rtf.robot.extended_state import Field
from rtf.robot.interfaces import JointType, PidType, modes_for
from rtf.robot.server.control_board import ControlBoardServer
from rtf.robot.server.outlets import PipelinedOutlets
from rtf.robot_testing.guard.limits import GuardError, Limits
from rtf.robot_testing.guard.motion_guard import MotionGuard
from rtf.robot_testing.guard.motion_record import MotionRecord
from rtf.robot_testing.motion.part import Part

from ...robot.sensor_bench import ManualClock  # noqa: TID252 - a neighbour among the tests

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from rtf.robot.extended_state import ExtendedState
    from rtf.robot.interfaces import AxisSelection, FloatArray


class WrongBoard(FakeBoard):
    """A board of which single measurements can be made to be what they should not: field, joint and value."""

    wrong: tuple[str, int, float] | None = None
    knows_torques = True
    lacks: frozenset[Field] = frozenset()  # what the state has not got
    refuses: frozenset[tuple[str, int]] = frozenset()  # methods that are refused, each for a joint
    together: frozenset[int] = frozenset()  # joints whose modes change together
    slides: frozenset[int] = frozenset()  # joints that do not turn
    gears: float | None = None  # the ratio of all gearboxes, if not the usual one

    def __init__(self, name: str, *, network: Network) -> None:
        super().__init__(name, network=network)
        self.commands: list[str] = []  # what made joints move, stand or change their modes

    def fill_state(self, state: ExtendedState) -> float:
        """See IStateSource."""
        time = super().fill_state(state)
        if self.wrong is not None:
            field, joint, value = self.wrong
            getattr(state, field)[joint] = value
        for lacking in self.lacks:
            state.valid[lacking] = False
        return time

    def joint_type(self, joint: int) -> JointType:
        """See IAxisInfo."""
        return JointType.PRISMATIC if joint in self.slides else super().joint_type(joint)

    def gearbox_ratio(self, motor: int) -> float:
        """See IMotor."""
        return super().gearbox_ratio(motor) if self.gears is None else self.gears

    def _may(self, method: str, joints: Sequence[int] | int) -> None:
        for joint in [joints] if isinstance(joints, int) else joints:
            if (method, joint) in self.refuses:
                raise RefusedError(f"joint {joint} does not let {method} be done")

    def stop(self, joints: AxisSelection = None) -> None:
        """See IPositionControl."""
        chosen = self._chosen(joints)
        self._may("stop", chosen)
        self.commands.append(f"stop {chosen}")
        super().stop(joints)

    def set_control_modes(self, modes: ControlMode | Sequence[ControlMode], joints: AxisSelection = None) -> None:
        """See IControlMode."""
        chosen = self._chosen(joints)
        self._may("mode", chosen)
        each = modes_for(len(chosen), modes)
        self.commands.append(f"modes {[mode.word for mode in each]} {chosen}")
        for mode, joint in zip(each, chosen, strict=True):
            super().set_control_modes(mode, [*self.together] if joint in self.together else joint)

    def max_current(self, motor: int) -> float:
        """See IAmplifierControl."""
        self._may("max_current", motor)
        return super().max_current(motor)

    def set_max_current(self, motor: int, current: float) -> None:
        """See IAmplifierControl."""
        self._may("set_max_current", motor)
        super().set_max_current(motor, current)

    def impedance(self, joint: int) -> tuple[float, float]:
        """See IImpedanceControl."""
        self._may("impedance", joint)
        return super().impedance(joint)

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


class PublishingClock(ManualClock):
    """One whose sleepers find a new state when they wake up, once somebody publishes it."""

    publish: Callable[[], None] | None = None

    def sleep(self, seconds: float) -> None:
        """See Clock."""
        super().sleep(seconds)
        if self.publish is not None:
            self.publish()


class Bench:
    """A board of three joints behind its ports, a client of it, and a guard."""

    def __init__(self, stack: ExitStack) -> None:
        self.network = Network(LocalNames())
        self.time = stack.enter_context(clock.use(PublishingClock()))
        self.device = WrongBoard("fake", network=self.network)
        # Joints 1 and 2 share their motors.
        coupling = "(kinematic_mj (1.0) (1.0 0.0 -1.0 1.0))"
        self.device.open(Property.parse(f"(GENERAL (Joints 3)) (VARIABLES {coupling})"))
        stack.callback(self.device.close)
        self.server = ControlBoardServer(
            self.device, "/fake", network=self.network, outlets=PipelinedOutlets(self.network)
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

    def restore(self, guard: MotionGuard) -> None:
        """Put the part back, while states come."""
        self.time.publish = self.publish
        guard.restore()

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
    pytest.param("joint_velocities", -76.0, "turns at 76 deg/s, too fast: more than 75 deg/s", id="speed"),
    pytest.param("currents", 10.5, "draws 10.50 A, too much: more than 10.00 A", id="current"),
    pytest.param("torques", -31.0, "has a torque of 31.0 Nm, too much: more than 30.0 Nm", id="torque"),
    pytest.param("temperatures", 90.0, "has 90 degC, too hot: more than 85 degC", id="temperature"),
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


def test_a_board_that_allows_every_speed_allows_none_that_is_unusual(bench: Bench):
    """Real boards say 1000 deg/s for all joints: what counts then is what a joint was told, and what any may turn."""
    for joint in range(3):
        bench.device.set_velocity_limits(joint, 0.0, 1000.0)
    guard = bench.guard()
    bench.measure("joint_velocities", 1, 119.0)
    guard.watch()
    bench.measure("joint_velocities", 1, 121.0)
    with pytest.raises(GuardError, match=r"joint1 .* turns at 121 deg/s, too fast: more than 120 deg/s"):
        guard.watch()


def test_a_joint_may_be_as_fast_as_it_was_told(bench: Bench):
    """Three times that with the usual limit; and nothing less while it is still on its way."""
    bench.device.set_velocity_limits(1, 0.0, 1000.0)
    guard = bench.guard()
    bench.board.set_reference_speeds([100.0], [1])
    bench.measure("joint_velocities", 1, -299.0)
    guard.watch()
    bench.board.set_reference_speeds([20.0], [1])
    guard.watch()
    bench.measure("joint_velocities", 1, -301.0)
    with pytest.raises(GuardError, match="too fast: more than 300 deg/s"):
        guard.watch()


def test_a_board_that_does_not_say_what_joints_were_told_stops_them_all_the_same(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
):
    """Its answer may be lost just then."""
    guard = bench.guard()

    def lost() -> FloatArray:
        raise NoAnswerError("no answer")

    monkeypatch.setattr(guard._quantities[0], "_commanded_speeds", lost)
    bench.measure("joint_velocities", 1, 76.0)
    with pytest.raises(GuardError, match="too fast"):
        guard.watch()


def test_an_infinite_limit_of_speeds_is_none(bench: Bench):
    """There are tests in which joints fall."""
    guard = bench.guard(Limits(speed=math.inf))
    bench.measure("joint_velocities", 1, 1000.0)
    guard.watch()


def test_a_board_without_greatest_speeds_is_watched_without_them(bench: Bench, monkeypatch: pytest.MonkeyPatch):
    """And it is reported."""

    def unknown(joint: int) -> tuple[float, float]:
        raise NotSupportedError(f"no velocity limits of joint {joint}")

    monkeypatch.setattr(bench.board, "velocity_limits", unknown)
    guard = bench.guard()
    assert bench.said == ["/fake has no greatest speed for joint0, joint1, joint2: their speeds have no limit"]
    for fastest in (Part("fake", bench.board, bench.time, one).fastest for one in (guard, None)):
        assert fastest.tolist() == [math.inf] * 3
    bench.measure("joint_velocities", 1, 121.0)
    with pytest.raises(GuardError, match="too fast"):
        guard.watch()


MEASURED = [row.values[0] for row in WRONG[1:]]


@pytest.mark.parametrize("field", MEASURED)
def test_what_was_measured_and_is_no_number_any_more_stops_its_joint(bench: Bench, field: str):
    """At once it is reported, once; for half a second it may be so. No number is more than any limit."""
    guard = bench.guard()
    guard.watch()
    bench.time.sleep(1.5)
    bench.measure(field, 1, math.nan)
    guard.watch()
    (said,) = bench.said
    assert re.fullmatch(r"the \w+ of /fake is not watched: there are no values \(joint1\)", said)
    bench.time.sleep(1.5)
    bench.publish()
    with pytest.raises(GuardError, match=r"joint1 .* has had no \w+ for 0.5 s, which is limited") as caught:
        guard.watch()
    assert caught.value.joint == 1
    assert len(bench.said) == 1


@pytest.mark.parametrize("field", MEASURED)
def test_what_was_never_measured_is_told_and_stops_nothing(bench: Bench, field: str):
    """There are boards without such sensors; the other joints are watched."""
    guard = bench.guard()
    bench.measure(field, 1, math.nan)
    for _ in range(3):
        guard.watch()
        bench.time.sleep(1.5)
        bench.publish()
    assert len(bench.said) == 1
    assert bench.said[0].endswith("is not watched: there are no values (joint1)")
    bench.measure(field, 0, 1000.0)
    with pytest.raises(GuardError, match="joint0"):
        guard.watch()


def test_a_moment_without_numbers_is_no_loss(bench: Bench):
    """It begins anew with the next number, also after a clock that jumped back."""
    guard = bench.guard()
    guard.watch()
    for wrong in (math.nan, 0.1, math.nan):
        bench.measure("currents", 1, wrong)
        guard.watch()
        bench.time.sleep(0.4)
        bench.publish()
        guard.watch()
    bench.time.time -= 5.0
    bench.publish()
    guard.watch()
    bench.time.sleep(0.4)
    bench.publish()
    guard.watch()


def test_joints_that_slide_are_told_and_not_brought_back(bench: Bench):
    """20 deg/s would be 20 m/s of theirs."""
    bench.device.slides = frozenset({1})
    guard = bench.guard()
    assert bench.said == ["/fake: joint1 are prismatic: tests do not move them"]
    bench.measure("joint_positions", 1, 50.0)
    bench.device.commands.clear()
    bench.restore(guard)
    assert bench.device.commands == []


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


def test_joint_whose_board_does_not_answer_is_excluded_all_the_same(bench: Bench, monkeypatch: pytest.MonkeyPatch):
    """Nobody powers it afterwards."""
    guard = bench.guard()

    def lost(modes: ControlMode, joints: AxisSelection = None) -> None:
        raise NoAnswerError(f"no answer to {modes} of {joints}")

    with monkeypatch.context() as patch:
        patch.setattr(bench.board, "set_control_modes", lost)
        with pytest.raises(NoAnswerError):
            guard.exclude(1, "it runs away")
    assert guard.is_excluded(1)
    bench.device.position_move([50.0], [1])
    bench.time.sleep(10.0)
    bench.publish()
    bench.restore(guard)
    assert bench.device.control_modes(1) == (ControlMode.IDLE,)
    assert bench.device.encoders([1]) == pytest.approx(50.0)


def test_joint_that_was_excluded_is_not_watched(bench: Bench):
    """It is left idle, and said so."""
    guard = bench.guard()
    guard.exclude(1, "it does not obey")
    assert bench.device.control_modes(1) == (ControlMode.IDLE,)
    assert bench.said == ["joint1 is left idle: it does not obey"]
    bench.measure("joint_positions", 1, 1000.0)
    guard.watch()


def test_what_was_changed_is_put_back(bench: Bench):
    """Settings, speeds, modes and places; and each that was put back is reported."""
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
    """The end of a test does not wait for the same board again and again; the problem is reported in one sentence."""
    guard = bench.guard()
    bench.server.close()
    with pytest.raises(RobotError, match=r"^/fake could not be restored: .*cannot be reached again") as caught:
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


@pytest.mark.parametrize("mode", [ControlMode.TORQUE, ControlMode.PWM, ControlMode.CURRENT])
def test_what_is_driven_is_held_instead(bench: Bench, mode: ControlMode):
    """To a joint in such a mode ``stop`` means nothing: it would go on."""
    guard = bench.guard()
    bench.device.set_control_modes(mode, 1)
    bench.measure("currents", 1, 10.5)
    with pytest.raises(GuardError, match=r"draws 10\.50 A, too much: more than 10\.00 A; it was stopped"):
        guard.watch()
    assert bench.device.control_modes(1) == (ControlMode.POSITION,)


def test_what_cannot_be_held_has_no_power(bench: Bench):
    """A board that refuses position mode to one of two joints holds the other."""
    guard = bench.guard()
    bench.device.set_control_modes(ControlMode.TORQUE)
    bench.publish()

    bench.device.refuses = frozenset({("mode", 1)})
    with pytest.raises(RobotError, match=r"refused .*joint 1"):
        guard.halt([0, 1])
    assert bench.device.control_modes(0) == (ControlMode.POSITION,)


def test_a_stop_that_is_refused_hides_no_danger(bench: Bench):
    """It is a failure of the robot with both sentences."""
    guard = bench.guard()
    bench.device.refuses = frozenset({("stop", 1)})
    bench.measure("currents", 1, 10.5)
    with pytest.raises(
        GuardError, match=r"draws 10\.50 A, too much: more than 10\.00 A; it could not be stopped: .*joints 1"
    ):
        guard.watch()


def test_a_joint_without_a_position_is_stopped(bench: Bench):
    """What is no number is within no limits; and nobody brings such a joint back."""
    guard = bench.guard()
    bench.measure("joint_positions", 1, float("nan"))
    with pytest.raises(GuardError, match=r"joint1 .* has no position: its encoder gives nan; it was stopped"):
        guard.watch()
    bench.device.commands.clear()
    with pytest.raises(RobotError, match="joint1 has no position, and cannot be brought back"):
        guard.restore()
    assert bench.device.commands == []


def test_what_a_board_has_not_got_is_not_watched(bench: Bench):
    """Over the network that is told by refusing: of single joints, or of all; or the state has it not."""
    device = bench.device
    device.knows_torques = False
    device.refuses = frozenset({("max_current", 0), ("impedance", 1)})
    device.lacks = frozenset({Field.TORQUES, Field.JOINT_VELOCITIES})
    bench.publish()
    guard = bench.guard()
    guard.watch()
    guard.watch()
    assert [text.split(":")[0] for text in bench.said] == ["the speed of /fake is not watched"]
    bench.measure("currents", 0, 1000.0)
    guard.watch()
    bench.measure("currents", 1, 10.5)
    with pytest.raises(GuardError, match="joint1"):
        guard.watch()
    bench.board.set_max_current(1, 3.0)
    device.set_impedance(2, 0.1, 0.2)
    guard.restore()
    assert bench.board.max_current(1) == guard.snapshot.max_currents[1]
    assert bench.board.impedance(2) == guard.snapshot.impedances[2]


def test_no_greatest_current_is_no_limit(bench: Bench):
    """Boards say 0 for joints that have none."""
    bench.device.set_max_current(1, 0.0)
    guard = bench.guard()
    bench.measure("currents", 1, 1000.0)
    guard.watch()


def test_one_thing_that_cannot_be_put_back_keeps_no_other(bench: Bench):
    """Of all joints, and in all that is put back; and it is reported."""
    board, guard = bench.board, bench.guard()
    for joint in range(3):
        board.set_max_current(joint, 3.0)
        board.set_limits(joint, -5.0, 5.0)
    bench.device.set_control_modes(ControlMode.IDLE, 2)
    bench.publish()
    bench.device.refuses = frozenset({("set_max_current", 0)})
    with pytest.raises(RobotError, match=r"/fake could not be restored: .*, joint 0$"):
        guard.restore()
    assert [board.max_current(joint) for joint in (1, 2)] == guard.snapshot.max_currents[1:]
    assert [board.limits(joint) for joint in range(3)] == guard.snapshot.limits
    assert bench.device.control_modes() == guard.snapshot.modes


def test_single_answers_that_are_lost_keep_nothing_from_being_put_back(bench: Bench, monkeypatch: pytest.MonkeyPatch):
    """Only a board that does not answer again and again is not asked any more."""
    guard = bench.guard()
    bench.device.position_move([50.0], [0])
    bench.time.sleep(10.0)
    bench.publish()

    def lost(joint: int) -> float:
        raise NoAnswerError(f"no answer about joint {joint}")

    monkeypatch.setattr(bench.board, "max_current", lost)
    with pytest.raises(RobotError, match="no answer about joint 0; no answer about joint 1; no answer about joint 2"):
        bench.restore(guard)
    assert bench.device.encoders([0]) == pytest.approx(0.0, abs=2.0)


def test_first_of_all_nobody_drives_a_joint(bench: Bench):
    """Before settings, and while others come back, which takes its time."""
    guard = bench.guard()
    bench.device.position_move([60.0], [0])
    bench.time.sleep(10.0)
    bench.device.set_control_modes(ControlMode.PWM, 1)
    bench.publish()
    bench.device.commands.clear()
    bench.restore(guard)
    assert bench.device.commands[0] == "modes ['pos'] [1]"
    assert bench.device.control_modes() == guard.snapshot.modes
    assert bench.said == ["joint1: is held, was left in ipwm"]


@pytest.mark.parametrize("mode", [ControlMode.POSITION, ControlMode.MIXED])
def test_what_is_on_its_way_does_not_go_on(bench: Bench, mode: ControlMode):
    """A joint that has just set off is still near where it was, and its board would take it to the end."""
    bench.device.set_control_modes(mode, 0)
    bench.publish()
    guard = bench.guard()
    bench.device.position_move([60.0], [0])
    bench.publish()
    bench.device.commands.clear()
    bench.restore(guard)
    assert bench.device.commands == ["stop [0]"]
    bench.time.sleep(10.0)
    assert bench.device.encoders([0]) == pytest.approx(0.0, abs=2.0)


def test_what_may_be_on_its_way_is_stopped_where_the_board_does_not_answer(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
):
    """One answer that is lost keeps no joint going."""
    guard = bench.guard()
    bench.device.position_move([60.0], [0])
    bench.device.set_control_modes(ControlMode.TORQUE, 1)
    bench.publish()

    def lost(joint: int) -> bool:
        raise NoAnswerError(f"no answer about joint {joint}")

    monkeypatch.setattr(bench.board, "motion_done", lost)
    bench.restore(guard)
    bench.time.sleep(10.0)
    assert bench.device.encoders([0]) == pytest.approx(0.0, abs=2.0)
    assert bench.device.control_modes() == guard.snapshot.modes


def test_what_does_not_come_back_is_stopped(bench: Bench):
    """It would push on for ever against what is in its way."""
    guard = bench.guard()
    bench.measure("joint_positions", 1, 50.0)
    bench.device.commands.clear()
    with pytest.raises(
        RobotError, match=r"joint1 did not return to its position before the test within 20 s; it was stopped"
    ):
        bench.restore(guard)
    assert bench.device.commands[-1] == "stop [1]"


def test_without_a_state_all_is_held_unseen(bench: Bench):
    """A joint that is driven while nobody sees it does not stay so; one that was idle is so again."""
    bench.device.set_control_modes(ControlMode.IDLE, 2)
    bench.publish()
    guard = bench.guard()
    bench.device.set_control_modes(ControlMode.TORQUE, 1)
    bench.device.set_control_modes(ControlMode.PWM, 2)
    bench.time.sleep(5.0)
    with pytest.raises(StaleStateError):
        guard.watch()
    held = (ControlMode.POSITION, ControlMode.POSITION, ControlMode.IDLE)
    assert bench.device.control_modes() == held
    bench.device.set_control_modes(ControlMode.TORQUE, 1)
    with pytest.raises(RobotError, match="its joints are held where they were then"):
        guard.restore()
    assert bench.device.control_modes() == held


def test_a_part_whose_states_come_again_is_put_back(bench: Bench):
    """They had stopped for a moment, in which it was held."""
    guard = bench.guard()
    bench.device.position_move([50.0], [0])
    bench.time.sleep(10.0)
    bench.device.set_control_modes(ControlMode.TORQUE, 1)
    bench.restore(guard)
    assert bench.device.control_modes() == guard.snapshot.modes
    assert bench.device.encoders([0]) == pytest.approx(0.0, abs=2.0)
    assert bench.said[0] == "the states of /fake had stopped and are back; its joints were held meanwhile"


def test_what_somebody_else_gave_up_is_left_alone(bench: Bench):
    """Neither powered nor brought back."""
    guard = bench.guard()
    bench.device.position_move([50.0], [1])
    bench.time.sleep(10.0)
    bench.device.set_control_modes(ControlMode.IDLE, 1)
    bench.publish()
    guard.adopt_exclusions({1})
    guard.restore()
    assert bench.device.control_modes(1) == (ControlMode.IDLE,)
    assert bench.device.encoders([1]) == pytest.approx(50.0)


def test_what_was_excluded_is_not_powered_with_a_neighbour(bench: Bench):
    """Nobody would look at it then; after that its neighbour is without power, too."""
    bench.device.together = frozenset({1, 2})
    guard = bench.guard()
    guard.exclude(1, "it runs away")
    bench.time.sleep(0.5)
    bench.publish()
    guard.watch()
    bench.device.set_control_modes(ControlMode.POSITION, 2)
    bench.publish()
    with pytest.raises(GuardError, match=r"joint1 \(/fake joint 1\) had been left idle, and was in pos: .* idle again"):
        guard.watch()
    assert bench.device.control_modes() == (ControlMode.POSITION, ControlMode.IDLE, ControlMode.IDLE)
    assert [guard.is_excluded(joint) for joint in range(3)] == [False, True, True]
    assert bench.said[-1] == "joint2 is left idle: it is coupled with joint1, which is to stay idle"


def test_what_does_not_become_idle_is_told_once(bench: Bench):
    """The others can still be tested; it is asked again and again."""
    guard = bench.guard()
    guard.exclude(1, "it runs away")
    for told in (True, False):
        bench.time.sleep(0.5)
        bench.device.set_control_modes(ControlMode.POSITION, 1)
        bench.publish()
        with pytest.raises(GuardError) if told else nullcontext():
            guard.watch()
        assert bench.device.control_modes(1) == (ControlMode.IDLE,)


def test_a_state_of_before_is_no_power(bench: Bench):
    """The one that was given up a moment ago may still be shown in its old mode."""
    guard = bench.guard()
    guard.exclude(1, "it runs away")
    guard.watch()
    assert bench.said == ["joint1 is left idle: it runs away"]


@pytest.mark.parametrize("by_somebody_else", [False, True])
def test_neighbours_of_what_was_excluded_are_not_put_back(bench: Bench, by_somebody_else: bool):
    """They went idle with it, and it would have power with them; not even for a moment."""
    bench.device.together = frozenset({1, 2})
    guard = bench.guard()
    bench.device.position_move([50.0], [2])
    bench.time.sleep(10.0)
    if by_somebody_else:
        bench.device.set_control_modes(ControlMode.IDLE, 1)
        guard.adopt_exclusions({1})
    else:
        guard.exclude(1, "it runs away")
    bench.device.commands.clear()
    bench.publish()
    bench.restore(guard)
    assert bench.device.control_modes() == (ControlMode.POSITION, ControlMode.IDLE, ControlMode.IDLE)
    assert not [command for command in bench.device.commands if "pos" in command]
    assert bench.said[-1] == "joint2 is left idle: its board left it idle with joint1, with which it is coupled"


def test_a_neighbour_that_kept_its_power_is_put_back(bench: Bench):
    """There are boards that change modes one by one."""
    guard = bench.guard()
    guard.exclude(1, "it runs away")
    bench.device.set_control_modes(ControlMode.VELOCITY, 2)
    bench.publish()
    bench.restore(guard)
    assert bench.device.control_modes() == (ControlMode.POSITION, ControlMode.IDLE, ControlMode.POSITION)


def test_where_couplings_are_not_told_what_was_excluded_stays_idle(bench: Bench):
    """On the way back its neighbour powers it; it is noticed, and the last word is idle."""
    bench.device.together = frozenset({1, 2})
    bench.device.set_variable("kinematic_mj", Bottle())
    guard = bench.guard()
    guard.exclude(1, "it runs away")
    bench.time.sleep(1.0)
    bench.measure("joint_positions", 2, 50.0)
    with pytest.raises(RobotError, match=r"on the way back joint1 \(/fake joint 1\) had been left idle"):
        bench.restore(guard)
    assert bench.device.control_modes() == (ControlMode.POSITION, ControlMode.IDLE, ControlMode.IDLE)


@pytest.mark.parametrize("ratio", [0.0, math.nan])
def test_gears_that_are_none_are_nothing_to_the_guard(bench: Bench, ratio: float):
    """It needs to know what is coupled, not by what ratio: there are boards that report 0."""
    bench.device.gears = ratio
    guard = bench.guard()
    assert guard.exclude_coupled(1, "which has to be stopped") == {2: "is coupled with joint1, which has to be stopped"}
    bench.restore(guard)


def test_invalid_couplings_are_reported_once_and_nothing_is_coupled(bench: Bench):
    """What a joint did is the message that matters, and the part is restored."""
    bench.device.set_variable("kinematic_mj", Bottle([Bottle([1.0, 2.0])]))
    guard = bench.guard()
    guard.exclude(1, "it runs away")
    assert guard.exclude_coupled(1, "which has to be stopped") == {}
    bench.publish()
    bench.restore(guard)
    (said,) = (text for text in bench.said if "couplings" in text)
    assert said.startswith("the couplings of /fake are unknown, and taken for none: block 0 of kinematic_mj has 2")


def test_a_joint_that_was_outside_of_its_limits_is_brought_back_to_the_nearest_one(bench: Bench):
    """Boards refuse a target outside, which kept the whole part from being restored."""
    bench.device.position_move([50.0], [0])
    bench.time.sleep(10.0)
    bench.device.set_limits(0, -20.0, 20.0)
    bench.publish()
    guard = bench.guard()
    bench.restore(guard)
    assert bench.device.encoders([0]) == pytest.approx(50.0)  # nobody has moved it
    bench.device.position_move([0.0], [0])
    bench.time.sleep(10.0)
    bench.publish()
    bench.restore(guard)
    assert bench.device.encoders([0]) == pytest.approx(20.0, abs=2.0)


def test_without_a_state_what_was_excluded_stays_idle(bench: Bench):
    """Whatever is held then does not power it."""
    bench.device.together = frozenset({1, 2})
    guard = bench.guard()
    guard.exclude(1, "it runs away")
    bench.time.sleep(5.0)
    with pytest.raises(StaleStateError):
        guard.watch()
    assert bench.device.control_modes() == (ControlMode.POSITION, ControlMode.IDLE, ControlMode.IDLE)


def test_what_was_blocked_is_noted(bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Somebody else would push against it again."""
    monkeypatch.setenv("RTF_RUN_FOLDER", str(tmp_path))
    guard = bench.guard()
    bench.measure("joint_positions", 1, 50.0)
    with pytest.raises(RobotError, match="did not return"):
        bench.restore(guard)
    assert MotionRecord(tmp_path).is_blocked("/fake")


def test_move_back_may_be_left_out(bench: Bench):
    """Nobody moves it; its settings are put back."""
    guard = bench.guard()
    bench.device.position_move([50.0], [0])
    bench.time.sleep(10.0)
    bench.board.set_limits(1, -5.0, 5.0)
    bench.publish()
    guard.restore(move_back=False)
    bench.time.sleep(10.0)
    assert bench.device.encoders([0]) == pytest.approx(50.0)
    assert bench.board.limits(1) == guard.snapshot.limits[1]
