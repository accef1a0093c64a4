"""Watches of joints that press: each uses up its time in its own condition, and what presses is released."""

from __future__ import annotations

from contextlib import ExitStack
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from icub import ICUB
from rtf import clock
from rtf.middleware.clocks.network_clock import LockstepClock
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.robot.boards.client import connect
from rtf.robot.control_modes import ControlMode
from rtf.robot.model.file import GuardTable
from rtf.robot_testing.guard.limits import GuardError
from rtf.robot_testing.guard.motion_guard import MotionGuard
from rtf.robot_testing.guard.watches.joint_state import JointBounds, JointState
from rtf.robot_testing.guard.watches.overload import overload
from rtf.robot_testing.guard.watches.pressing import pressing
from rtf.robot_testing.guard.watches.saturation import saturation
from rtf.robot_testing.guard.watches.stall import stall
from rtf.robot_testing.motion.part import Part
from rtf.simulator.faults.injection import FaultInjector
from rtf.simulator.robot import SimulatedRobot

if TYPE_CHECKING:
    from collections.abc import Iterator

BOUNDS = JointBounds(np.array([5.0]), np.array([10.0]), GuardTable(), (None,))
simulated = pytest.mark.skipif(
    not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"
)


def state(**values: Any) -> JointState:
    """One joint at rest in position mode, with other values."""
    usual: dict[str, Any] = {
        "following": True, "torquing": False, "commanded": False, "stiff": True, "still": True,
        "duties": 10.0, "resting": 10.0, "currents": 0.5, "errors": 0.0,
    }  # fmt: skip
    return JointState(**{name: np.array([value]) for name, value in (usual | values).items()})


@pytest.mark.parametrize(
    ("current", "share"), [(10.0, 1 / 0.3), (-10.0, 1 / 0.3), (5.0, 0.0), (0.0, -1 / 0.9), (np.nan, 0.0)]
)
def test_the_heat_of_a_motor_is_i_squared_beyond_nominal(current: float, share: float):
    """The peak current, of either sign, may last for its time; the nominal one for ever; less cools the motor."""
    assert overload(state(currents=current), BOUNDS) == pytest.approx(share)


def test_a_motor_of_unknown_currents_is_never_overloaded():
    """There is nothing to compare with."""
    unknown = JointBounds(np.array([np.inf]), np.array([np.inf]), GuardTable(), (None,))
    assert overload(state(currents=50.0), unknown) == 0.0


@pytest.mark.parametrize(
    ("values", "uses"),
    [
        ({"duties": -100.0}, True),
        ({"duties": 90.0}, False),
        ({"duties": 100.0, "following": False, "torquing": True}, True),
        ({"duties": 100.0, "following": False, "commanded": True}, False),
    ],
)
def test_a_controller_may_be_saturated_for_a_moment(values: dict[str, float], uses: bool):
    """An output that the test commands is no controller's."""
    assert bool(saturation(state(**values), BOUNDS) > 0) is uses


@pytest.mark.parametrize(
    ("values", "uses"),
    [
        ({}, True),
        ({"duties": 20.0}, False),  # as much as friction may take
        ({"errors": 0.9}, False),  # a resting joint may be as far away
        ({"still": False}, False),
        ({"stiff": False}, False),  # a compliant joint is away from its target
        ({"errors": np.nan}, False),
        ({"following": False}, False),
    ],
)
def test_a_stalled_joint_works_away_from_its_setpoint_without_moving(values: dict[str, float], uses: bool):
    """All of it has to hold."""
    assert bool(stall(state(**({"duties": 60.0, "errors": -3.0} | values)), BOUNDS) > 0) is uses


@pytest.mark.parametrize(
    ("values", "uses"),
    [({}, True), ({"still": False}, False), ({"resting": 50.0}, False), ({"torquing": False}, False)],
)
def test_a_torque_presses_if_it_moves_nothing(values: dict[str, float], uses: bool):
    """A torque that holds the joint does not press."""
    usual = {"torquing": True, "duties": 60.0, "resting": 10.0}
    assert bool(pressing(state(**(usual | values)), BOUNDS) > 0) is uses


class Torso:
    """The torso of a simulated robot in lockstep, and its guard."""

    def __init__(self, stack: ExitStack) -> None:
        network = Network(LocalNames())
        self.robot = stack.enter_context(SimulatedRobot(ICUB, network=network, parts=("torso",), lockstep=True))
        time = stack.enter_context(clock.use(LockstepClock("/clock", "test", network=network)))
        stack.callback(time.close)
        board = stack.enter_context(connect("/icubSim/torso", carrier="tcp", network=network))
        time.sleep(0.1)
        self.said: list[str] = []
        guard = MotionGuard(board, "/icubSim/torso", clock=time, report=self.said.append, robot=ICUB)
        self.part = Part("torso", board, time, guard)
        self.faults = FaultInjector(self.robot)

    @property
    def pressure(self) -> float:
        """The torque of torso_pitch beyond that of gravity (Nm)."""
        axis, boards = ICUB.index["torso_pitch"], self.robot.simulation.boards
        return abs(float(boards.data.actuator_force[axis] - boards.gravity()[axis]))


@pytest.fixture
def torso() -> Iterator[Torso]:
    """The torso."""
    with ExitStack() as stack:
        yield Torso(stack)


class Ticking:
    """Commands of torso_pitch in a mode, at every tick as in a test; ``felt`` is when it began to press (s)."""

    def __init__(self, torso: Torso, mode: ControlMode) -> None:
        self.torso, self.mode = torso, mode
        self.felt = np.inf

    def run(self, here: float, seconds: float) -> None:
        """Command away from ``here`` (deg), while the guard watches."""
        part = self.torso.part
        begin = part.clock.now()
        while (elapsed := part.clock.now() - begin) < seconds:
            self.command(part, elapsed, here)
            part.wait(0.02)
            if self.torso.pressure > 12.0:
                self.felt = min(self.felt, part.clock.now())

    def command(self, part: Part, elapsed: float, here: float) -> None:
        """Command once."""
        if self.mode is ControlMode.VELOCITY:
            part.board.velocity_move([20.0], [2])
        elif self.mode is ControlMode.POSITION_DIRECT:
            part.board.set_positions([here + min(10.0, 20.0 * elapsed)], [2])
        elif self.mode is ControlMode.TORQUE:
            part.board.set_reference_torques([40.0], [2])
        elif elapsed == 0.0:
            part.command_move([here + 10.0], [2])


@simulated
@pytest.mark.parametrize(
    "mode", [ControlMode.POSITION, ControlMode.VELOCITY, ControlMode.POSITION_DIRECT, ControlMode.TORQUE]
)
def test_a_blocked_joint_is_released_within_half_a_second(torso: Torso, mode: ControlMode):
    """In every mode. Afterwards it does not press, and is held again."""
    part, joint = torso.part, 2
    torso.faults.inject("jam", "torso_pitch")
    part.board.set_reference_speeds([20.0], [joint])
    part.set_mode(mode, [joint])
    ticking, here = Ticking(torso, mode), part.board.encoder(joint)
    with pytest.raises(GuardError, match=r"torso_pitch \(/icubSim/torso joint 2\) .*; it was released") as caught:
        ticking.run(here, 3.0)
    assert caught.value.finding == "blocked"
    assert part.clock.now() - ticking.felt < 0.5
    part.wait(0.3)
    assert torso.pressure < 4.0
    assert part.board.control_mode(joint) is ControlMode.POSITION


@simulated
def test_healthy_joints_are_not_released(torso: Torso):
    """Steps, full speed and torques of either sign, which a healthy joint answers."""
    part = torso.part
    part.set_mode(ControlMode.POSITION_DIRECT)
    for target in (2.0, -2.0, 0.0):
        part.board.set_positions([target] * 3)
        part.wait(0.5)
    part.set_mode(ControlMode.POSITION)
    for targets in ([30.0, 20.0, 40.0], [-30.0, -20.0, 0.0]):
        assert part.move(targets, speed=60.0).reached
    part.set_mode(ControlMode.TORQUE, [0])
    for torque in (2.0, -2.0):
        part.board.set_reference_torques([torque], [0])
        part.wait(0.3)
    assert torso.said == []
