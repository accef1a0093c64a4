"""The fake board: it keeps the contract of boards, and follows its configuration."""

from __future__ import annotations

import numpy as np
import pytest

from rtf.bottle import Property
from rtf.robot.control_modes import ControlMode
from rtf.robot.devices.fake_board import FakeBoard
from rtf.robot.errors import ConfigurationError, NotSupportedError, RefusedError
from rtf.robot.extended_state import ExtendedState, InterfaceState
from rtf.robot.interfaces import JointType

from .contract import ControlBoardContract
from .sensor_bench import ManualClock

CONFIGURATION = (
    "(GENERAL (Joints 4) (AxisName (neck_pitch neck_roll neck_yaw slide)) (AxisType (revolute revolute odd prismatic)))"
    " (LIMITS (Min (-40 -20 -50 0)) (Max (30 20 50 15))) (VARIABLES (kinematic_mj (1.0 0.0 0.0 1.0)))"
)


def opened(text: str = CONFIGURATION) -> FakeBoard:
    """Return an open board with this configuration."""
    board = FakeBoard("fake")
    board.open(Property.parse(text))
    return board


class TestFakeBoard(ControlBoardContract):
    """The fake board keeps the contract of control boards."""

    @pytest.fixture
    def board(self, stepped: ManualClock) -> FakeBoard:
        """See the contract."""
        self.time = stepped
        return opened()

    def advance(self, seconds: float) -> None:
        """See the contract."""
        self.time.sleep(seconds)


def test_configuration_names_axes_types_and_limits():
    """Names, types, limits and variables are those of the configuration."""
    board = opened()
    assert board.axis_names() == ("neck_pitch", "neck_roll", "neck_yaw", "slide")
    assert [board.joint_type(joint) for joint in range(4)] == [
        JointType.REVOLUTE,
        JointType.REVOLUTE,
        JointType.UNKNOWN,
        JointType.PRISMATIC,
    ]
    assert board.limits(0) == (-40.0, 30.0)
    assert board.variable("kinematic_mj").to_text() == "(1.0 0.0 0.0 1.0)"


def test_without_configuration_there_is_one_joint():
    """A board with an empty configuration has one joint, and no variables."""
    board = opened("")
    assert board.axis_names() == ("joint0",)
    with pytest.raises(NotSupportedError):
        board.variables()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("(GENERAL (Joints 0))", "Joints"),
        ("(GENERAL (Joints many))", "Joints"),
        ("(GENERAL (Joints 2) (AxisName (a)))", "AxisName"),
        ("(GENERAL (Joints 2) (AxisName a))", "AxisName"),
        ("(GENERAL (Joints 1)) (LIMITS (Min (a)))", "Min"),
        ("(GENERAL (Joints 2)) (LIMITS (Min (0 50)) (Max (10 20)))", "Min"),
    ],
)
def test_nonsense_is_named(text: str, said: str):
    """An invalid configuration is refused with the name of the parameter."""
    with pytest.raises(ConfigurationError, match=said):
        opened(text)


def test_a_move_lasts_the_way_over_the_speed(stepped: ManualClock):
    """A move of 10 deg at 10 deg/s takes a second, and is half done after half of it."""
    board = opened()
    board.set_reference_speeds(10.0, 0)
    board.position_move(10.0, 0)
    stepped.sleep(0.5)
    assert board.encoder(0) == pytest.approx(5.0)
    stepped.sleep(0.499)
    assert not board.motion_done()
    stepped.sleep(0.001)
    assert board.motion_done()
    assert board.encoder(0) == pytest.approx(10.0)


@pytest.mark.parametrize(("target", "speed"), [(0.0, 10.0), (0.0, 0.0), (10.0, 1e6)])
def test_a_move_has_a_least_duration(stepped: ManualClock, target: float, speed: float):
    """Any move, also of 0 deg, takes at least 0.05 s, so that clients see its begin."""
    board = opened()
    board.set_velocity_limits(0, 0.0, 1e6)
    board.set_reference_speeds(speed, 0)
    board.position_move(target, 0)
    assert not board.motion_done(0)
    stepped.sleep(0.049)
    assert not board.motion_done(0)
    stepped.sleep(0.001)
    assert board.motion_done(0)
    assert board.encoder(0) == pytest.approx(target)


@pytest.mark.parametrize("steps", [1, 7, 1000])
def test_speeds_do_not_depend_on_how_often_one_looks(stepped: ManualClock, steps: int):
    """A speed ramp covers the same way whatever the number of readings meanwhile."""
    board = opened()
    board.set_reference_accelerations(50.0, 0)
    board.set_control_modes(ControlMode.VELOCITY, 0)
    board.velocity_move(10.0, 0)
    for _ in range(steps):
        stepped.sleep(1.0 / steps)
        board.encoders()
    assert board.encoder(0) == pytest.approx(9.0)


def test_no_acceleration_is_any_acceleration(stepped: ManualClock):
    """With reference acceleration 0 a joint has its speed at once; with reference speed 0 it never arrives."""
    board = opened()
    board.set_reference_accelerations(0.0, 0)
    board.set_reference_speeds(0.0, 1)
    board.set_control_modes(ControlMode.VELOCITY, 0)
    board.velocity_move(10.0, 0)
    board.position_move(10.0, 1)
    stepped.sleep(1.0)
    assert board.encoders([0, 1]) == pytest.approx([10.0, 0.0], abs=1e-6)
    assert not board.motion_done(1)


def test_a_running_joint_stops_at_its_limit(stepped: ManualClock):
    """A joint in velocity mode stops at its limit, with speed 0."""
    board = opened()
    board.set_control_modes(ControlMode.VELOCITY, 0)
    board.velocity_move(40.0, 0)
    for _ in range(50):
        stepped.sleep(0.1)
        board.encoders()
    assert board.encoder(0) == 30.0
    assert board.encoder_speeds(0)[0] == 0.0


def test_whole_state_is_what_the_interfaces_say(stepped: ManualClock):
    """``fill_state`` gives the values that the interfaces give one by one."""
    board = opened()
    board.position_move([5.0, 6.0], [0, 1])
    stepped.sleep(0.25)
    at_once, by_parts = ExtendedState(4), ExtendedState(4)
    times = board.fill_state(at_once), InterfaceState(board).fill_state(by_parts)
    assert times == (stepped.now(), stepped.now())
    assert at_once.valid.all()
    assert by_parts.valid.all()
    assert np.array_equal(at_once.floats, by_parts.floats)
    assert np.array_equal(at_once.modes, by_parts.modes)
    assert np.array_equal(at_once.temperatures, by_parts.temperatures)


def test_encoders_are_declared(stepped: ManualClock):
    """Set encoders are the joint's position, and end its move; resetting makes them 0."""
    board = opened()
    board.position_move(20.0, 0)
    board.set_encoders([1.0, 2.0], [0, 1])
    stepped.sleep(5.0)
    assert board.encoders([0, 1]).tolist() == [1.0, 2.0]
    board.reset_encoders()
    assert board.encoders().tolist() == [0.0] * 4
    board.set_motor_encoders(50.0, 1)
    assert board.motor_encoders([0, 1]).tolist() == [0.0, 50.0]
    board.reset_motor_encoders(1)
    assert board.motor_encoders(1).tolist() == [0.0]


def test_values_that_make_no_sense_are_refused():
    """A gearbox ratio of 0 and a negative speed limit are refused."""
    board = opened()
    with pytest.raises(RefusedError):
        board.set_gearbox_ratio(0, 0.0)
    with pytest.raises(RefusedError):
        board.set_velocity_limits(0, -1.0, 5.0)


def test_reference_speeds_are_clipped_and_never_negative():
    """Reference speeds are clipped to the joint's greatest, accelerations are not; negative ones are refused."""
    board = opened()
    board.set_reference_speeds([1e6, 20.0], [0, 1])
    assert board.reference_speeds([0, 1]).tolist() == [50.0, 20.0]
    board.set_reference_accelerations(1e6, 0)
    assert board.reference_accelerations(0).tolist() == [1e6]
    for change in (board.set_reference_speeds, board.set_reference_accelerations):
        with pytest.raises(RefusedError, match=r"fake: .* must not be negative"):
            change(-1.0, 0)
