"""An axis on a board that drives its motor: rotor and joint, signs, zeros, and what does not fit."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot.control_modes import ControlMode
from rtf.robot.devices.board_axes import BoardAxis
from rtf.robot.devices.can import motor_messages as motor
from rtf.robot.devices.can.axis_scale import LONG, SHORT, AxisScale
from rtf.robot.devices.can.axis_settings import CanAxis, Drive
from rtf.robot.devices.can.codes import MotorFlag
from rtf.robot.devices.can.foc_link import FocLink

if TYPE_CHECKING:
    from collections.abc import Callable

GEARBOXES = st.floats(1.0, 500.0).flatmap(lambda size: st.sampled_from([size, -size]))
#: Degrees of a rotor a tick, and degrees a second in a unit of its velocity.
TICK, SPEED = 360 / 65536, 360 / 65.536


def link(gearbox: float, zero: float = 0.0, saturated: Callable[[str, float, int], None] | None = None) -> FocLink:
    """Return an axis."""
    scale = AxisScale(zero=zero) if saturated is None else AxisScale(zero=zero, saturated=saturated)
    drive = Drive(flags=MotorFlag(0), resolution=0, poles=7, position_gain=10.0, current_pid=None, velocity_pid=None)
    axis = BoardAxis(name="axis", gearbox=gearbox, max_velocity=1e9)
    settings = CanAxis(
        board=1,
        index=0,
        scale=scale,
        axis=axis,
        torque_pid=None,
        velocity_timeout=1000,
        stiffness=0.0,
        damping=0.0,
        drive=drive,
    )
    return FocLink(settings, scale)


def setpoints(position: float = 0.0, velocity: float = 0.0, current: float = 0.0, duty: float = 0.0) -> SimpleNamespace:
    """Return setpoints of one axis."""
    return SimpleNamespace(positions=[position], velocities=[velocity], currents=[current], duty_cycles=[duty])


@given(GEARBOXES, st.floats(-180, 180), st.integers(*SHORT), st.integers(*SHORT), st.integers(*LONG))
def test_feedback_is_that_of_rotor_and_joint(gearbox: float, zero: float, current: int, velocity: int, position: int):
    """A joint turns as its rotor, the gearbox times slower, the other way if that is negative."""
    one = link(gearbox, zero)
    one.kept[motor.FOC_FEEDBACK](one, (current, velocity, position), 5.0)
    got = one.feedback
    assert (got.current, got.stamp) == (pytest.approx(current / 1e3), 5.0)
    assert (got.motor_position, got.motor_velocity) == (pytest.approx(position * TICK), pytest.approx(velocity * SPEED))
    assert (got.position + zero) * gearbox == pytest.approx(got.motor_position, rel=1e-9, abs=1e-6)
    assert got.velocity * gearbox == pytest.approx(got.motor_velocity, rel=1e-9, abs=1e-9)


@given(GEARBOXES, st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
def test_a_velocity_that_does_not_fit_is_limited_and_reported(gearbox: float, error: float, velocity: float):
    """The velocity of the trajectory, and as much more as the error asks for, has the way of the rotor."""
    reported: list[int] = []
    one = link(gearbox, saturated=lambda _what, _value, limit: reported.append(limit))
    word = one.word(ControlMode.POSITION, setpoints(error, velocity), 0)  # type: ignore[arg-type]  # all that it reads
    wanted = (velocity + 10.0 * error) * gearbox / SPEED
    assert word == min(max(round(wanted), SHORT[0]), SHORT[1])
    assert reported == ([] if SHORT[0] <= wanted <= SHORT[1] else [word])


@given(st.floats(-1e6, 1e6))
def test_efforts_that_do_not_fit_are_limited_and_reported(value: float):
    """Currents are in mA; a duty cycle of 100 per cent is 32000; neither wraps."""
    for mode, given_, wanted in (
        (ControlMode.CURRENT, setpoints(current=value), value * 1e3),
        (ControlMode.PWM, setpoints(duty=value), value * 320),
    ):
        reported: list[int] = []
        one = link(100.0, saturated=lambda _what, _value, limit, reported=reported: reported.append(limit))  # type: ignore[misc]
        word = one.word(mode, given_, 0)  # type: ignore[arg-type]
        assert abs(word - min(max(wanted, SHORT[0]), SHORT[1])) <= 0.5 + 1e-6
        assert bool(reported) == (not SHORT[0] <= wanted <= SHORT[1] and word in SHORT)
    assert link(100.0).word(ControlMode.IDLE, setpoints(1.0, 1.0, 1.0, 1.0), 0) == 0  # type: ignore[arg-type]
