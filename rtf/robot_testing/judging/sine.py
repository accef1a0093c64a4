"""A sine trajectory that fades in and out, and the fit of a sine to measured values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from rtf.robot.interfaces import FloatArray


@dataclass(frozen=True, slots=True)
class RampedSine:
    """A sine for several joints: ``cycles`` periods of full amplitude.

    One period before them fades in, one after them fades out. It begins and ends at zero and at rest. Amplitudes in
    deg, frequency in Hz, times in s.
    """

    amplitudes: FloatArray
    frequency: float
    cycles: float

    @property
    def duration(self) -> float:
        """The duration of the whole trajectory (s)."""
        return (self.cycles + 2.0) / self.frequency

    @property
    def plateau(self) -> tuple[float, float]:
        """Begin and end of the time with full amplitude (s)."""
        return 1.0 / self.frequency, (self.cycles + 1.0) / self.frequency

    @property
    def greatest_speed(self) -> FloatArray:
        """An upper bound of the speed of each joint (deg/s), including the ramps."""
        return self.amplitudes * self.frequency * (2.0 * np.pi + _RAMP)

    def at(self, time: ArrayLike) -> FloatArray:
        """Return the positions, shape (joints,) for a single time, (times, joints) for several."""
        t = np.asarray(time, dtype=np.float64)
        swings = t * self.frequency
        share = np.clip(np.minimum(swings, self.cycles + 2.0 - swings), 0.0, 1.0)
        ramp = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        wave: FloatArray = np.multiply.outer(ramp * np.sin(2.0 * np.pi * swings), self.amplitudes)
        return wave


class SineFit(NamedTuple):
    """The least squares fit of a sine: amplitude, phase lag (rad), mean, and root mean square of the residual."""

    amplitude: float
    phase: float
    mean: float
    rms: float


def fit_sine(time: ArrayLike, values: ArrayLike, frequency: float, *, harmonics: int = 1) -> SineFit:
    """Fit a sine of known frequency (Hz) to values, with so many ``harmonics``, itself among them.

    Amplitude and phase are those of the sine itself. Raises ValueError for fewer than four points, or two a harmonic.
    """
    t, v = np.asarray(time, dtype=np.float64), np.asarray(values, dtype=np.float64)
    fewest = max(_FEWEST, 2 * harmonics + 2)
    if t.size < fewest or t.size != v.size:
        raise ValueError(f"a sine needs {fewest} points or more, one time for each value: {t.size} and {v.size}")
    angles = 2.0 * np.pi * frequency * t[:, None] * np.arange(1, harmonics + 1)
    columns = np.hstack([np.sin(angles), np.cos(angles), np.ones((t.size, 1))])
    found, *_ = np.linalg.lstsq(columns, v, rcond=None)
    sine, cosine, mean = float(found[0]), float(found[harmonics]), float(found[-1])
    left = v - columns @ found
    return SineFit(
        amplitude=float(np.hypot(sine, cosine)),
        phase=float(np.arctan2(-cosine, sine)),
        mean=mean,
        rms=float(np.sqrt(np.mean(left**2))),
    )


#: The steepest slope of the ramp, 15/8 of its height in one period.
_RAMP = 1.875
_FEWEST = 4
