"""A simulated robot whose boards are on CAN buses: lockstep, through firmware, bus, driver and control board."""

from __future__ import annotations

import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np
import pytest

from rtf import clock
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.robot.control_modes import ControlMode
from rtf.robot.devices.can.axis_settings import can_settings
from rtf.robot.devices.can.motion_control import CanMotionControl
from rtf.robot.devices.control_board import _Cycles
from rtf.robot.errors import StaleStateError
from rtf.robot.model import load_robot
from rtf.simulator.firmware.boards_on_buses import Firmware
from rtf.simulator.firmware.configuration import can_configuration
from rtf.simulator.plant import Options, build
from rtf.simulator.robot import SimulatedRobot
from rtf.simulator.simulation import Simulation
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.robot.devices.control_board import ControlBoard


@contextmanager
def robot(said: list[str] | None = None, *, lockstep: bool = True) -> Iterator[tuple[SimulatedRobot, ControlBoard]]:
    """The bench through CAN, and its arm."""
    network = Network(LocalNames())
    if said is not None:
        network.report = said.append
    with SimulatedRobot(load_robot("bench"), network=network, lockstep=lockstep, can=True) as made:
        yield made, made.parts["arm"]  # type: ignore[misc]  # on one bus, so no remapper


def wait(seconds: float) -> None:
    """Let the simulated time pass."""
    clock.current().sleep(seconds)


def drive() -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Move both joints, and return what is measured meanwhile, with the time."""
    with robot() as (made, arm):
        arm.set_reference_speeds([20.0, 30.0])
        arm.position_move([10.0, 40.0])
        rows = []
        for _ in range(100):
            wait(0.02)
            rows.append([made.simulation.now, *arm.encoders(), *arm.encoder_speeds(), *arm.currents(), *arm.torques()])
        assert arm.motion_done()
        assert arm.encoders() == pytest.approx([10.0, 40.0], abs=0.5)
        return np.array(rows)


def test_two_runs_are_equal_to_the_last_bit():
    """A move through firmware, bus and driver: the same frames at the same times, whatever the machine does."""
    assert np.array_equal(drive(), drive())


def test_a_mode_and_a_move_may_be_commanded_at_once():
    """A move in the very cycle in which the mode is entered is sent: there is no pause between two requests."""
    with robot() as (_, arm):
        arm.set_control_modes(ControlMode.IDLE, 0)
        wait(0.2)
        arm.set_control_modes(ControlMode.POSITION, 0)
        arm.position_move(10.0, 0)
        wait(2.0)
        assert arm.encoders(0)[0] == pytest.approx(10.0, abs=0.5)


def test_modes_and_efforts_reach_the_motors():
    """Direct positions, velocities, torques and duty cycles are obeyed in their modes, and end when they expire."""
    with robot() as (made, arm):
        boards = made.simulation.boards
        arm.set_control_modes(ControlMode.POSITION_DIRECT, 0)
        arm.set_positions(3.0, 0)
        wait(0.5)
        assert arm.encoders(0)[0] == pytest.approx(3.0, abs=0.5)
        arm.set_control_modes(ControlMode.VELOCITY, 0)
        arm.velocity_move(10.0, 0)
        wait(0.4)
        assert arm.encoder_speeds(0)[0] == pytest.approx(10.0, abs=2.0)
        wait(1.5)  # nobody renews it
        assert arm.encoder_speeds(0)[0] == pytest.approx(0.0, abs=0.5)
        arm.set_control_modes(ControlMode.PWM, 0)
        arm.set_reference_duty_cycles(4.0, 0)
        wait(0.1)
        assert boards.mode[0] == ControlMode.PWM
        assert boards.duties[0] == pytest.approx(4.0, abs=0.01)
        arm.set_control_modes(ControlMode.TORQUE, 1)
        arm.set_reference_torques(0.5, 1)
        wait(0.1)
        assert boards.torques[1] == pytest.approx(0.5, abs=0.01)


def test_a_command_and_the_cycle_do_not_wait_for_each_other(monkeypatch: pytest.MonkeyPatch):
    """In real time: a command that waits for the loop, which is about to do a cycle, holds nothing that this needs."""
    due, writing = threading.Event(), threading.Event()
    publish, configure = _Cycles.publish, CanMotionControl.configure
    deadlocks: list[str] = []
    with robot(lockstep=False) as (made, arm):

        def publish_late(cycles: _Cycles, now: float) -> None:
            if not due.is_set():
                due.set()
                eventually(lambda: made.simulation.lock.waiting, "no command waits")
                if writing.is_set():  # with the board's lock
                    deadlocks.append("the command waits for the loop, and the cycle for the command")
                    return
            publish(cycles, now)

        def configure_and_signal(driver: CanMotionControl, axis: int) -> None:
            writing.set()
            configure(driver, axis)

        monkeypatch.setattr(_Cycles, "publish", publish_late)
        monkeypatch.setattr(CanMotionControl, "configure", configure_and_signal)
        assert due.wait(20)
        arm.set_control_modes(ControlMode.IDLE, 0)
        assert writing.is_set()
        assert deadlocks == []


def test_a_fault_of_a_board_reaches_the_user_and_is_left_by_force_idle():
    """The firmware reports it in its status; the driver puts the axis into fault, with the board and the cause."""
    with robot() as (made, arm):
        with made.simulation.lock:
            made.simulation.boards.set_max_current(0, 0.0)
        wait(0.2)
        assert arm.control_modes(0) == (ControlMode.HARDWARE_FAULT,)
        assert "board 1 reports overcurrent" in arm.last_joint_fault(0)[1]
        assert arm.control_modes(1) == (ControlMode.POSITION,)
        arm.set_max_current(0, 0.0)  # at the host, too, where the current of a motor without power is only noise
        arm.set_control_modes(ControlMode.FORCE_IDLE, 0)
        wait(0.2)
        assert arm.control_modes(0) == (ControlMode.IDLE,)
        assert made.simulation.boards.mode[0] == ControlMode.IDLE


def test_after_a_reset_the_robot_is_as_after_its_start():
    """A fault, modes, settings and positions of before are gone at both ends of the bus, and it obeys again."""
    with robot() as (made, arm):
        arm.set_control_modes(ControlMode.TORQUE, 1)
        arm.set_limits(1, 10.0, 60.0)
        with made.simulation.lock:
            made.simulation.boards.set_max_current(0, 0.0)
        wait(0.2)
        assert arm.control_modes() == (ControlMode.HARDWARE_FAULT, ControlMode.TORQUE)
        made.simulation.reset()
        wait(0.3)
        assert arm.control_modes() == (ControlMode.POSITION, ControlMode.POSITION)
        assert arm.last_joint_fault(0) == (0, "")
        assert arm.limits(1)[0] < 10.0
        assert arm.encoders() == pytest.approx(made.simulation.boards.position, abs=0.1)
        arm.position_move([5.0, 20.0])
        wait(2.5)
        assert arm.encoders() == pytest.approx([5.0, 20.0], abs=0.5)
        assert arm.control_modes() == (ControlMode.POSITION, ControlMode.POSITION)


def test_boards_that_are_silent_are_reported():
    """The state is stale, with the names of board and bus; after their return it is fresh again."""
    said: list[str] = []
    with robot(said) as (made, arm):
        assert made.firmware is not None
        (wire,) = made.firmware.wires.values()
        wire.filters.append(lambda _frame, _time: [])
        wait(0.5)
        with pytest.raises(StaleStateError):
            arm.encoders()
        assert any("boards [1] on simulated arm0 have sent no positions" in sentence for sentence in said)
        wire.filters.clear()
        wait(0.5)
        assert arm.encoders()[0] == pytest.approx(0.0, abs=1.0)


def test_the_configuration_says_what_the_boards_are():
    """Limits, gearboxes and gains of the driver are those of the simulated boards, within whole numbers."""
    simulation = Simulation(build(load_robot("bench"), Options()))
    boards = simulation.boards
    gains = list(boards.pids)
    settings = can_settings(can_configuration(Firmware(simulation), "arm0"))
    for axis, one in enumerate(settings.axes):
        assert (one.board, one.index) == (1, axis)
        assert one.axis.name == boards.names[axis]
        assert one.axis.minimum == boards.minimum[axis]
        assert one.axis.supply_voltage == boards.supply_voltage[axis]
        assert one.axis.gearbox == boards.configured_gearbox[axis]
        assert one.axis.pid.kp == pytest.approx(gains[axis].kp, rel=0.05)
        assert one.axis.pid.kd == pytest.approx(gains[axis].kd, rel=0.05)
        assert one.axis.pid.ki == pytest.approx(gains[axis].ki, rel=0.3)
