"""Trajectories of setpoints, and the blocks in which the boards compute them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtf.robot.devices.trajectories import LEAST_MOVE
from rtf.simulator.setpoints import BLOCK, SetpointBlocks

STEP = 1e-3
AXES = np.arange(3)
LIMIT = 80.0


@pytest.fixture
def setpoints() -> SetpointBlocks:
    """Three axes at 0, 10 and -20 degrees, which may be from -80 to 80."""
    return made()


def made() -> SetpointBlocks:
    """Anew."""
    return SetpointBlocks(np.array([0.0, 10.0, -20.0]), np.full(3, -LIMIT), np.full(3, LIMIT), STEP)


def path(setpoints: SetpointBlocks, begin: int, steps: int, axis: int = 0) -> np.ndarray:
    """Position, speed and acceleration at some steps, shape (3, steps)."""
    axes = np.array([axis])
    return np.array([[number[0] for number in setpoints.at(tick, axes)] for tick in range(begin, begin + steps)]).T


def same(value: float) -> np.ndarray:
    """Return one value for all axes as an array."""
    return np.full(3, value)


class TestMoves:
    """Minimum-jerk moves."""

    @pytest.mark.parametrize(("target", "speed"), [(30.0, 20.0), (-45.0, 60.0), (10.5, 100.0), (80.0, 50.0)])
    def test_from_rest_it_is_the_known_polynomial(self, setpoints: SetpointBlocks, target: float, speed: float):
        """10 s³ - 15 s⁴ + 6 s⁵ of the way, which takes as long as the mean speed says."""
        setpoints.move(np.array([1]), np.array([target]), np.array([speed]), 100)
        way, duration = target - 10.0, abs(target - 10.0) / speed
        steps = round(duration / STEP) + 50
        s = np.minimum(np.arange(steps) * STEP / duration, 1.0)
        found = path(setpoints, 100, steps, axis=1)
        assert found[0] == pytest.approx(10.0 + way * s**3 * (10 - 15 * s + 6 * s**2), abs=1e-9)
        assert found[1] == pytest.approx(way / duration * 30 * s**2 * (1 - s) ** 2, abs=1e-7)
        assert found[2] == pytest.approx(way / duration**2 * 60 * s * (1 - s) * (1 - 2 * s), abs=1e-5)

    @pytest.mark.parametrize("moment", [1, 150, 499, 900, 1000])
    @pytest.mark.parametrize("target", [-30.0, 25.0, 60.0])
    def test_from_motion_nothing_jumps(self, setpoints: SetpointBlocks, moment: int, target: float):
        """Position and speed go on from what they are, and so does acceleration, as far as the move has as much itself.

        It ends at rest at its target.
        """
        setpoints.move(AXES, same(20.0), same(20.0), 0)
        before = path(setpoints, moment, 1)[:, 0]
        setpoints.move(AXES, same(target), same(30.0), moment)
        steps = round(abs(target - before[0]) / 30.0 / STEP) + 2
        found = path(setpoints, moment, steps)
        most = 10 / np.sqrt(3) * 30.0**2 / abs(target - before[0])
        assert found[:, 0] == pytest.approx([*before[:2], np.clip(before[2], -most, most)], abs=1e-9)
        assert found[:, -1] == pytest.approx([target, 0.0, 0.0], abs=1e-9)
        assert np.abs(np.diff(found[0])).max() < 0.5, "the setpoint jumps"
        # What is said of speed is what the positions do.
        assert np.diff(found[0])[:-1] / STEP == pytest.approx(((found[1][1:] + found[1][:-1]) / 2)[:-1], abs=0.5)

    @pytest.mark.parametrize("moment", range(1, 6))
    @pytest.mark.parametrize(("target", "astray"), [(60.0, 0.01), (5.0, 0.01), (-30.0, 9.0)])
    def test_a_way_that_took_milliseconds_does_not_swing(
        self, setpoints: SetpointBlocks, moment: int, target: float, astray: float
    ):
        """0.1 deg of it has thousands of deg/s²; a command in the middle of it turns back from its speed at most."""
        setpoints.move(AXES, same(0.1), same(20.0), 0)
        setpoints.move(AXES, same(target), same(20.0), moment)
        positions, speeds, _ = path(setpoints, moment, round(abs(target) / 20.0 / STEP))
        low, high = sorted((0.0, target))
        assert low - 0.01 <= positions.min()
        assert positions.max() <= max(high, 0.1) + astray
        assert np.abs(speeds).max() < 60.0

    def test_done_at_the_end_and_not_before(self, setpoints: SetpointBlocks):
        """The step at which the target is reached is the first one at which the motion is done."""
        setpoints.move(np.array([0, 1]), np.array([10.0, 60.0]), same(20.0)[:2], 7)
        assert setpoints.done(AXES, 506).tolist() == [False, False, True]
        assert setpoints.done(AXES, 507).tolist() == [True, False, True]
        assert setpoints.done(AXES, 2507).tolist() == [True, True, True]

    def test_speed_zero_is_slow_but_ends(self, setpoints: SetpointBlocks):
        """A move with speed 0 takes the longest time, without a division by zero."""
        setpoints.move(AXES, same(1.0), same(0.0), 0)
        assert np.isfinite(setpoints.at(5, AXES)[0]).all()

    def test_a_target_where_the_reference_is_changes_nothing(self, setpoints: SetpointBlocks):
        """A move of no length is done after the least duration of a move, and not before."""
        setpoints.move(AXES, np.array([0.0, 10.0, -20.0]), same(10.0), 3)
        assert setpoints.at(4, AXES)[0] == pytest.approx([0.0, 10.0, -20.0])
        end = 3 + round(LEAST_MOVE / STEP)
        assert not setpoints.done(AXES, end - 1).any()
        assert setpoints.done(AXES, end).all()

    def test_a_move_from_motion_stays_within_the_limits(self, setpoints: SetpointBlocks):
        """A fast axis near a limit that is commanded a slow move there does not overshoot."""
        setpoints.run(AXES, same(60.0), same(1e6), 0)
        setpoints.move(AXES, same(LIMIT), same(1.0), 1300)
        found = path(setpoints, 1300, 3000)
        assert found[0].max() <= LIMIT


class TestSpeeds:
    """Running at speeds."""

    def test_a_ramp_and_then_a_line(self, setpoints: SetpointBlocks):
        """The speed grows with the acceleration and stays."""
        setpoints.run(AXES, same(20.0), same(100.0), 50)
        t = np.arange(1000) * STEP
        found = path(setpoints, 50, 1000)
        assert found[1] == pytest.approx(np.minimum(100.0 * t, 20.0), abs=1e-9)
        assert found[0] == pytest.approx(np.where(t < 0.2, 50 * t**2, 20 * t - 2), abs=1e-9)

    def test_speeds_follow_on_each_other(self, setpoints: SetpointBlocks):
        """From one speed to its opposite there is a ramp, and positions do not jump."""
        setpoints.run(AXES, same(20.0), same(1000.0), 0)
        setpoints.run(AXES, same(-20.0), same(100.0), 500)
        found = path(setpoints, 500, 600)
        assert found[1][0] == pytest.approx(20.0)
        assert found[1][400:] == pytest.approx(-20.0)
        assert np.abs(np.diff(found[0])).max() <= 20.0 * STEP + 1e-9

    def test_to_a_stop(self, setpoints: SetpointBlocks):
        """Speed 0 ends at rest, v²/2a further."""
        setpoints.run(AXES, same(30.0), same(1e9), 0)
        setpoints.run(AXES, same(0.0), same(1000.0), 1000)
        assert setpoints.at(1030, AXES)[0][0] == pytest.approx(30.0 + 0.45)
        assert setpoints.at(99999, AXES)[0][0] == pytest.approx(30.0 + 0.45)
        assert setpoints.at(99999, AXES)[1][0] == 0.0

    def test_a_line_ends_at_the_limit(self, setpoints: SetpointBlocks):
        """There the speed is 0; and from there it goes back at once."""
        setpoints.run(AXES, same(100.0), same(1e9), 0)
        assert setpoints.at(5000, AXES)[0] == pytest.approx(same(LIMIT))
        assert setpoints.at(5000, AXES)[1].tolist() == [0.0, 0.0, 0.0]
        setpoints.run(AXES, same(-10.0), same(1e9), 5000)
        assert setpoints.at(5100, AXES)[0] == pytest.approx(same(LIMIT - 1.0), abs=1e-6)

    @pytest.mark.parametrize("acceleration", [1.0, 10.0, 100.0])
    def test_slowing_down_does_not_lead_beyond_the_limit(self, setpoints: SetpointBlocks, acceleration: float):
        """A slow stop near a limit ends at the limit."""
        setpoints.run(AXES, same(100.0), same(1e9), 0)
        setpoints.run(AXES, same(0.0), same(acceleration), 780)
        for tick in (780, 800, 900, 2000, 200_000):
            assert setpoints.at(tick, AXES)[0].max() <= LIMIT
        assert setpoints.at(200_000, AXES)[1].tolist() == [0.0, 0.0, 0.0]

    def test_speeding_up_does_not_lead_beyond_the_limit(self, setpoints: SetpointBlocks):
        """Nor does a ramp that takes longer than the way."""
        setpoints.run(AXES, same(100.0), same(1.0), 0)
        assert setpoints.at(90_000, AXES)[0] == pytest.approx(same(LIMIT))
        assert setpoints.at(90_000, AXES)[1].tolist() == [0.0, 0.0, 0.0]


class TestLimits:
    """Limits of setpoints."""

    def test_one_that_begins_outside_may_come_back_and_no_further_out(self, setpoints: SetpointBlocks):
        """A joint that was pushed beyond its limit returns with its commanded speed."""
        setpoints.hold(AXES, same(LIMIT + 3), 0)
        assert setpoints.at(10, AXES)[0] == pytest.approx(same(LIMIT + 3))
        setpoints.run(AXES, same(10.0), same(1e9), 10)
        assert setpoints.at(500, AXES)[0] == pytest.approx(same(LIMIT + 3))
        setpoints.move(AXES, same(70.0), same(13.0), 500)
        assert setpoints.at(502, AXES)[0] == pytest.approx(same(LIMIT + 3), abs=0.01)
        assert setpoints.at(9999, AXES)[0] == pytest.approx(same(70.0))

    def test_limits_that_leave_an_axis_outside_stop_it(self, setpoints: SetpointBlocks):
        """It stays where it is, and does not jump to the limit."""
        setpoints.run(AXES, same(20.0), same(1e9), 0)
        setpoints.set_limits(0, -10.0, 5.0, 1000)
        setpoints.set_limits(2, -90.0, 5.0, 1000)
        assert setpoints.at(3000, AXES)[0] == pytest.approx([20.0, 70.0, 5.0])
        assert setpoints.within_limits(AXES, same(100.0)).tolist() == [5.0, LIMIT, 5.0]


#: What may be commanded to some axes at a step, and how.
_COMMANDS = st.one_of(
    st.tuples(st.just("move"), st.floats(-80, 80), st.floats(0, 200)),
    st.tuples(st.just("run"), st.floats(-200, 200), st.floats(0, 2000)),
    st.tuples(st.just("hold"), st.floats(-80, 80), st.just(0.0)),
    st.tuples(st.just("limits"), st.floats(-80, -1), st.floats(1, 80)),
)


def command_axes(setpoints: SetpointBlocks, axes: list[int], command: tuple[str, float, float], now: int) -> None:
    """Give one command to the trajectories."""
    what, first, second = command
    chosen = np.array(axes)
    one, other = np.full(len(axes), first), np.full(len(axes), second)
    if what == "move":
        setpoints.move(chosen, one, other, now)
    elif what == "run":
        setpoints.run(chosen, one, other, now)
    elif what == "hold":
        setpoints.hold(chosen, one, now)
    else:
        setpoints.set_limits(axes[0], first, second, now)


@settings(max_examples=25, deadline=None)
@given(
    history=st.lists(
        st.tuples(st.integers(0, 70), st.lists(st.integers(0, 2), min_size=1, max_size=3, unique=True), _COMMANDS),
        max_size=6,
    ),
    scale=st.floats(0.1, 1000.0),
)
def test_rows_are_what_an_evaluation_gives(history: list, scale: float):
    """Whatever was commanded, the row of each step is the trajectory there, and is within or on the way to limits."""
    setpoints = SetpointBlocks(
        np.array([0.0, 10.0, -20.0]),
        same(-LIMIT),
        same(LIMIT),
        STEP,
        scales=(np.array([1.0, scale, 2.0]), 0.5),
    )
    tick = 0
    for wait, axes, command in [*history, (BLOCK + 5, [0], ("hold", 0.0, 0.0))]:
        for _ in range(wait):
            row = tick - setpoints.begin
            if row >= BLOCK:
                setpoints.fill(tick)
                row = 0
            positions, speeds, _ = setpoints.at(tick, AXES)
            assert setpoints.positions[row] == pytest.approx(positions * [1.0, scale, 2.0], rel=1e-12, abs=1e-9)
            assert setpoints.velocities[row] == pytest.approx(speeds * 0.5, rel=1e-12, abs=1e-9)
            tick += 1
        if tick - setpoints.begin <= BLOCK:
            command_axes(setpoints, axes, command, tick)


@settings(max_examples=40, deadline=None)
@given(history=st.lists(st.tuples(st.integers(1, 2000), _COMMANDS.filter(lambda one: one[0] != "limits")), max_size=10))
def test_no_history_leads_beyond_the_limits(history: list):
    """For any commands, setpoints are between the limits at every moment."""
    setpoints, tick = made(), 0
    for wait, command in history:
        for after in range(0, wait, max(1, wait // 7)):
            positions, speeds, accelerations = setpoints.at(tick + after, AXES)
            assert np.abs(positions).max() <= LIMIT
            assert np.isfinite(speeds).all()
            assert np.isfinite(accelerations).all()
        tick += wait
        command_axes(setpoints, [0, 1, 2], command, tick)
