"""Friction of a joint over its range, from the duty cycles of moves in both directions.

While only one joint moves, the mechanics of its duty cycle ``u`` are those of a pendulum with friction::

    u = offset + a sin q + b cos q + dry sign(v) + viscous v + inertia dv/dt

with the weight of everything beyond the joint in the sine and the cosine of its angle ``q``. The coefficients are
fitted to all moves together, without the states that do not belong. What a joint needs beyond that in the direction of
its motion is friction of a place, if it is there in both directions, and otherwise something that blocked it once.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from rtf.robot_testing.judging.robust_fit import robust_fit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rtf.robot.interfaces import FloatArray

Mask: TypeAlias = "NDArray[np.bool_]"

#: Width of a place, deg.
_PLACE = 2.0
#: Places beside a sticky one that may show it, too: a fast joint passes one in a state or two.
_BESIDE = 2
#: States to either side through which a parabola is laid for speed and acceleration.
_ASIDE = 4
#: A move is judged from the first to the last state with this share of its greatest speed, if it is so long, deg.
_MOVING, _SHORTEST = 0.2, 5.0
#: Share of the duty cycle for acceleration that is not certain: speeds are smoothed, and other joints may swing along.
_ACCELERATION = 0.15
#: What a place needs more is certain to this number of standard errors.
_SURELY = 4.0
_FEWEST = 20
_DIRECTION, _SPEED = 3, 4  # the columns of the model whose coefficients are the dry and the viscous friction


class Effort(NamedTuple):
    """What a joint needs more at a position (deg), in per cent of duty cycle; 0 at NaN if it never does."""

    more: float
    position: float


class FrictionProfile(NamedTuple):
    """Dry friction, and the places of additional friction and of a block, in per cent of duty cycle.

    ``viscous`` is proportional to the speed, per cent a deg/s: of duty cycles most of it drives the motor against the
    voltage that it induces, of currents all of it is friction. ``duties`` and ``model`` are those of the states
    ``time`` (s) and ``positions`` (deg), at equal intervals.
    """

    friction: float
    viscous: float
    sticky: Effort
    blocked: Effort
    time: FloatArray
    positions: FloatArray
    duties: FloatArray
    model: FloatArray


def friction_profile(
    time: FloatArray, positions: FloatArray, duties: FloatArray, moves: Sequence[tuple[float, float]]
) -> FrictionProfile | None:
    """Return the friction of a joint over its moves, each from its begin to its end (s).

    ``positions`` (deg) and ``duties`` (per cent, of the joint) have a value for each of the times. None if there are
    no moves in both directions to judge.
    """
    grid = np.arange(time[0], time[-1], float(np.median(np.diff(time))))
    q, u = np.interp(grid, time, positions), np.interp(grid, time, duties)
    speed, acceleration = _derivatives(q, grid[1] - grid[0])
    number, direction = _moves_of(grid, q, speed, moves)
    used = direction != 0
    if used.sum() < _FEWEST or not {-1.0, 1.0} <= set(direction[used].tolist()):
        return None
    angle = np.radians(q)
    columns = np.column_stack([np.ones(len(q)), np.sin(angle), np.cos(angle), direction, speed, acceleration])
    values, _, inside = robust_fit(columns[used], _mean(u)[used])
    model: FloatArray = columns @ values
    noise = float(np.std((u - model)[used][inside]))
    excess = (u - model) * direction - _ACCELERATION * np.abs(values[-1] * acceleration)
    table = _by_place(q, excess, number, noise)
    directions = np.array([direction[number == move][0] for move in table])
    middle = np.asarray(q[used].min() + _PLACE * (np.arange(next(iter(table.values())).size) + 0.5), dtype=np.float64)
    rows = np.array(list(table.values()))
    upwards, downwards = rows[directions > 0].max(axis=0), rows[directions < 0].max(axis=0)
    both = np.maximum(np.minimum(upwards, downwards), 0.0)
    about = np.lib.stride_tricks.sliding_window_view(np.pad(both, _BESIDE), 2 * _BESIDE + 1).max(axis=-1)
    once = np.maximum(rows.max(axis=0) - about, 0.0)
    return FrictionProfile(
        float(values[_DIRECTION]),
        float(values[_SPEED]),
        _greatest(both, middle),
        _greatest(once, middle),
        grid,
        q,
        u,
        model,
    )


def _moves_of(
    grid: FloatArray, q: FloatArray, speed: FloatArray, moves: Sequence[tuple[float, float]]
) -> tuple[NDArray[np.intp], FloatArray]:
    """Return the number and the direction of the move to which each state belongs; direction 0: to none."""
    number, direction = np.full(len(grid), -1), np.zeros(len(grid))
    for place, (begin, end) in enumerate(moves):
        rows = np.flatnonzero((grid >= max(begin, grid[_ASIDE])) & (grid <= min(end, grid[-1 - _ASIDE])))
        if len(rows) < _FEWEST or np.ptp(q[rows]) < _SHORTEST:
            continue
        fast = np.flatnonzero(np.abs(speed[rows]) >= _MOVING * np.abs(speed[rows]).max())
        moving = rows[fast[0] : fast[-1] + 1]  # also where it was stopped in between
        number[moving], direction[moving] = place, np.sign(q[moving[-1]] - q[moving[0]])
    return number, direction


def _derivatives(values: FloatArray, period: float) -> tuple[FloatArray, FloatArray]:
    """Return the first and second derivatives, by the parabola through the states about each one."""
    steps = np.arange(-_ASIDE, _ASIDE + 1) * period
    _, first, second = np.linalg.pinv(np.vander(steps, 3, increasing=True))
    padded = np.pad(values, _ASIDE, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * _ASIDE + 1)
    return windows @ first, 2.0 * (windows @ second)


def _mean(values: FloatArray) -> FloatArray:
    """Return the means over the same states as those of the derivatives.

    A board's damping comes in the steps of a count: of single states with a rare step the fit would leave those out.
    """
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(values, _ASIDE, mode="edge"), 2 * _ASIDE + 1)
    means: FloatArray = windows.mean(axis=-1)
    return means


def _by_place(q: FloatArray, excess: FloatArray, number: NDArray[np.intp], noise: float) -> dict[int, FloatArray]:
    """Return for each move what the joint surely needs more in each place (per cent); -inf where it was not."""
    used = number >= 0
    place = ((q - q[used].min()) / _PLACE).astype(int)
    places = int(place[used].max()) + 1
    table = {}
    for move in sorted(set(number[used].tolist())):
        rows = number == move
        count = np.bincount(place[rows], minlength=places)
        total = np.bincount(place[rows], weights=excess[rows], minlength=places)
        there = np.maximum(count, 1)
        table[move] = np.where(count > 0, total / there - _SURELY * noise / np.sqrt(there), -math.inf)
    return table


def _greatest(efforts: FloatArray, positions: FloatArray) -> Effort:
    place = int(efforts.argmax())
    return Effort(float(efforts[place]), float(positions[place]) if efforts[place] > 0 else math.nan)
