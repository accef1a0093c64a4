"""Which axis of a known vector each channel of a sensor shows, and with which gain: lines through several samples."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot_testing.judging.failure_causes import likely_causes
from rtf.robot_testing.judging.statistics import CONFIDENCE, fit_line, student

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.judging.statistics import Fit
    from rtf.testing import TestCase

#: Another axis explains a channel if it leaves at most this share of what its own axis leaves.
_BETTER = 0.3
#: The widest interval of a share of another axis in which a greater share counts, as a multiple of the tolerance.
_WIDEST = 2.0
_AXES = "xyz"


class Channel(NamedTuple):
    """A channel: the axis of the vector that it shows, with its sign, and the line over its own axis.

    ``spread`` is the standard deviation of its own axis over the samples: with little of it the gain is unknown.
    """

    axis: int
    sign: int
    line: Fit
    spread: float


class Bounds(NamedTuple):
    """What is allowed: the error of a gain, and the error of a sample that is no finding, in the sensor's unit.

    ``known`` is the least standard deviation of a vector for its gain to be judged, in such errors.
    """

    gain: float
    error: float
    known: float


def channels_of(measured: FloatArray, expected: FloatArray, error: float) -> list[Channel]:
    """Return what each column of ``measured`` shows of the vectors ``expected``, both of shape (samples, axes).

    A channel shows its own axis, unless that leaves more than twice ``error`` (root mean square) and another axis
    explains most of it.
    """
    spreads = expected.std(axis=0)
    found = []
    for own, values in enumerate(measured.T):
        lines = [fit_line(column, values) for column in expected.T]
        left = [
            line.rms if spread > error else float(values.std()) for line, spread in zip(lines, spreads, strict=True)
        ]
        best = int(np.argmin(left))
        axis = best if left[own] > 2.0 * error and left[best] < _BETTER * left[own] else own
        sign = -1 if spreads[axis] > error and lines[axis].slope < 0.0 else 1
        found.append(Channel(axis, sign, lines[own], float(spreads[own])))
    return found


def cross_talk(values: FloatArray, expected: FloatArray, axes: list[int]) -> dict[int, tuple[float, float]]:
    """Return how much a channel shows of some axes of the vectors: the share of each, and half its interval (99 %).

    All axes are fitted together, with an offset; ``axes`` are those that vary. Nothing for too few samples.
    """
    columns = np.column_stack([expected[:, axes], np.ones(len(values))])
    freedom = len(values) - columns.shape[1]
    if freedom < 1:
        return {}
    found, *_ = np.linalg.lstsq(columns, values, rcond=None)
    noise = float(np.sqrt(np.sum((values - columns @ found) ** 2) / freedom))
    errors = student(CONFIDENCE, freedom) * noise * np.sqrt(np.diag(np.linalg.pinv(columns.T @ columns)))
    return {axis: (float(found[place]), float(errors[place])) for place, axis in enumerate(axes)}


def judge_channels(
    test: TestCase, sensor: str, what: str, symbol: str, measured: FloatArray, expected: FloatArray, bounds: Bounds
) -> None:
    """Judge the axes and the gains of a sensor with three channels, such as its ``force`` in ``N``.

    What its line does not explain is at most twice the error of a sample, and the share ``bounds.gain`` of the vector's
    change: more is a sensor that is turned, or cross-talk, which is judged by itself. The gains of axes along which the
    vector hardly changes are reported as not judged.
    """
    whole = float(np.linalg.norm(expected.std(axis=0)))
    varying = [int(axis) for axis in np.flatnonzero(expected.std(axis=0) >= bounds.known * bounds.error)]
    for own, channel in enumerate(channels_of(measured, expected, bounds.error)):
        name = f"{what} {_AXES[own]}"
        shown = f"{'-' if channel.sign < 0 else ''}{_AXES[channel.axis]}"
        if not test.check_fail_if_false(
            (channel.axis, channel.sign) == (own, 1),
            f"{sensor}: its {name} shows what is along {shown}; {likely_causes('sensor axes')}",
        ):
            continue
        off = channel.line.rms if channel.spread > bounds.error else float(measured[:, own].std())
        hint = f"{sensor}: its {name} changes by {off:.2g} {symbol} without a reason; {likely_causes('sensor axes')}"
        test.measure(f"unexplained of {name}", off, symbol, high=2.0 * bounds.error + bounds.gain * whole, hint=hint)
        if channel.spread < bounds.known * bounds.error:
            test.report(f"{name} should change by {channel.spread:.2g} {symbol} only: its gain is not judged")
            continue
        # An interval as wide as the tolerance is too wide to judge by it.
        allowed = bounds.gain + min(channel.line.slope_interval, bounds.gain)
        hint = (
            f"{sensor}: its {name} is {channel.line.slope:.2f} times what it should be; {likely_causes('sensor gain')}"
        )
        test.measure(f"gain of {name}", channel.line.slope, "", 1.0 - allowed, 1.0 + allowed, hint=hint)
        for axis, (share, interval) in cross_talk(measured[:, own], expected, varying).items():
            allowed = bounds.gain + interval
            # Axes that vary nearly together are not told apart: only a clear share is judged, or none.
            known = interval <= bounds.gain or (interval <= _WIDEST * bounds.gain and abs(share) > allowed)
            if axis != own and known:
                hint = f"{sensor}: its {name} shows {share:.2f} times what is along {_AXES[axis]}; "
                hint += likely_causes("sensor axes")
                test.measure(f"{_AXES[axis]} in {name}", share, "", -allowed, allowed, hint=hint)
