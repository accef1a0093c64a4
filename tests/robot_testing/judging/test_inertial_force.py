"""What a limb may press with: noise of its speeds explains next to nothing, and what hastens it all that it should."""

import numpy as np
import pytest

from rtf.robot_testing.judging.inertial_force import InertialForce, Load

LEG = Load(46.5, 0.4)
INERTIA = 46.5 / 9.81 * 0.4  # N by rad/s²
TIMES = np.arange(8) * 0.01
STILL = np.zeros((8, 6))


def noise(rng, sd):
    """Speeds of six joints at rest, rad/s."""
    return np.radians(rng.normal(0.0, sd, STILL.shape))


@pytest.mark.parametrize("sd", [1.0, 3.0])
def test_noise_is_taken_off(sd):
    """3 deg/s of it in each joint seemed to press with 96 N; it is known after 15 looks at rest, and told."""
    rng = np.random.default_rng(1)
    pressing = InertialForce(LEG)
    for _ in range(15):
        assert pressing.noise == 0.0
        pressing.bound(TIMES, STILL, noise(rng, sd))
    assert 5.0 * sd < pressing.noise < 13.0 * sd
    left = [pressing.bound(TIMES, STILL, noise(rng, sd)) for _ in range(200)]
    assert np.mean(left) < 2.0 * sd
    assert np.mean([pressing.bound(TIMES + 1.0, STILL, STILL) for _ in range(3)]) == 0.0


def test_a_limb_that_is_hastened_presses_with_all_of_it():
    """Steadily, or for a moment within the time: a line through all of it would make little of that."""
    steady = TIMES[:, None] * 2.0
    assert InertialForce(LEG).bound(TIMES, STILL, steady) == pytest.approx(INERTIA * (2.0 + 0.14**2))
    kick = np.clip(TIMES - 0.03, 0.0, 0.03)[:, None] * 20.0
    assert InertialForce(LEG).bound(TIMES, STILL, kick) == pytest.approx(INERTIA * (20.0 + 0.6**2))


def test_what_hastens_a_limb_is_no_noise():
    """Only looks at rest count, and not those at a limb that has just come to rest."""
    pressing = InertialForce(LEG)
    moved = STILL + np.linspace(0.0, 0.1, 8)[:, None]
    for positions in [moved, *[STILL] * 5] * 10:
        pressing.bound(TIMES, positions, TIMES[:, None] * 2.0)
    assert pressing.noise == 0.0


@pytest.mark.parametrize("times", [np.array([0.0, 0.05, 0.1]), np.zeros(3), np.array([0.0, 0.0, 0.01])])
def test_states_that_come_slowly_or_at_once_are_borne(times):
    """Whatever the board's period is, and its stamps are."""
    assert np.isfinite(InertialForce(LEG).bound(times, STILL[:3], STILL[:3] + np.arange(3.0)[:, None]))
