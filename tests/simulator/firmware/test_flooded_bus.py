"""A bus that a board floods: control goes on, or it stops safely and the user is warned."""

from __future__ import annotations

import pytest

from rtf.robot.control_modes import ControlMode
from rtf.robot.errors import StaleStateError
from rtf.simulator.faults import find_kind

from .test_can_robot import robot, wait

BUS = "arm0"


def test_control_goes_on_below_the_arbitration():
    """Frames of the lowest priority take what is left: a move arrives, and states are fresh."""
    with robot() as (made, arm):
        babbling = find_kind("can_babbling")(made, BUS, {"identifier": 0x7FF})
        babbling.start()
        before, since = made.firmware.wires[BUS].bits, made.simulation.now
        target = arm.encoders() + 5.0
        arm.set_control_modes(ControlMode.POSITION)
        arm.set_reference_speeds([20.0, 20.0])
        arm.position_move(target)
        wait(2.0)
        assert (made.firmware.wires[BUS].bits - before) / 1e6 / (made.simulation.now - since) > 0.99
        assert arm.encoders() == pytest.approx(target, abs=0.5)


def test_joints_stop_and_the_user_is_warned_above_the_arbitration():
    """Frames of the highest priority leave nothing to others: boards stop by their time-outs, and obey afterwards."""
    said: list[str] = []
    with robot(said) as (made, arm):
        arm.set_control_modes(ControlMode.VELOCITY)
        arm.velocity_move([5.0, 5.0])
        wait(0.3)
        babbling = find_kind("can_babbling")(made, BUS, {"identifier": 0})
        babbling.start()
        for _ in range(16):  # the client lives
            arm.velocity_move([5.0, 5.0])
            wait(0.1)
        assert any("have sent no positions" in line for line in said)
        with pytest.raises(StaleStateError):
            arm.encoders()
        speeds = made.simulation.boards.trajectories.at(made.simulation.boards.tick, [0, 1])[1]
        assert speeds.tolist() == [0.0, 0.0]
        babbling.end()
        wait(0.8)
        arm.set_control_modes(ControlMode.FORCE_IDLE)
        wait(0.2)
        arm.set_control_modes(ControlMode.POSITION)
        target = arm.encoders() - 5.0
        arm.set_reference_speeds([20.0, 20.0])
        arm.position_move(target)
        wait(2.0)
        assert arm.encoders() == pytest.approx(target, abs=0.5)
