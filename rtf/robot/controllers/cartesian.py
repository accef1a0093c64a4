"""Cartesian motion: joints and tip of a chain move to a posture together, the tip almost on a straight line.

The posture is the answer of a solver. Filters of minimum jerk give the speeds with which the joints would go to it, and
the tip to its pose; what the tip would miss is given to the joints by their Jacobian, the less the nearer they are to a
limit. The state is planned: it begins at the encoders, and goes on without them, so noise does not come back as speed.
The equations and numbers are those of the controller of the iCub.

:class:`CartesianMotion` is called once a period, and says which positions to command. It knows neither boards nor ports
nor clocks nor the solver.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.controllers.minimum_jerk import MinimumJerkFilter
from rtf.robot.errors import RefusedError
from rtf.robot.kinematics.poses import checked_pose, pose_error

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from rtf.robot.kinematics import Chain

#: How much of what the tip misses the joints make up for, in the middle of their ranges.
STRAIGHTNESS = 0.05
#: The share of a range next to a limit in which a joint makes up for nothing; in twice that it begins.
_GUARD = 0.025
#: How sharply it does, in a guard.
_STEEPNESS = 10.0
_TASK = 6


class CartesianMotion:
    """Motions of a chain whose joints all take part; ``period`` and ``duration`` in seconds.

    Positions are those of the chain (deg, m). ``reset`` has to come before ``begin``.
    """

    def __init__(
        self, chain: Chain, *, period: float = 0.01, duration: float = 2.0, straightness: float = STRAIGHTNESS
    ) -> None:
        if not len(chain):
            raise RefusedError(f"{chain.name} has no joint to move")
        self.chain = chain
        self.period = period
        self.straightness = straightness
        self._joints = MinimumJerkFilter(len(chain), period, duration)
        self._tip = MinimumJerkFilter(_TASK, period, duration)
        self._low, self._high = chain.minima * chain.internal, chain.maxima * chain.internal
        self._planned = self._wanted = np.zeros(len(chain))  # rad, m
        self._rates = np.zeros(len(chain))  # rad/s, m/s
        self._pose = np.eye(4)
        self._has_orientation = True

    @property
    def duration(self) -> float:
        """The time of motions (s): 90 % of the way are done then, and all of it in half as long again."""
        return self._joints.duration

    @duration.setter
    def duration(self, value: float) -> None:
        self._joints.duration = self._tip.duration = value

    @property
    def planned(self) -> NDArray[np.float64]:
        """The planned positions (deg, m)."""
        planned: NDArray[np.float64] = self._planned / self.chain.internal
        return planned

    @property
    def speeds(self) -> NDArray[np.float64]:
        """The planned speeds (deg/s, m/s)."""
        speeds: NDArray[np.float64] = self._rates / self.chain.internal
        return speeds

    @property
    def pose(self) -> NDArray[np.float64]:
        """The pose (4, 4) that is being reached."""
        return self._pose

    def reset(self, positions: ArrayLike) -> None:
        """Begin at rest at measured positions, within the limits."""
        measured = self.chain.checked(positions, batched=False) * self.chain.internal
        self._planned = np.clip(measured, self._low, self._high)
        self._wanted, self._rates = self._planned, np.zeros(len(self.chain))
        self._pose = self.chain.pose(self.planned)
        self._joints.reset()
        self._tip.reset()

    def begin(self, positions: ArrayLike, *, has_orientation: bool = True) -> None:
        """Move to positions (deg, m), and the tip to the pose that they have; a motion under way goes on smoothly."""
        self._wanted = np.clip(
            self.chain.checked(positions, batched=False) * self.chain.internal, self._low, self._high
        )
        self._pose = checked_pose(self.chain.pose(self._wanted / self.chain.internal))
        self._has_orientation = has_orientation

    def step(self) -> NDArray[np.float64]:
        """Return the positions (deg, m) to command now."""
        pose, jacobian = self.chain.pose_and_jacobian(self.planned)
        rates = self._joints.step(self._wanted - self._planned)
        missed = self._tip.step(self._left(pose)) - jacobian @ rates
        weights = self._weights()
        spread = (jacobian * weights) @ jacobian.T + np.eye(_TASK)
        rates = rates + weights * (jacobian.T @ np.linalg.solve(spread, missed))
        self._planned = np.clip(self._planned + (rates + self._rates) * self.period / 2.0, self._low, self._high)
        self._rates = rates
        return self.planned

    def error(self, positions: ArrayLike) -> float:
        """Return how far the tip is from its pose, metres and radians in one norm, by planned or measured positions."""
        return float(np.linalg.norm(self._left(self.chain.pose(positions))))

    def done(self, positions: ArrayLike, tolerance: float) -> bool:
        """Return whether planned and measured tip are within a tolerance of the pose."""
        return self.error(self.planned) < tolerance and self.error(positions) < tolerance

    def share(self, start: ArrayLike) -> float:
        """Return which share of the way from some positions has been done, 0 to 1."""
        first = self.chain.checked(start, batched=False) * self.chain.internal
        way = float(np.linalg.norm(self._wanted - first))
        return min(1.0, float(np.linalg.norm(self._planned - first)) / way) if way else 1.0

    def _left(self, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        error = pose_error(self._pose, pose)
        if not self._has_orientation:
            error[3:] = 0.0
        return error

    def _weights(self) -> NDArray[np.float64]:
        """Return how much each joint makes up for: nothing at its limits, and all in the middle."""
        guard = _GUARD * (self._high - self._low)
        near = np.minimum(self._planned - self._low, self._high - self._planned)
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = (1.0 + np.tanh(_STEEPNESS * (near - 1.5 * guard) / guard)) / 2.0
        return self.straightness * np.where(near >= 2.0 * guard, 1.0, np.where(near > guard, slope, 0.0))
