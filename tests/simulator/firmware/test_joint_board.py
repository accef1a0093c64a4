"""Tests of an emulated joint board: a host that knows the protocol only, on a bus, and a simulated robot."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import pytest

from rtf.robot.devices.can import motor_messages as m
from rtf.robot.devices.can import sensor_messages as s
from rtf.robot.devices.can.codes import BoardMode, BoardType, JointFault
from rtf.robot.devices.can.messages import Frame
from rtf.robot.model import load_robot
from rtf.simulator.firmware.parameters import SETTINGS
from rtf.simulator.plant import Options, build
from rtf.simulator.simulation import Simulation

from .can_bench import CanBench

if TYPE_CHECKING:
    from rtf.robot.devices.can.messages import Message, Setting


@pytest.fixture
def bench() -> CanBench:
    """A board after power-up."""
    return CanBench()


@pytest.fixture
def ready() -> CanBench:
    """A board that is configured, and holds its joints."""
    bench = CanBench()
    bench.configure()
    for axis in (0, 1):
        bench.send(m.SET_CONTROL_MODE, BoardMode.POSITION, axis=axis)
    return bench


def test_a_board_without_gains_and_limits_has_no_power(bench: CanBench):
    """It is idle and refuses every mode with power, until gains and limits have been received."""
    assert bench.mode() == BoardMode.IDLE
    bench.send(m.SET_CONTROL_MODE, BoardMode.POSITION)
    assert bench.mode() == BoardMode.IDLE
    bench.configure()
    bench.send(m.SET_CONTROL_MODE, BoardMode.POSITION)
    assert bench.mode() == BoardMode.POSITION
    assert bench.mode(axis=1) == BoardMode.IDLE


def test_settings_are_read_back_as_they_were_written(bench: CanBench):
    """Every setting, of each axis by itself; single gains are those of the controller."""
    live = {m.DESIRED_POSITION.set.name, m.DESIRED_VELOCITY.set.name, m.BOARD_ID.set.name, m.INFORMATION.set.name}
    for setting in SETTINGS:
        if setting.set.name in live:
            continue
        for axis in (0, 1):
            values = tuple(place + 1 + axis for place, _ in enumerate(setting.set.fields))
            bench.send(setting.set, *values, axis=axis)
            assert bench.ask(setting, axis=axis) == values
    bench.send(m.POSITION_PID.set, 1, 2, 3, 4)
    bench.send(m.P_GAIN.set, 77)
    bench.send(m.D_GAIN.set, 99)
    assert bench.ask(m.POSITION_PID) == (77, 2, 99, 4)
    assert bench.ask(m.I_GAIN) == (2,)


@pytest.mark.parametrize("command", [m.BOARD_ID.set, s.SET_ADDRESS])
def test_a_board_takes_another_address_and_keeps_it(bench: CanBench, command: Message):
    """It answers and broadcasts there, also after a reset; what is no address is dropped."""
    bench.send(m.BROADCASTS, 1)
    bench.send(command, 15)
    assert (bench.board.address, bench.board.rejected) == (1, 1)
    bench.send(command, 5)
    bench.board.reset()
    bench.got.clear()
    bench.connection.send(m.VERSION.get.frame(1, 1, 6))
    bench.connection.send(m.BROADCASTS.frame(5, 1))
    bench.connection.send(m.BOARD_ID.get.frame(5))
    bench.run(0.01)
    assert {one.source for _, one in bench.got} == {5}
    assert [values for _, values in bench.messages(m.BOARD_ID.value)] == [(5,)]
    assert bench.messages(m.BROADCAST_POSITION)


def test_gains_of_a_board_are_those_of_the_controller(ready: CanBench):
    """The gains that were sent, in whole numbers, are those of the robot within their rounding."""
    built = Simulation(build(load_robot("bench"), Options())).boards.pids[0]
    sent = ready.simulation.boards.pids[0]
    assert sent.kp == pytest.approx(built.kp, rel=0.02)
    assert sent.kd == pytest.approx(built.kd, rel=0.02)
    assert sent.max_output == pytest.approx(100.0)


def test_a_position_move_takes_the_time_of_its_numbers_and_arrives(ready: CanBench):
    """100 * |distance| / speed ms; the target is clipped to the limits."""
    ticks = ready.ticks(0)
    here, _ = ready.ask(m.ENCODER)
    target = round(float(here) + 10 * ticks)
    ready.send(m.POSITION_MOVE, target, round(20 * ticks / 10))  # half a second
    ready.run(0.4)
    assert ready.ask(m.MOTION_DONE) == (0,)
    ready.run(0.2)
    assert ready.ask(m.MOTION_DONE) == (1,)
    ready.run(0.5)
    assert ready.ask(m.POSITION_REFERENCE) == (target,)
    assert abs(float(ready.ask(m.ENCODER)[0]) - target) < ticks
    ready.send(m.POSITION_MOVE, 2**31 - 1, 32767)
    (most,) = ready.ask(m.MAX_POSITION)
    ready.run(1.0)
    assert ready.ask(m.POSITION_REFERENCE) == (most,)


def test_commands_in_another_mode_are_ignored(ready: CanBench):
    """A board in position mode obeys position moves only, and one that is idle nothing."""
    (before,) = ready.ask(m.POSITION_REFERENCE)
    ready.send(m.COMMAND_POSITION, 1000)
    ready.send(m.VELOCITY_MOVE, 100, 10)
    ready.run(0.2)
    assert ready.ask(m.POSITION_REFERENCE) == (before,)
    ready.send(m.SET_CONTROL_MODE, BoardMode.DIRECT)
    ready.send(m.COMMAND_POSITION, 1000)
    assert ready.ask(m.POSITION_REFERENCE) == (1000,)
    ready.send(m.SET_CONTROL_MODE, BoardMode.IDLE)
    ready.send(m.COMMAND_POSITION, 2000)
    ready.send(m.SET_CONTROL_MODE, BoardMode.DIRECT)
    assert ready.ask(m.POSITION_REFERENCE) != (2000,)


def test_a_velocity_ends_with_its_watchdog(ready: CanBench):
    """A joint whose host is silent for longer than the time-out comes to rest."""
    ready.send(m.SET_CONTROL_MODE, BoardMode.VELOCITY)
    ready.send(m.VELOCITY_TIMEOUT, 100)
    ready.send(m.VELOCITY_SHIFT, 8)
    speed = round(10 * ready.ticks(0) / 1e3 * 2**8)
    for _ in range(10):
        ready.send(m.VELOCITY_MOVE, speed, 32767)
        ready.run(0.05)
    moving = ready.ask(m.ENCODER_SPEED)
    assert float(moving[0]) > 0
    ready.run(0.5)
    first, _ = ready.ask(m.ENCODER)
    ready.run(0.5)
    second, _ = ready.ask(m.ENCODER)
    assert abs(float(second) - float(first)) < ready.ticks(0) / 10


@pytest.mark.parametrize(
    ("mode", "message", "counts", "moved"),
    [(BoardMode.OPEN_LOOP, m.OPEN_LOOP, 160, "duties"), (BoardMode.TORQUE, m.DESIRED_TORQUE, 64, "torques")],
)
def test_duty_cycles_and_torques_have_no_watchdog(
    ready: CanBench, mode: BoardMode, message: Setting, counts: int, moved: str
):
    """They stay as they were sent once, whether the host lives or not."""
    ready.send(m.SET_CONTROL_MODE, mode)
    ready.send(message.set, counts)
    sent = getattr(ready.simulation.boards, moved)[0]
    ready.run(3.0)
    assert ready.simulation.boards.unexpired(getattr(ready.simulation.boards, moved))[0] == sent != 0.0


def test_broadcasts_are_those_of_the_mask_at_their_times(ready: CanBench):
    """Nothing is broadcast until the host asks; positions come every cycle, the status at once and every 5 s."""
    ready.got.clear()
    ready.run(0.1)
    assert not ready.got
    ready.send(m.BROADCASTS, 0b111)
    ready.got.clear()
    ready.run(10.0)
    times = [time for time, _ in ready.messages(m.BROADCAST_POSITION)]
    assert len(times) == pytest.approx(2500, abs=1)
    assert all(after - before == pytest.approx(0.004, abs=5e-4) for before, after in pairwise(times))
    assert 2 <= len(ready.messages(m.STATUS)) <= 3
    ready.got.clear()
    ready.send(m.SET_CONTROL_MODE, BoardMode.IDLE, axis=1)
    ready.run(0.01)
    (_, status) = ready.messages(m.STATUS)[-1]
    assert status[:4] == (0, BoardMode.POSITION, 0, BoardMode.IDLE)


def test_a_fault_is_shown_and_left_by_force_idle_only(ready: CanBench):
    """All other requests are ignored."""
    ready.send(m.BROADCASTS, 0b100)
    ready.send(m.CURRENT_LIMIT, 0)
    ready.run(0.1)
    (_, status) = ready.messages(m.STATUS)[-1]
    assert status[:2] == (JointFault.OVERCURRENT, BoardMode.HARDWARE_FAULT)
    for mode in (BoardMode.POSITION, BoardMode.IDLE):
        ready.send(m.SET_CONTROL_MODE, mode)
        assert ready.mode() == BoardMode.HARDWARE_FAULT
    ready.send(m.SET_CONTROL_MODE, BoardMode.FORCE_IDLE)
    assert ready.mode() == BoardMode.IDLE


def test_version_and_discovery(bench: CanBench):
    """A protocol is acknowledged if its major version is equal and its minor one not newer."""
    assert bench.ask(m.VERSION, 1, 6)[-1] == 1
    assert bench.ask(m.VERSION, 1, 7)[-1] == 0
    assert bench.ask(m.VERSION, 2, 0)[-1] == 0
    assert bench.ask(s.DISCOVER)[0] == BoardType.BLL


def test_frames_that_are_no_messages_are_dropped(ready: CanBench):
    """Wrong lengths, unknown commands, an axis that does not exist: nothing is answered, nothing changes."""
    before, rejected = ready.board.status(), ready.board.rejected
    ready.got.clear()
    for data in (b"\x07\x00", b"\x7f", b"\x1b\x00", bytes(8)):
        ready.connection.send(Frame(1, data))
    ready.run(0.01)
    assert not ready.got
    assert ready.board.status() == before
    assert ready.board.rejected == rejected + 4


def test_a_board_in_its_loader_is_silent_until_it_is_reset(ready: CanBench):
    """Its motors are off."""
    ready.send(s.JUMP_TO_LOADER)
    ready.got.clear()
    ready.send(m.CONTROL_MODE.get)
    ready.run(0.01)
    assert not ready.got
    ready.board.reset()
    assert ready.mode() == BoardMode.IDLE


def test_flash_keeps_settings_over_a_reset(ready: CanBench):
    """What was written to flash is there after power-up; what was not is gone."""
    ready.send(m.WRITE_FLASH)
    ready.send(m.P_GAIN.set, 1234)
    ready.board.reset()
    assert ready.ask(m.P_GAIN) != (1234,)
    assert ready.ask(m.MAX_POSITION) != (0,)
