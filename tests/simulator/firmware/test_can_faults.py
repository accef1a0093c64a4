"""Faults of CAN buses and boards: each shows what it says at the host, and is gone afterwards."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import pytest

from rtf.robot.control_modes import ControlMode
from rtf.robot.devices.can import motor_messages as m
from rtf.robot.devices.can.codes import BoardMode
from rtf.robot.errors import RefusedError
from rtf.simulator.faults import KINDS, Layer, find_kind

from .can_bench import CanBench

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.simulator.faults import Fault

SECONDS = 0.5
#: Positions come every 4 ms.
POSITIONS = SECONDS * 250


def positions(bench: CanBench) -> list[tuple[float, tuple[float | bytes, ...]]]:
    """Return the positions that arrive in a while."""
    bench.got.clear()
    bench.run(SECONDS)
    return bench.messages(m.BROADCAST_POSITION)


def fewer(bench: CanBench) -> bool:
    """Fewer positions arrive."""
    return len(positions(bench)) < 0.9 * POSITIONS


def more(bench: CanBench) -> bool:
    """More positions arrive than are sent."""
    return len(positions(bench)) > 1.1 * POSITIONS


def late(bench: CanBench) -> bool:
    """A command takes effect late."""
    bench.configure()
    bench.send(m.SET_CONTROL_MODE, BoardMode.POSITION)
    return bool(bench.simulation.boards.mode[0] != ControlMode.POSITION)


def back_and_forth(bench: CanBench) -> bool:
    """The positions of a moving joint jump."""
    bench.configure()
    bench.send(m.SET_CONTROL_MODE, BoardMode.POSITION)
    ticks = bench.ticks(0)
    bench.send(m.POSITION_MOVE, round(20 * ticks), round(40 * ticks / 10))
    bench.run(0.1)
    numbers = [float(values[0]) for _, values in positions(bench)]
    steps = [after - before for before, after in pairwise(numbers)]
    return min(steps[:60]) < -0.05 * ticks


def errors(bench: CanBench) -> bool:
    """The count of errors of a board rises on a busy bus."""
    bench.send(m.BROADCASTS, 0b11001011)
    counts = []
    for _ in range(100):
        bench.run(0.005)
        counts.append(bench.board.connection.sender_errors)
    bench.send(m.BROADCASTS, 0b1)
    return max(counts) > 0


def full(bench: CanBench) -> bool:
    """The bus is full."""
    bits = bench.wire.bits
    bench.run(SECONDS)
    return (bench.wire.bits - bits) / 1e6 / SECONDS > 0.9


def silent(bench: CanBench) -> bool:
    """After a while no positions arrive."""
    bench.run(0.3)
    return not positions(bench)


def idle(bench: CanBench) -> bool:
    """The board is idle, without its settings."""
    return bench.ask(m.MAX_POSITION) == (0,)


def other_version(bench: CanBench) -> bool:
    """The board has another firmware."""
    return bench.ask(m.VERSION, 1, 6)[1] != 3


def not_taken(bench: CanBench) -> bool:
    """What is read back is not what was written."""
    bench.send(m.P_GAIN.set, 1234)
    return bench.ask(m.P_GAIN) != (1234,)


def goes_on(bench: CanBench) -> bool:
    """A velocity does not end."""
    bench.configure()
    bench.send(m.VELOCITY_TIMEOUT, 100)
    bench.send(m.SET_CONTROL_MODE, BoardMode.VELOCITY)
    bench.send(m.VELOCITY_MOVE, round(5 * bench.ticks(0) / 1e3 * 2**4), 100)
    bench.run(0.8)
    return bool(bench.simulation.boards.trajectories.at(bench.simulation.boards.tick, [0])[1][0] > 1.0)


def stuck(bench: CanBench) -> bool:
    """The positions of a moving joint are all the same."""
    bench.configure()
    bench.send(m.SET_CONTROL_MODE, BoardMode.POSITION)
    bench.send(m.POSITION_MOVE, round(10 * bench.ticks(0)), round(20 * bench.ticks(0) / 10))
    return len({values for _, values in positions(bench)}) == 1


SHOWS: dict[str, Callable[[CanBench], bool]] = {
    "can_frames_lost": fewer,
    "can_frames_delayed": late,
    "can_frames_duplicated": more,
    "can_frames_reordered": back_and_forth,
    "can_identifier_damaged": fewer,
    "can_termination": errors,
    "can_babbling": full,
    "can_bus_off": silent,
    "can_same_address": silent,
    "can_board_reset": idle,
    "can_wrong_firmware": other_version,
    "can_settings_ignored": not_taken,
    "can_watchdog_off": goes_on,
    "can_encoder_frame_stuck": stuck,
}


def made(kind: str, bench: CanBench) -> Fault:
    """Return a fault of the bench."""
    target = "arm0" if find_kind(kind).target_kind.name == "BUS" else "arm0:1"
    return find_kind(kind)(bench, target)  # type: ignore[arg-type]  # it has what a fault needs of a robot


def test_every_kind_has_its_proof():
    """No kind of a bus is there whose claim nobody looks at."""
    assert set(SHOWS) == {kind.kind for kind in KINDS.values() if kind.layer is Layer.BUS}


@pytest.mark.parametrize("kind", SHOWS)
def test_a_fault_shows_what_it_claims(kind: str):
    """It is not seen on a healthy bus; with the fault it is."""
    healthy = CanBench()
    healthy.configure()
    healthy.send(m.BROADCASTS, 0b1)
    assert not SHOWS[kind](healthy)
    bench = CanBench()
    bench.configure()
    bench.send(m.BROADCASTS, 0b1)
    fault = made(kind, bench)
    fault.start()
    assert SHOWS[kind](bench)
    fault.end()
    if kind == "can_board_reset":  # the host configures it again
        bench.configure()
        bench.send(m.BROADCASTS, 0b1)
    bench.run(0.1)
    assert len(positions(bench)) == pytest.approx(POSITIONS, abs=2)


@pytest.mark.parametrize("kind", SHOWS)
def test_a_robot_without_buses_refuses(kind: str):
    """With how to start it."""
    bench = CanBench()
    bench.firmware = None  # type: ignore[assignment]
    with pytest.raises(RefusedError, match="--can"):
        made(kind, bench)


def test_targets_that_do_not_exist_are_refused_with_those_that_do():
    """Buses and boards by their names."""
    bench = CanBench()
    with pytest.raises(RefusedError, match="its buses are arm0"):
        find_kind("can_frames_lost")(bench, "arm1")  # type: ignore[arg-type]
    with pytest.raises(RefusedError, match="its boards are arm0:1"):
        find_kind("can_bus_off")(bench, "arm0:2")  # type: ignore[arg-type]
