"""The guard: each limit stops its joint and names it; changes are restored; a board without answers is reported."""

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
from rtf.robot.boards.client import connect
from rtf.robot.boards.server import ControlBoardServer
from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.devices.fake_board import FakeBoard
from rtf.robot.errors import NoAnswerError, NotSupportedError, RefusedError, RobotError, StaleStateError
from rtf.robot.extended_state import Field
from rtf.robot.interfaces import JointType, PidType, modes_for
from rtf.robot.network.outlets import PipelinedOutlets
from rtf.robot.yarp3.client import RemoteControlBoard
from rtf.robot_testing.guard.limits import GuardError, Limits
from rtf.robot_testing.guard.motion_guard import MotionGuard
from rtf.robot_testing.guard.motion_record import MotionRecord
from rtf.robot_testing.motion.part import Part

from ...robot.sensor_bench import ManualClock

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from rtf.robot.extended_state import ExtendedState
    from rtf.robot.interfaces import AxisSelection, FloatArray


class WrongBoard(FakeBoard):
    """A board with wrong measurements: field, joint and value."""

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
    """A clock whose sleepers find a new state when they wake up, once somebody publishes it."""

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
        self.server = ControlBoardServer(self.device, "/fake", network=self.network, outlets=PipelinedOutlets())
        stack.callback(self.server.close)
        self.board: RemoteControlBoard = stack.enter_context(connect("/fake", carrier="tcp", network=self.network))
        self.said: list[str] = []
        self.publish()

    def publish(self) -> None:
        """Publish the present state to the client."""
        self.server.publish(self.time.now())
        self.server.settle()

    def guard(self, limits: Limits | None = None) -> MotionGuard:
        """Return a guard that has just taken its snapshot."""
        return MotionGuard(self.board, "/fake", clock=self.time, report=self.said.append, limits=limits)

    def restore(self, guard: MotionGuard) -> None:
        """Restore the part, while states arrive."""
        self.time.publish = self.publish
        guard.restore()

    def measure(self, field: str, joint: int, value: float) -> None:
        """Let the board measure this from now on."""
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
    """The message has joint, part and value, and the moving joint is stopped."""
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
def test_values_just_within_the_limits_are_accepted(bench: Bench, field: str, value: float):
    """A value that is a tenth smaller stops nothing."""
    guard = bench.guard()
    bench.time.sleep(1.5)
    bench.measure(field, 1, value * 0.9)
    guard.watch()


def test_without_a_useful_speed_limit_the_commanded_speed_counts(bench: Bench):
    """Real boards allow all joints 1000 deg/s: then the limit follows from the commanded and the usual speed."""
    for joint in range(3):
        bench.device.set_velocity_limits(joint, 0.0, 1000.0)
    guard = bench.guard()
    bench.measure("joint_velocities", 1, 119.0)
    guard.watch()
    bench.measure("joint_velocities", 1, 121.0)
    with pytest.raises(GuardError, match=r"joint1 .* turns at 121 deg/s, too fast: more than 120 deg/s"):
        guard.watch()


def test_a_joint_on_a_slow_trajectory_is_fast_for_a_moment_only(bench: Bench):
    """Half the usual limit for a tenth of a second; a compliant joint, or one that a test drives, may be for longer."""
    bench.device.set_velocity_limits(1, 0.0, 1000.0)
    guard = bench.guard()
    bench.board.set_reference_speeds([20.0], [1])
    for speed, steps in ((61.0, 9), (59.0, 1), (61.0, 9), (0.0, 1)):
        bench.measure("joint_velocities", 1, speed)
        for _ in range(steps):
            guard.watch()
            bench.time.sleep(0.01)
            bench.publish()
    bench.measure("joint_velocities", 1, 61.0)
    for mode, interaction in (
        (ControlMode.PWM, InteractionMode.STIFF),
        (ControlMode.POSITION, InteractionMode.COMPLIANT),
    ):
        bench.board.set_control_modes(mode, 1)
        bench.board.set_interaction_modes(interaction, 1)
        for _ in range(15):
            bench.time.sleep(0.01)
            bench.publish()
            guard.watch()
    bench.board.set_interaction_modes(InteractionMode.STIFF, 1)
    bench.publish()
    guard.watch()
    bench.time.sleep(0.11)
    bench.publish()
    with pytest.raises(GuardError, match=r"turns at 61 deg/s for 0.1 s, too fast for its commanded 20 deg/s: .* 60"):
        guard.watch()


def test_the_speed_limit_follows_the_commanded_speed(bench: Bench):
    """It is three times that speed with the usual factor, and does not fall while a move goes on."""
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


def test_without_commanded_speeds_the_usual_speed_counts(bench: Bench, monkeypatch: pytest.MonkeyPatch):
    """The answer of the board may be lost at that moment."""
    guard = bench.guard()

    def lost() -> FloatArray:
        raise NoAnswerError("no answer")

    monkeypatch.setattr(guard._quantities[0], "_commanded_speeds", lost)
    bench.measure("joint_velocities", 1, 76.0)
    with pytest.raises(GuardError, match="too fast"):
        guard.watch()


def test_an_infinite_speed_limit_is_none(bench: Bench):
    """For tests in which joints fall."""
    guard = bench.guard(Limits(speed=math.inf))
    bench.measure("joint_velocities", 1, 1000.0)
    guard.watch()


def test_missing_speed_limits_of_a_board_are_reported(bench: Bench, monkeypatch: pytest.MonkeyPatch):
    """The joints are watched by the usual speed."""

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
def test_values_that_stop_stop_their_joint(bench: Bench, field: str):
    """It is reported at once, and the joint is stopped after half a second, as NaN exceeds no limit."""
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
def test_a_quantity_that_is_never_measured_is_reported(bench: Bench, field: str):
    """Boards may lack the sensor of a joint; the other joints are watched."""
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


def test_a_short_gap_of_the_values_is_accepted(bench: Bench):
    """The time starts anew with the next value, also after the clock was set back."""
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


def test_prismatic_joints_are_reported_and_not_moved_back(bench: Bench):
    """Their commands would be in metres: 20 deg/s would be 20 m/s."""
    bench.device.slides = frozenset({1})
    guard = bench.guard()
    assert bench.said == ["/fake: joint1 are prismatic: tests do not move them"]
    bench.measure("joint_positions", 1, 50.0)
    bench.device.commands.clear()
    bench.restore(guard)
    assert bench.device.commands == []


def test_a_limit_of_none_is_not_watched(bench: Bench):
    """A test that has to exceed a limit switches it off."""
    guard = bench.guard(Limits(torque=None, current=None, temperature=None))
    for field in ("torques", "currents", "temperatures"):
        bench.time.sleep(1.5)
        bench.measure(field, 1, 1000.0)
        guard.watch()


def test_limits_that_a_board_lacks_are_none(bench: Bench):
    """A board answers 0 or refuses; neither may stop a joint."""
    bench.device.set_temperature_limit(1, 0.0)
    bench.device.knows_torques = False
    guard = bench.guard()
    for field in ("torques", "temperatures"):
        bench.time.sleep(1.5)
        bench.measure(field, 1, 1000.0)
        guard.watch()


def test_a_joint_is_excluded_although_the_answer_is_lost(bench: Bench, monkeypatch: pytest.MonkeyPatch):
    """It gets no power afterwards."""
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


def test_an_excluded_joint_is_not_watched(bench: Bench):
    """It is left idle, with a report."""
    guard = bench.guard()
    guard.exclude(1, "it does not obey")
    assert bench.device.control_modes(1) == (ControlMode.IDLE,)
    assert bench.said == ["joint1 is left idle: it does not obey"]
    bench.measure("joint_positions", 1, 1000.0)
    guard.watch()


def test_changes_are_restored(bench: Bench):
    """Settings, speeds, modes and positions, each with a report."""
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


def test_unchanged_settings_are_not_written(bench: Bench):
    """After a test that changed nothing, no setting is written."""
    guard = bench.guard()
    guard.restore()
    assert bench.said == []


def test_a_board_without_answers_is_tried_once(bench: Bench):
    """The end of a test does not wait repeatedly; there is one error for the part."""
    guard = bench.guard()
    bench.server.close()
    with pytest.raises(RobotError, match=r"^/fake could not be restored: .*cannot be reached again") as caught:
        guard.restore()
    assert str(caught.value).count("cannot be reached again") == 1


def test_a_slow_joint_is_moved_back_slowly(bench: Bench):
    """The peak speed of its move is not beyond its greatest speed; the others are moved back at 20 deg/s."""
    bench.device.set_velocity_limits(0, 0.0, 16.0)
    guard = bench.guard()
    bench.device.position_move([20.0, 20.0], [0, 1])
    bench.time.sleep(10.0)
    bench.publish()
    speeds = []

    def publish() -> None:
        speeds.append(abs(bench.device.encoder_speeds([0, 1])))
        bench.publish()

    bench.time.publish = publish
    guard.restore()
    slow, other = max(speed[0] for speed in speeds), max(speed[1] for speed in speeds)
    assert 12.0 < slow <= 16.0
    assert 30.0 < other <= 40.0


def test_a_violation_on_the_way_back_stops_all_joints(bench: Bench):
    """All limits but those of positions are watched then."""
    guard = bench.guard()
    bench.device.position_move([50.0, 50.0], [0, 2])
    bench.time.sleep(10.0)
    bench.measure("joint_velocities", 2, -76.0)
    with pytest.raises(RobotError, match=r"on the way back joint2 \(/fake joint 2\) turns at 76 deg/s, too fast"):
        guard.restore()
    assert bench.device.motion_done()
    assert bench.device.encoders([0]) > 40.0


@pytest.mark.parametrize("mode", [ControlMode.TORQUE, ControlMode.PWM, ControlMode.CURRENT])
def test_driven_joints_are_held_in_position_mode(bench: Bench, mode: ControlMode):
    """A joint in such a mode ignores ``stop``."""
    guard = bench.guard()
    bench.device.set_control_modes(mode, 1)
    bench.measure("currents", 1, 10.5)
    with pytest.raises(GuardError, match=r"draws 10\.50 A, too much: more than 10\.00 A; it was stopped"):
        guard.watch()
    assert bench.device.control_modes(1) == (ControlMode.POSITION,)


def test_a_joint_that_cannot_be_held_gets_no_power(bench: Bench):
    """A board that refuses position mode to one of two joints holds the other."""
    guard = bench.guard()
    bench.device.set_control_modes(ControlMode.TORQUE)
    bench.publish()

    bench.device.refuses = frozenset({("mode", 1)})
    with pytest.raises(RobotError, match=r"refused .*joint 1"):
        guard.halt([0, 1])
    assert bench.device.control_modes(0) == (ControlMode.POSITION,)


def test_a_joint_that_draws_too_much_loses_its_torque_before_it_is_held(bench: Bench):
    """A mere stop would let it press on with what presses."""
    guard = bench.guard()
    bench.measure("currents", 1, 10.5)
    with pytest.raises(GuardError, match=r"draws 10\.50 A, too much"):
        guard.watch()
    modes = [command for command in bench.device.commands if command.startswith("modes")]
    assert modes[-2:] == ["modes ['idl', 'idl'] [1, 2]", "modes ['pos', 'pos'] [1, 2]"]  # they share motors


def test_a_refused_stop_is_a_failure_too(bench: Bench):
    """The message has the violation and the refusal."""
    guard = bench.guard()
    bench.device.refuses = frozenset({("mode", 1)})
    bench.measure("currents", 1, 10.5)
    with pytest.raises(
        GuardError, match=r"draws 10\.50 A, too much: more than 10\.00 A; it could not be stopped: .*joints 1"
    ):
        guard.watch()


def test_a_joint_without_a_position_is_stopped(bench: Bench):
    """NaN is within no limits, and the joint cannot be moved back."""
    guard = bench.guard()
    bench.measure("joint_positions", 1, float("nan"))
    with pytest.raises(GuardError, match=r"joint1 .* has no position: its encoder gives nan; it was stopped"):
        guard.watch()
    bench.device.commands.clear()
    with pytest.raises(RobotError, match="joint1 has no position, and cannot be brought back"):
        guard.restore()
    assert bench.device.commands == []


def test_quantities_that_a_board_lacks_are_not_watched(bench: Bench):
    """The board refuses them for single joints or all, or its state has no valid values."""
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


def test_a_greatest_current_of_0_is_no_limit(bench: Bench):
    """Boards report 0 for joints without a limit."""
    bench.device.set_max_current(1, 0.0)
    guard = bench.guard()
    bench.measure("currents", 1, 1000.0)
    guard.watch()


def test_a_failed_step_does_not_prevent_other_steps(bench: Bench):
    """For every joint and every kind of setting, with one error for all."""
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


def test_restoration_continues_after_single_lost_answers(bench: Bench, monkeypatch: pytest.MonkeyPatch):
    """A board is given up only after several requests without an answer."""
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


def test_driven_joints_are_stopped_first(bench: Bench):
    """Before settings are restored and other joints are moved back, which takes time."""
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
def test_a_move_that_goes_on_is_stopped(bench: Bench, mode: ControlMode):
    """A joint that has just started is near its old position, and its board would complete the move."""
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


def test_joints_are_stopped_if_it_is_unknown_whether_they_move(bench: Bench, monkeypatch: pytest.MonkeyPatch):
    """One lost answer must not let a joint go on."""
    guard = bench.guard()
    bench.device.position_move([60.0], [0])
    bench.device.set_control_modes(ControlMode.TORQUE, 1)
    bench.publish()

    def lost(joint: int | None = None) -> bool:
        raise NoAnswerError(f"no answer about joint {joint}")

    monkeypatch.setattr(bench.board, "motion_done", lost)
    bench.restore(guard)
    bench.time.sleep(10.0)
    assert bench.device.encoders([0]) == pytest.approx(0.0, abs=2.0)
    assert bench.device.control_modes() == guard.snapshot.modes


def test_a_joint_that_does_not_return_is_stopped(bench: Bench):
    """It would go on to push against an obstacle."""
    guard = bench.guard()
    bench.measure("joint_positions", 1, 50.0)
    bench.device.commands.clear()
    with pytest.raises(
        RobotError, match=r"joint1 did not return to its position before the test within 20 s; it was stopped"
    ):
        bench.restore(guard)
    assert bench.device.commands[-1] == "stop [1]"


def test_without_states_all_joints_are_held(bench: Bench):
    """Driven joints are held; a joint that was idle before is idle again."""
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


def test_a_part_is_restored_when_its_states_return(bench: Bench):
    """They had stopped for a moment, in which the joints were held."""
    guard = bench.guard()
    bench.device.position_move([50.0], [0])
    bench.time.sleep(10.0)
    bench.device.set_control_modes(ControlMode.TORQUE, 1)
    bench.restore(guard)
    assert bench.device.control_modes() == guard.snapshot.modes
    assert bench.device.encoders([0]) == pytest.approx(0.0, abs=2.0)
    assert bench.said[0] == "the states of /fake had stopped and are back; its joints were held meanwhile"


def test_joints_excluded_by_another_process_are_left_alone(bench: Bench):
    """They get no power and are not moved back."""
    guard = bench.guard()
    bench.device.position_move([50.0], [1])
    bench.time.sleep(10.0)
    bench.device.set_control_modes(ControlMode.IDLE, 1)
    bench.publish()
    guard.adopt_exclusions({1})
    guard.restore()
    assert bench.device.control_modes(1) == (ControlMode.IDLE,)
    assert bench.device.encoders([1]) == pytest.approx(50.0)


def test_an_excluded_joint_is_not_powered_with_a_coupled_one(bench: Bench):
    """That is a violation, after which the coupled joint is excluded, too."""
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


def test_a_joint_that_is_stopped_again_is_left_with_those_that_share_its_motors(bench: Bench):
    """The first stop may be an accident; one of another joint does not count."""
    guard = bench.guard()
    for stopped, joint in ((1, 1), (1, 0), (2, 1)):
        bench.measure("joint_positions", joint, 106.0)
        with pytest.raises(GuardError, match=f"joint{joint} "):
            guard.watch()
        assert guard.exclude_if_stopped_again(joint) is (stopped == 2)
    assert [guard.is_excluded(joint) for joint in range(3)] == [False, True, True]
    assert bench.device.control_modes() == (ControlMode.POSITION, ControlMode.IDLE, ControlMode.IDLE)


def test_an_excluded_joint_that_is_not_idle_is_reported_once(bench: Bench):
    """The command is repeated, and the other joints can still be tested."""
    guard = bench.guard()
    guard.exclude(1, "it runs away")
    for reported in (True, False):
        bench.time.sleep(0.5)
        bench.device.set_control_modes(ControlMode.POSITION, 1)
        bench.publish()
        with pytest.raises(GuardError) if reported else nullcontext():
            guard.watch()
        assert bench.device.control_modes(1) == (ControlMode.IDLE,)


def test_an_old_state_of_an_excluded_joint_is_no_violation(bench: Bench):
    """A joint that was excluded a moment ago may still be shown in its old mode."""
    guard = bench.guard()
    guard.exclude(1, "it runs away")
    guard.watch()
    assert bench.said == ["joint1 is left idle: it runs away"]


@pytest.mark.parametrize("by_somebody_else", [False, True])
def test_joints_coupled_with_an_excluded_one_stay_idle(bench: Bench, by_somebody_else: bool):
    """They went idle with it, and it would get power with them."""
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


def test_a_coupled_joint_that_kept_its_power_is_restored(bench: Bench):
    """For boards that change modes one by one."""
    guard = bench.guard()
    guard.exclude(1, "it runs away")
    bench.device.set_control_modes(ControlMode.VELOCITY, 2)
    bench.publish()
    bench.restore(guard)
    assert bench.device.control_modes() == (ControlMode.POSITION, ControlMode.IDLE, ControlMode.POSITION)


def test_without_known_couplings_an_excluded_joint_ends_idle(bench: Bench):
    """Another joint powers it on the way back; that is noticed, and it is idle in the end."""
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
def test_the_guard_does_not_need_gear_ratios(bench: Bench, ratio: float):
    """Some boards report ratios of 0; the guard needs the couplings only."""
    bench.device.gears = ratio
    guard = bench.guard()
    assert guard.exclude_coupled(1, "which has to be stopped") == {2: "is coupled with joint1, which has to be stopped"}
    bench.restore(guard)


def test_invalid_couplings_are_reported_once(bench: Bench):
    """No joint counts as coupled, the violation is still raised, and the part is restored."""
    bench.device.set_variable("kinematic_mj", Bottle([Bottle([1.0, 2.0])]))
    guard = bench.guard()
    guard.exclude(1, "it runs away")
    assert guard.exclude_coupled(1, "which has to be stopped") == {}
    bench.publish()
    bench.restore(guard)
    (said,) = (text for text in bench.said if "couplings" in text)
    assert said.startswith("the couplings of /fake are unknown, and taken for none: block 0 of kinematic_mj has 2")


def test_a_joint_that_was_outside_its_limits_returns_to_the_nearest_limit(bench: Bench):
    """Boards refuse targets outside, which prevented the whole part from being restored."""
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


def test_without_states_excluded_joints_stay_idle(bench: Bench):
    """Holding the others does not power them."""
    bench.device.together = frozenset({1, 2})
    guard = bench.guard()
    guard.exclude(1, "it runs away")
    bench.time.sleep(5.0)
    with pytest.raises(StaleStateError):
        guard.watch()
    assert bench.device.control_modes() == (ControlMode.POSITION, ControlMode.IDLE, ControlMode.IDLE)


def test_an_obstacle_on_the_way_back_is_recorded(bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Otherwise another process would push against it again."""
    monkeypatch.setenv("RTF_RUN_FOLDER", str(tmp_path))
    guard = bench.guard()
    bench.measure("joint_positions", 1, 50.0)
    with pytest.raises(RobotError, match="did not return"):
        bench.restore(guard)
    assert MotionRecord(tmp_path).is_blocked("/fake")


def test_moving_back_may_be_left_out(bench: Bench):
    """The settings are restored, and no joint moves."""
    guard = bench.guard()
    bench.device.position_move([50.0], [0])
    bench.time.sleep(10.0)
    bench.board.set_limits(1, -5.0, 5.0)
    bench.publish()
    guard.restore(move_back=False)
    bench.time.sleep(10.0)
    assert bench.device.encoders([0]) == pytest.approx(50.0)
    assert bench.board.limits(1) == guard.snapshot.limits[1]
