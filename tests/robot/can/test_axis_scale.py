"""Degrees and ticks, gains and counts: there and back, the limits, and the sign."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot.devices.can.axis_scale import LONG, SHORT, AxisScale, RawPid
from rtf.robot.errors import MessageError

SCALES = st.builds(
    AxisScale,
    ticks=st.floats(0.5, 5000).flatmap(lambda size: st.sampled_from([size, -size])),
    zero=st.floats(-180, 180),
    move_shift=st.integers(0, 8),
    speed_shift=st.integers(0, 8),
    acceleration_shift=st.integers(0, 8),
    full_duty=st.floats(100, 32000),
    newtons=st.floats(1, 1000),
)
SMALL = st.integers(*SHORT)


@given(SCALES, st.floats(-360, 360))
def test_angles_come_back_within_half_a_tick(scale: AxisScale, degrees: float):
    """An angle in ticks and back is the angle, within half a tick."""
    assert scale.degrees(scale.position(degrees)) == pytest.approx(degrees, abs=0.5 / abs(scale.ticks) + 1e-9)


@given(SCALES, st.floats(-1e4, 1e4))
def test_velocities_have_the_sign_of_the_encoder(scale: AxisScale, velocity: float):
    """A velocity goes the way in which the encoder counts; no direction changes by saturation."""
    sent = scale.velocity(velocity)
    assert sent * velocity * scale.ticks >= 0
    assert SHORT[0] <= sent <= SHORT[1]


@given(SCALES, SMALL)
def test_broadcast_velocities_are_those_of_moves(scale: AxisScale, raw: int):
    """With equal shifts, a velocity that is broadcast is the one that would be commanded for it."""
    same = AxisScale(ticks=scale.ticks, move_shift=scale.move_shift, speed_shift=scale.move_shift)
    assert same.velocity(same.broadcast_velocity(raw)) == raw


@given(SCALES, st.builds(RawPid, SMALL, SMALL, SMALL, st.integers(0, 15), SMALL, SMALL, SMALL, SMALL, SMALL))
def test_controllers_of_a_board_come_back_exactly(scale: AxisScale, raw: RawPid):
    """The numbers of a board, in per cent and degrees and back, are the same numbers."""
    assert scale.raw_pid(scale.pid(raw)) == raw


@given(SCALES, st.floats(allow_nan=False))
def test_what_does_not_fit_is_limited_and_reported(scale: AxisScale, value: float):
    """Every value becomes an integer within its range; one outside becomes the nearest end, and is reported."""
    reported: list[int] = []
    reporting = AxisScale(ticks=scale.ticks, saturated=lambda _what, _value, limit: reported.append(limit))
    for limits in (SHORT, LONG):
        reported.clear()
        got = reporting.integer("value", value, limits)
        assert limits[0] <= got <= limits[1]
        assert reported == ([] if limits[0] <= value <= limits[1] else [got])
        if reported:
            assert got == limits[value > 0]


@pytest.mark.parametrize("sign", [1, -1])
def test_positions_beyond_four_bytes_do_not_wrap(sign: int):
    """The greatest position is sent instead of one of the other sign."""
    reported: list[tuple[str, float, int]] = []
    scale = AxisScale(ticks=1000.0, saturated=lambda *said: reported.append(said))
    assert scale.position(sign * 1e9) == LONG[sign > 0]
    assert reported == [("position", sign * 1e12, LONG[sign > 0])]


def test_least_speeds():
    """A move at a speed below one count is made with one, and never ends otherwise."""
    scale = AxisScale(ticks=10.0)
    assert (scale.move_speed(0.0), scale.acceleration(0.0)) == (1, 1)


def test_what_is_no_number_is_refused():
    """NaN is no setpoint."""
    with pytest.raises(MessageError, match="the torque of an axis is not a number"):
        AxisScale(newtons=1.0).torque(math.nan)
