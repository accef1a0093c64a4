"""The inertial force of a limb: noise of the speeds explains hardly any force, and an acceleration all of it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot_testing.judging.inertial_force import InertialForce, Load, _steepest

LEG = Load(46.5, 0.4)
INERTIA = 46.5 / 9.81 * 0.4  # N by rad/s²
TIMES = np.arange(8) * 0.01
STILL = np.zeros((8, 6))


def noise(rng, sd):
    """Speeds of six joints at rest, rad/s."""
    return np.radians(rng.normal(0.0, sd, STILL.shape))


@pytest.mark.parametrize("sd", [1.0, 3.0])
def test_noise_is_subtracted(sd):
    """A noise of 3 deg/s in each joint seems to cause 96 N; after 15 samples at rest it is known and reported."""
    rng = np.random.default_rng(1)
    pressing = InertialForce(LEG)
    for _ in range(15):
        assert pressing.noise == 0.0
        pressing.bound(TIMES, STILL, noise(rng, sd))
    assert 5.0 * sd < pressing.noise < 13.0 * sd
    left = [pressing.bound(TIMES, STILL, noise(rng, sd)) for _ in range(200)]
    assert np.mean(left) < 2.0 * sd
    assert np.mean([pressing.bound(TIMES + 1.0, STILL, STILL) for _ in range(3)]) == 0.0


def test_an_acceleration_counts_in_full():
    """Whether it is constant or lasts a moment: a line through the whole window would underestimate it."""
    steady = TIMES[:, None] * 2.0
    assert InertialForce(LEG).bound(TIMES, STILL, steady) == pytest.approx(INERTIA * (2.0 + 0.14**2))
    kick = np.clip(TIMES - 0.03, 0.0, 0.03)[:, None] * 20.0
    assert InertialForce(LEG).bound(TIMES, STILL, kick) == pytest.approx(INERTIA * (20.0 + 0.6**2))


def test_an_acceleration_is_no_noise():
    """Only samples at rest count, and not those of a limb that has just come to rest."""
    pressing = InertialForce(LEG)
    moved = STILL + np.linspace(0.0, 0.1, 8)[:, None]
    for positions in [moved, *[STILL] * 5] * 10:
        pressing.bound(TIMES, positions, TIMES[:, None] * 2.0)
    assert pressing.noise == 0.0


@pytest.mark.parametrize("times", [np.array([0.0, 0.05, 0.1]), np.zeros(3), np.array([0.0, 0.0, 0.01])])
def test_any_period_and_equal_stamps_are_accepted(times):
    """Whatever the period of the board and its stamps are."""
    assert np.isfinite(InertialForce(LEG).bound(times, STILL[:3], STILL[:3] + np.arange(3.0)[:, None]))


@given(
    st.lists(st.floats(0.0, 0.03), min_size=1, max_size=12),
    st.integers(0, 2**32 - 1),
)
def test_all_lines_are_those_of_one_by_one(steps, seed):
    """The steepest of the lines through the states of 35 ms, two at least; stamps may jitter, and repeat."""
    times = np.concatenate(([5.0], 5.0 + np.cumsum(steps)))
    speeds = np.random.default_rng(seed).normal(0.0, 1.0, (len(times), 3))
    slopes = []
    for begin in range(len(times) - 1):
        end = max(int(np.searchsorted(times, times[begin] + 0.035)), begin + 2)
        apart = np.concatenate(([0.0], np.cumsum(np.maximum(np.diff(times[begin:end]), 1e-3))))
        slopes.append((end, np.abs(np.polyfit(apart, speeds[begin:end], 1)[0]).sum()))
    lines = [slope for at, (end, slope) in enumerate(slopes) if not at or end > slopes[at - 1][0]]
    assert _steepest(times, speeds) == pytest.approx(max(lines), rel=1e-6)
