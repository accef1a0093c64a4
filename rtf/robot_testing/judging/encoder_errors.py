"""Errors of a joint's encoders that show in motion, by their disagreement over a sweep: what kind, and how large.

The disagreement ``d`` is the position of the joint by its motors' encoders minus that by its own encoder, in deg. At
the angle ``q`` and the speed ``v``, both by the motors, it is ::

    d = offset + delay v + play/2 sign(v) + error

The delay is that of the joint encoder behind those of the motors. What the error is made of says the cause; each has a
form of its own, and the one that leaves the least disagreement counts:

==============  ================================================================================================
eccentric       ``a sin q + b cos q``: the magnet turns about a point beside its centre
lost counts     ``share`` times the way that was made above a certain speed, which is not known before
ratio           ``share`` times ``q``
drift           ``rate`` times the time
==============  ================================================================================================

Only lost counts depend on the speed, and only ratio and magnet return to the same error at the same angle, so slow and
fast moves in both directions tell them apart. An elastic transmission adds what its load twists it by, which is a part
of the error that is allowed.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from rtf.robot_testing.judging.statistics import NORMAL

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from rtf.robot.interfaces import FloatArray

Mask: TypeAlias = "NDArray[np.bool_]"

#: States about each one whose median is its expected value: spikes of up to two states stand out.
_WINDOW = 5
#: A spike deviates by this many times the usual deviation, at least; normal noise hardly ever does.
_OUTSTANDING = 8.0
#: States at each side of a spike that are left out: those of the joint's answer to it.
_BESIDE = 5
#: Speeds, as shares of the greatest one, above which counts may be lost; and below which a joint counts as at rest.
_SHARES = (0.1, 0.25, 0.4, 0.55, 0.7, 0.85)
_REST = 0.02
#: States to either side between which a speed is measured, to smooth the steps of encoders.
_ASIDE = 2
#: Quantiles between which an error is measured, so that noise does not count.
_QUANTILES = (0.01, 0.99)
#: A cause explains an error if it leaves less than this share of what is left without it.
_EXPLAINED = 0.5


class Spikes(NamedTuple):
    """The spikes of an encoder in a sweep: their number, and the largest one (deg)."""

    number: int
    largest: float


class EncoderErrors(NamedTuple):
    """Errors of the encoders of a joint over a sweep: delay in s, play and error in deg, cause as text ("" if none)."""

    delay: float
    play: float
    error: float
    cause: str
    left: FloatArray  # the disagreement without delay and play, of the states that were judged (deg)
    kept: Mask  # these states


def spikes_of(joint: FloatArray, motor: FloatArray, least: float) -> tuple[Spikes, Spikes, Mask]:
    """Return the spikes of the joint encoder and of the motor encoders, and which states to leave out.

    ``joint`` and ``motor`` are positions of the joint by both (deg). A spike is a single state, or two, in which both
    disagree by ``least`` deg more than in the states about it, and clearly more than noise does; it belongs to the
    encoder that jumps.
    """
    apart = _off_median(motor - joint)
    usual = NORMAL * float(np.median(np.abs(apart)))
    found = np.abs(apart) > max(least, _OUTSTANDING * usual)
    of_joint = found & (np.abs(_off_median(joint)) > np.abs(_off_median(motor)))
    near = np.convolve(found, np.ones(2 * _BESIDE + 1), mode="same") > 0
    return _spikes(apart, of_joint), _spikes(apart, found & ~of_joint), near


def errors_of(time: FloatArray, joint: FloatArray, motor: FloatArray, leave_out: Mask) -> EncoderErrors:
    """Return the errors of encoders over a sweep. All arrays have a value for each state, in deg, and s."""
    speed = _speed(time, motor)
    disagreement = motor - joint
    kept = ~leave_out
    base = np.column_stack([np.ones(len(time)), speed, _direction(speed)])
    best, shape, columns = _fit(base[kept], disagreement[kept]), "", base
    explained = _EXPLAINED * best.rms
    for name, more in _candidates(time, motor, speed):
        tried = np.column_stack([base, more])
        fit = _fit(tried[kept], disagreement[kept])
        if fit.rms < min(best.rms, explained):
            best, shape, columns = fit, name, tried
    left = disagreement[kept] - columns[kept][:, :3] @ best.values[:3]
    moving = np.abs(speed[kept]) > _SHARES[0] * float(np.abs(speed).max(initial=0.0))  # not where play is taken up
    low, high = np.quantile(left[moving], _QUANTILES) if moving.any() else (math.nan, math.nan)
    _, delay, half = best.values[:3]
    cause = _cause(shape, best.values[3:]) if shape else ""
    return EncoderErrors(float(delay), abs(2 * float(half)), float(high - low), cause, left, kept)


class _Fit(NamedTuple):
    values: FloatArray
    rms: float


def _fit(columns: FloatArray, values: FloatArray) -> _Fit:
    found: FloatArray = np.linalg.lstsq(columns, values, rcond=None)[0].astype(np.float64)
    return _Fit(found, float(np.sqrt(np.mean((values - columns @ found) ** 2))))


def _candidates(time: FloatArray, motor: FloatArray, speed: FloatArray) -> Iterator[tuple[str, FloatArray]]:
    """Yield the forms of an error, each with its columns."""
    angle = np.radians(motor)
    yield "ratio", motor[:, None]
    yield "drift", (time - time[0])[:, None]
    yield "eccentric", np.column_stack([np.sin(angle), np.cos(angle)])
    way, fastest = np.diff(motor, prepend=motor[0]), float(np.abs(speed).max(initial=0.0))
    for share in _SHARES:
        above = share * fastest
        yield f"{above:.0f} deg/s", np.cumsum(np.where(np.abs(speed) > above, way, 0.0))[:, None]


def _cause(shape: str, values: FloatArray) -> str:
    """Return the cause of an error as text: whose encoder it is, as far as its form says that."""
    if shape == "eccentric":
        return f"as an eccentric magnet of the joint encoder would, by {np.hypot(*values):.2f} deg"
    (value,) = values
    if shape == "ratio":
        return f"in proportion to the angle: one of the encoders shows {100 * abs(value):.1f} % too much"
    if shape == "drift":
        return f"steadily, by {value:.2f} deg/s: one of the encoders drifts"
    whose = "motor" if value < 0 else "joint"
    return f"only at more than {shape}: the {whose} encoder loses {100 * abs(value):.1f} % of its counts there"


def _speed(time: FloatArray, positions: FloatArray) -> FloatArray:
    """Return the speeds (deg/s), from the positions some states before and after."""
    before = np.maximum(np.arange(len(time)) - _ASIDE, 0)
    after = np.minimum(np.arange(len(time)) + _ASIDE, len(time) - 1)
    gaps = time[after] - time[before]
    speeds: FloatArray = (positions[after] - positions[before]) / np.where(gaps > 0, gaps, np.inf)
    return speeds


def _direction(speed: FloatArray) -> FloatArray:
    """Return the sign of the last motion: a joint at rest leans on the side of its play to which it came."""
    moving = np.abs(speed) > _REST * float(np.abs(speed).max(initial=0.0))
    latest = np.maximum.accumulate(np.where(moving, np.arange(len(speed)), 0))
    direction: FloatArray = np.sign(speed)[latest]
    return direction


def _off_median(values: FloatArray) -> FloatArray:
    """Return the deviations of values from the median of those about them."""
    half = _WINDOW // 2
    padded = np.pad(values, half, mode="edge")
    off: FloatArray = values - np.median(np.lib.stride_tricks.sliding_window_view(padded, _WINDOW), axis=-1)
    return off


def _spikes(apart: FloatArray, found: Mask) -> Spikes:
    return Spikes(int(found.sum()), float(np.abs(apart[found]).max(initial=0.0)))
