"""The motion of a tip, such as a hand: how late a controller reports it, its speed, its path, and limits on its way.

Positions are in metres, in the frame of the root; joints in degrees.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray

#: A tip that is slower than this share of its peak has not begun to move, or has arrived.
_MOVING = 0.02
_AXES = 3


class TipMotion(NamedTuple):
    """A motion, sampled: times (samples,) in s, positions (samples, 3) of the tip, joints (samples, joints).

    ``reported`` are the positions by the controller, ``seen`` those by the encoders of the joints.
    """

    time: FloatArray
    reported: FloatArray
    seen: FloatArray
    joints: FloatArray

    @property
    def speeds(self) -> FloatArray:
        """The speeds of the tip (m/s) by the encoders, for each sample."""
        speeds: FloatArray = np.linalg.norm(self._velocities, axis=1)
        return speeds

    @property
    def _velocities(self) -> FloatArray:
        if len(self.time) < _AXES:
            return np.zeros_like(self.seen)
        velocities: FloatArray = np.gradient(self.seen, self.time, axis=0)
        return velocities

    @property
    def lag(self) -> float:
        """How much later (s) the controller reports a position than the encoders do; NaN without a motion.

        It is the delay that explains most of the difference of both, by the velocity: least squares.
        """
        velocities = self._velocities
        power = float((velocities * velocities).sum())
        return float(((self.seen - self.reported) * velocities).sum()) / power if power > 0.0 else float("nan")

    @property
    def peak_ratio(self) -> float:
        """The peak of the speed by its mean while the tip moves; 1.875 for a minimum jerk; NaN without a motion."""
        speeds = self.speeds
        moving = speeds > _MOVING * speeds.max(initial=0.0)
        return float(speeds.max() / speeds[moving].mean()) if moving.any() else float("nan")

    @property
    def detour(self) -> float:
        """The greatest distance (m) of the path from the straight line between its ends."""
        way = self.seen[-1] - self.seen[0]
        length = float(np.linalg.norm(way))
        if not length:
            return 0.0
        from_start = self.seen - self.seen[0]
        along = np.outer(from_start @ way / length, way / length)
        return float(np.linalg.norm(from_start - along, axis=1).max())

    def margins(self, low: FloatArray, high: FloatArray) -> FloatArray:
        """Return for each joint how near (deg) it came to its limits; negative beyond them."""
        margins: FloatArray = np.minimum(self.joints - low, high - self.joints).min(axis=0)
        return margins
