"""A sine that begins and ends gently, and the sine in what somebody made of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from rtf.robot.interfaces import FloatArray


@dataclass(frozen=True, slots=True)
class RampedSine:
    """A sine for several joints: ``cycles`` whole swings, and before and after them one that grows and one that fades.

    It begins and ends at zero, at rest. Amplitudes in deg, frequency in Hz, times in s.
    """

    amplitudes: FloatArray
    frequency: float
    cycles: float

    @property
    def duration(self) -> float:
        """From beginning to end."""
        return (self.cycles + 2.0) / self.frequency

    @property
    def plateau(self) -> tuple[float, float]:
        """When the amplitude is whole: from and to."""
        return 1.0 / self.frequency, (self.cycles + 1.0) / self.frequency

    @property
    def greatest_speed(self) -> FloatArray:
        """Of each joint, a little above what it comes to (deg/s): the ramps add their own."""
        return self.amplitudes * self.frequency * (2.0 * np.pi + _RAMP)

    def at(self, time: ArrayLike) -> FloatArray:
        """The positions at times, shape (joints,) for one time, (times, joints) for several."""
        t = np.asarray(time, dtype=np.float64)
        swings = t * self.frequency
        share = np.clip(np.minimum(swings, self.cycles + 2.0 - swings), 0.0, 1.0)
        ramp = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        wave: FloatArray = np.multiply.outer(ramp * np.sin(2.0 * np.pi * swings), self.amplitudes)
        return wave


class SineFit(NamedTuple):
    """The sine of least squares in a signal: its amplitude, phase (rad, behind sin), mean, and what is left (rms)."""

    amplitude: float
    phase: float
    mean: float
    rms: float


def fit_sine(time: ArrayLike, values: ArrayLike, frequency: float) -> SineFit:
    """Find it; the frequency is known (Hz). Raises ValueError for fewer than four points."""
    t, v = np.asarray(time, dtype=np.float64), np.asarray(values, dtype=np.float64)
    if t.size < _FEWEST or t.size != v.size:
        raise ValueError(f"a sine needs {_FEWEST} points or more, as many times as values: {t.size} and {v.size}")
    angle = 2.0 * np.pi * frequency * t
    columns = np.column_stack([np.sin(angle), np.cos(angle), np.ones_like(t)])
    found, *_ = np.linalg.lstsq(columns, v, rcond=None)
    sine, cosine, mean = (float(one) for one in found)
    left = v - columns @ found
    return SineFit(
        amplitude=float(np.hypot(sine, cosine)),
        phase=float(np.arctan2(-cosine, sine)),
        mean=mean,
        rms=float(np.sqrt(np.mean(left**2))),
    )


#: The steepest slope of the ramp, 15/8 of its height in one swing.
_RAMP = 1.875
_FEWEST = 4
