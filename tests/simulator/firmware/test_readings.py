"""What boards broadcast: the numbers of both axes in their places, rounded, saturated, and never wrapped."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from rtf.robot.devices.can import motor_messages as m
from rtf.robot.devices.can.codec import decode

from .can_bench import ADDRESS, CanBench

if TYPE_CHECKING:
    from rtf.robot.devices.can.messages import Message
    from rtf.robot.interfaces import FloatArray

SHORT = (-(1 << 15), (1 << 15) - 1)


def values(bench: CanBench, message: Message) -> tuple[float | bytes, ...]:
    """Return what the board of the bench broadcasts now, as a host decodes it."""
    board = bench.board
    return decode(message.identifier(ADDRESS), board.readings.broadcast(message.code, board.place)).values


def both(row: FloatArray) -> list[int]:
    """Return the numbers of both axes."""
    return np.rint(row).astype(int).tolist()


def test_the_numbers_are_those_of_both_axes():
    """First those of one quantity, then those of the other; what a message has beyond them is zero."""
    bench = CanBench()
    bench.run(0.05)
    readings = bench.board.readings
    assert values(bench, m.BROADCAST_POSITION) == (*both(readings.positions()),)
    assert values(bench, m.BROADCAST_PID) == (*both(readings.outputs()), *both(readings.duties()))
    assert values(bench, m.BROADCAST_CURRENT)[:2] == (*both(readings.currents()),)
    assert values(bench, m.BROADCAST_VELOCITY) == (*both(readings.speeds()), *both(readings.accelerations()))
    assert values(bench, m.BROADCAST_ERROR) == (*both(readings.errors()), *both(readings.torque_errors()))
    assert values(bench, m.MOTOR_POSITION) == (*both(readings.motor_positions()),)
    assert values(bench, m.MOTOR_SPEED) == (*both(readings.motor_speeds()), 0, 0)


@pytest.mark.parametrize("end", [0, 1])
def test_what_does_not_fit_is_saturated(end: int):
    """The nearest end of the range is sent, and never a number of the other sign."""
    bench = CanBench()
    bench.board.readings.set_desired_torque(1, (-1, 1)[end] * 1e9)
    assert values(bench, m.BROADCAST_ERROR)[3] == SHORT[end]


def test_each_axis_has_its_shifts():
    """A speed is shifted as the host has asked for, for each axis."""
    bench = CanBench()
    bench.configure()
    bench.send(m.ESTIMATOR_SHIFTS, 0, 0, 0, 0, axis=0)
    bench.send(m.ESTIMATOR_SHIFTS, 8, 0, 0, 0, axis=1)
    speeds = bench.simulation.boards.velocity * bench.simulation.boards.resolution / 1e3
    assert bench.board.readings.speeds() == pytest.approx(speeds * [1, 256])
