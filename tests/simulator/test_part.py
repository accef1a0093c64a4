"""A part of the simulated robot is a control board: directly, and at the other end of a network in lockstep."""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np
import pytest

from icub import AXES, COUPLINGS, ICUB, PARTS, joint_to_motor, part_slice
from rtf import clock
from rtf.bottle import Property
from rtf.middleware.clocks.network_clock import LockstepClock
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.devices.trajectories import LEAST_MOVE
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import IRemoteVariables, PidType
from rtf.robot.yarp3.client import RemoteControlBoard
from rtf.simulator.part import SimulatedPart
from rtf.simulator.robot import SimulatedRobot

from ..robot.contract import ControlBoardContract
from .rig import Rig

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.robot.device import Device

pytestmark = pytest.mark.skipif(
    not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"
)


@pytest.fixture(scope="module")
def rig() -> Rig:
    """A robot that is put back to its home for each test."""
    return Rig()


@pytest.fixture(scope="module")
def robot() -> Iterator[SimulatedRobot]:
    """One of a single part on a network, likewise."""
    network = Network(LocalNames(), report=lambda _sentence: None)
    with SimulatedRobot(ICUB, network=network, parts=("left_arm",), lockstep=True) as robot:
        yield robot


@pytest.fixture(scope="module")
def time(robot: SimulatedRobot) -> Iterator[clock.Clock]:
    """Its time, in which all tests that come after take part."""
    with clock.use(LockstepClock("/clock", "test", network=robot.network)) as time:
        yield time


class _PartContract(ControlBoardContract):
    """What differs from other boards: not every joint can be compliant."""

    def settle(self) -> None:
        """See the contract: two messages later everything said has shown its effect."""
        self.advance(0.021)

    def can_be_compliant(self, board: Device) -> list[bool]:
        """See the contract: joints whose torque is sensed."""
        return [bool(flag) for flag in self.of(board, IRemoteVariables).variable("torqueControlEnabled").get(0)]


class _OnTheSpot(_PartContract):
    """A part without a network."""

    PART = ""

    @pytest.fixture
    def board(self, rig: Rig) -> SimulatedPart:
        """See the contract."""
        rig.simulation.reset()
        self.rig = rig
        return rig.part(self.PART)

    def advance(self, seconds: float) -> None:
        """See the contract."""
        self.rig.run(seconds)


class TestHead(_OnTheSpot):
    """Neck and eyes."""

    PART = "head"


class TestLeftArm(_OnTheSpot):
    """Shoulder, elbow, wrist and hand."""

    PART = "left_arm"


class TestThroughTheNetwork(_PartContract):
    """The arm behind its ports, in a simulator's time."""

    @pytest.fixture
    def board(self, robot: SimulatedRobot, time: clock.Clock) -> Iterator[RemoteControlBoard]:
        """See the contract."""
        robot.simulation.reset()
        self.time = time
        client = RemoteControlBoard("arm", network=robot.network)
        client.open(Property({"remote": "/icubSim/left_arm", "local": "/test", "carrier": "tcp"}))
        with client:
            time.sleep(0.02)
            yield client

    def advance(self, seconds: float) -> None:
        """See the contract."""
        self.time.sleep(seconds)


class TestPart:
    """A part among others, and what it reports beyond the contract of boards."""

    @pytest.mark.parametrize("name", PARTS)
    def test_axes_are_those_of_the_part(self, name: str, rig: Rig):
        """Names, limits and speeds are the robot's."""
        rig.simulation.reset()
        part = rig.part(name)
        assert part.axis_names() == tuple(axis.name for axis in PARTS[name])
        assert [part.limits(joint) for joint in range(part.axes())] == [
            (axis.minimum, axis.maximum) for axis in PARTS[name]
        ]
        assert [part.velocity_limits(joint)[1] for joint in range(part.axes())] == [
            axis.max_velocity for axis in PARTS[name]
        ]
        assert [part.gearbox_ratio(joint) for joint in range(part.axes())] == [axis.gearbox for axis in PARTS[name]]
        blocks = [
            np.array(list(block)).reshape(2 * (int(len(block) ** 0.5),)) for block in part.variable("kinematic_mj")
        ]
        assert [len(block) for block in blocks] == [coupling.size for coupling in COUPLINGS[name]]
        whole, first = joint_to_motor(name), 0
        for block in blocks:
            assert block.tolist() == whole[first : first + len(block), first : first + len(block)].tolist()
            first += len(block)
        assert first == part.axes()

    def test_a_command_to_a_part_is_one_to_its_axes_only(self):
        """Axes of other parts keep mode, target and position."""
        rig = Rig()
        arm = rig.part("right_arm")
        before = rig.boards.targets.copy()
        arm.position_move(60.0, 3)
        own = np.zeros(len(AXES), dtype=bool)
        own[part_slice("right_arm")] = True
        assert (rig.boards.targets != before).tolist() == [
            bool(mine) and AXES[place].name == "r_elbow" for place, mine in enumerate(own)
        ]

    def test_one_refusal_does_not_stop_the_others(self):
        """Modes are asked for of every joint before the first refusal is reported."""
        rig = Rig()
        arm = rig.part("left_arm")
        with pytest.raises(RefusedError, match="l_wrist_pitch"):
            arm.set_interaction_modes(InteractionMode.COMPLIANT)
        assert arm.interaction_modes()[:5] == (InteractionMode.COMPLIANT,) * 5
        assert set(arm.interaction_modes()[5:]) == {InteractionMode.STIFF}

    def test_what_a_reader_gets_is_its_own(self):
        """Changing a returned array changes nothing in the robot."""
        part = Rig().part("head")
        for read in (part.encoders, part.target_positions, part.reference_speeds, part.temperatures, part.torques):
            read()[:] = 1e6
            assert read().max() < 1e6

    def test_references_of_the_controller_are_direct_positions(self):
        """They are followed in position-direct mode, and ignored in others."""
        rig = Rig()
        part = rig.part("head")
        part.set_pid_references(PidType.POSITION, 5.0, 2)
        rig.run(0.5)
        assert part.encoder(2) == pytest.approx(0.0, abs=0.1)
        part.set_control_modes(ControlMode.POSITION_DIRECT, 2)
        part.set_pid_references(PidType.POSITION, 1.0, 2)
        rig.run(1.0)
        assert part.encoder(2) == pytest.approx(1.0, abs=0.1)
        assert part.pid_references(PidType.POSITION, 2) == pytest.approx([1.0])
        assert part.pid_errors(PidType.POSITION, 2) == pytest.approx([0.0], abs=0.1)


def test_a_motion_is_not_done_in_the_first_period_after_its_command(rig: Rig):
    """Also where the joint stands on its target, for single joints and for many; a stop is done at once."""
    rig.simulation.reset()
    part = rig.part("left_arm")
    rig.run(0.1)
    assert part.motion_done()
    here = part.target_positions()
    part.position_move(here)
    rig.run(0.01)
    assert not part.motion_done()
    assert not part.motion_done(3)
    rig.run(LEAST_MOVE)
    assert part.motion_done()
    part.position_move(here[3], 3)
    assert not part.motion_done([3, 4])
    assert part.motion_done(4)
    part.stop(3)
    assert part.motion_done(3)
