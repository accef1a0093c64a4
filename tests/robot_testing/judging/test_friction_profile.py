"""The friction of a pendulum over its range, from duty cycles that are computed: where it is higher, and when."""

import numpy as np
import pytest

from rtf.robot_testing.judging.friction_profile import friction_profile

PERIOD = 0.01
DRY, VISCOUS, INERTIA, WEIGHT, NOISE = 2.0, 0.01, 0.008, 12.0, 0.2


def moved(more=lambda q, direction, move: 0.0):
    """Times, angles and duty cycles of a slow move upwards and a fast one back, with friction that is ``more``."""
    angles, duties, moves, time = [], [], [], 0.0
    for number, (begin, end, seconds) in enumerate([(-40.0, 60.0, 2.5), (60.0, -40.0, 1.0)]):
        s = np.arange(round(seconds / PERIOD)) * PERIOD / seconds
        way = end - begin
        q = begin + way * (10 * s**3 - 15 * s**4 + 6 * s**5)
        speed = way / seconds * (30 * s**2 - 60 * s**3 + 30 * s**4)
        acceleration = way / seconds**2 * (60 * s - 180 * s**2 + 120 * s**3)
        direction = np.sign(way)
        friction = DRY + np.array([more(angle, direction, number) for angle in q])
        weight = WEIGHT * np.sin(np.radians(q + 20.0))
        angles.append(q)
        duties.append(weight + friction * direction + VISCOUS * speed + INERTIA * acceleration)
        moves.append((time, time + seconds))
        time += seconds
    whole = np.concatenate(duties)
    noise = np.random.default_rng(1).normal(0.0, NOISE, len(whole))
    return PERIOD * np.arange(len(whole)), np.concatenate(angles), whole + noise, moves


def test_a_healthy_joint_has_its_dry_friction_and_no_place():
    """Weight, inertia and viscous friction are taken for what they are."""
    found = friction_profile(*moved())
    assert found.friction == pytest.approx(DRY, abs=0.1)
    assert found.viscous == pytest.approx(VISCOUS, abs=0.002)
    assert found.sticky.more < 0.3
    assert found.blocked.more < 0.3


def test_a_sticky_place_is_found_where_it_is():
    """In both directions, and it does not count for the friction elsewhere."""
    found = friction_profile(*moved(lambda q, direction, move: 6.0 * (abs(q - 10.0) < 3.0)))
    assert found.sticky.more == pytest.approx(6.0, abs=0.8)
    assert found.sticky.position == pytest.approx(10.0, abs=3.0)
    assert found.friction == pytest.approx(DRY, abs=0.2)
    assert found.blocked.more < 1.5


def test_what_is_there_once_is_no_sticky_place():
    """A block in one of the moves."""
    found = friction_profile(*moved(lambda q, direction, move: 20.0 * (move == 0 and abs(q - 30.0) < 3.0)))
    assert found.blocked.more == pytest.approx(20.0, abs=2.0)
    assert found.blocked.position == pytest.approx(30.0, abs=3.0)
    assert found.sticky.more < 0.5


def test_noise_makes_no_place():
    """What a place needs more has to be certain."""
    time, angles, duties, moves = moved()
    noisy = duties + np.random.default_rng(2).normal(0.0, 20.0, len(duties))
    found = friction_profile(time, angles, noisy, moves)
    assert found.sticky.more < 1.0
    assert found.blocked.more < 5.0


def test_moves_in_one_direction_only_are_not_judged():
    """Weight and friction cannot be told apart."""
    time, angles, duties, moves = moved()
    assert friction_profile(time, angles, duties, moves[:1]) is None


@pytest.mark.parametrize("share", [0.05, 0.1])
def test_steps_of_counts_that_are_rare_are_no_outliers(share: float):
    """A controller damps by the counts of its encoder: now and then a whole one, which is the motion's as any other."""
    time, angles, duties, moves = moved()
    rare = (np.arange(len(duties)) * share) % 1.0 < share
    direction = np.where(time < moves[0][1], 1.0, -1.0)
    stepped = duties - direction * 9.0 * (rare - share)
    found = friction_profile(time, angles, stepped, moves)
    assert found.friction == pytest.approx(DRY, abs=0.2)
    assert found.sticky.more < 1.0
