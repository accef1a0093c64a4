"""A motor that is driven by its duty cycle, when the guard gives its joint up meanwhile."""

from __future__ import annotations

from contextlib import ExitStack

import numpy as np
import pytest

from rtf.robot.control_modes import ControlMode
from rtf.robot_testing.duty_ramp import limp
from rtf.robot_testing.guard import GuardError
from rtf.robot_testing.part import Part
from rtf.robot_testing.transmission import Transmission

from .test_guard import Bench

COUPLED = Transmission(np.ones(3), np.array([[1.0, 0, 0], [0, 1, -1], [0, 1, 1]]), ((0,), (1, 2), (1, 2)))


def test_a_joint_that_was_given_up_gets_no_power_any_more():
    """Nor does the one that shares its motors, which its board has taken along: both would get it at once."""
    with ExitStack() as stack:
        bench = Bench(stack)
        guard = bench.guard()
        part = Part("fake", bench.board, bench.time, guard)

        def fall() -> None:
            with limp(part, COUPLED, 1, held=True) as motor:
                bench.board.set_control_modes([ControlMode.PWM] * 2, [1, 2])
                motor.along = [2]
                guard.give_up(1, "it does again what it may not")
                bench.board.set_control_modes(ControlMode.IDLE, 2)
                raise GuardError("it was stopped", 1)

        with pytest.raises(GuardError):
            fall()
        assert bench.device.control_modes([1, 2]) == (ControlMode.IDLE,) * 2
