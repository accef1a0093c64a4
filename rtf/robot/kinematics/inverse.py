"""Inverse kinematics: the posture of a chain that has a given pose, near a given rest posture.

The pose comes first, the rest posture decides among the postures that have it; limits and linear constraints always
hold. It is a least-squares problem that is solved by steps of Levenberg and Marquardt, each a quadratic program of the
package daqp. An attempt that ends beside the target is repeated from other postures, which are always the same.
A target out of reach has the nearest pose, and the solution says by how much.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache, cached_property
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from rtf.robot.errors import RefusedError
from rtf.robot.kinematics.goals import LookAt, goal_of
from rtf.robot.model.errors import MissingPackageError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import ArrayLike, NDArray

    from rtf.robot.kinematics.chain import Chain
    from rtf.robot.kinematics.goals import Goal

Priority = Literal["position", "orientation"]

#: What counts as reached: m, and deg.
POSITION_TOLERANCE, ORIENTATION_TOLERANCE = 1e-4, 0.1
#: Weights of a metre and of a radian beside an error of a radian of a joint that has the full weight of its rest
#: posture. They are so great that a pose within reach is met to a hundredth of the tolerances.
_WEIGHTS: dict[Priority, tuple[float, float]] = {"position": (3000.0, 300.0), "orientation": (300.0, 3000.0)}
#: The least weight of a rest posture, a share of the greatest: a joint that nothing else holds stays where it is.
_LEAST_WEIGHT = 1e-3
#: Times the tolerance: what misses its target by less is solved again without its rest posture.
_NEAR = 10.0
_STEPS = 50
_LONGEST_STEP = 0.6  # rad, m
_DONE = 1e-3  # rad, m: a step so short ends an attempt that has met its target
_STUCK = 1e-7  # likewise, for any attempt
#: Damping: at first, its least and greatest value, and factors after a step that is better and one that is worse.
_DAMPING, _LEAST_DAMPING, _GREATEST_DAMPING, _BETTER, _WORSE = 1e-3, 1e-6, 1e7, 0.1, 10.0
#: Postures from which attempts are repeated, and the share of their joints that is at each limit. Of the nearest ones
#: by their tips, those that are far from each other are taken.
_POSTURES, _AT_LIMIT, _NEAREST = 2000, 1.0 / 3.0, 20
_UNBOUNDED = 1e30


@dataclass(frozen=True, slots=True)
class PointPreference:
    """A place to which the frame of a link, such as an elbow, is drawn beside the rest posture.

    ``weights`` are those of the three axes; a metre counts as a radian of a joint with the full weight.
    """

    link: int
    position: tuple[float, float, float]  # m, in the frame of the root
    weights: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True)
class Solution:
    """A posture, and how far its pose is from the target."""

    positions: NDArray[np.float64]  # deg, m, of all joints
    pose: NDArray[np.float64]  # (4, 4)
    position_error: float  # m
    orientation_error: float  # deg; of a direction, its angle; 0 for a target without an orientation
    reached: bool  # within POSITION_TOLERANCE and ORIENTATION_TOLERANCE
    attempts: int

    @property
    def near(self) -> bool:
        """Whether the target is missed by less than ten times of what counts as reached."""
        near = self.position_error < _NEAR * POSITION_TOLERANCE
        return near and self.orientation_error < _NEAR * ORIENTATION_TOLERANCE

    @property
    def problem(self) -> str:
        """How far the target is out of reach; empty if it is reached."""
        if self.reached:
            return ""
        errors = (self.position_error * 1e3, "mm"), (self.orientation_error, "deg")
        said = " and ".join(f"{error:.3g} {unit}" for error, unit in errors if error)
        return f"the nearest pose is {said} from the target"


class InverseKinematics:
    """The inverse kinematics of a chain. Threads may share an object.

    Raises MissingPackageError, whose message says how to install the missing package.
    """

    def __init__(self, chain: Chain) -> None:
        self.chain = chain
        self._daqp = _package()

    def solve(
        self,
        target: ArrayLike | LookAt,
        start: ArrayLike,
        *,
        rest: ArrayLike | None = None,
        weights: ArrayLike | None = None,
        active: Sequence[bool] | None = None,
        drawn: PointPreference | None = None,
        priority: Priority = "position",
        attempts: int = 6,
    ) -> Solution:
        """Return the posture that has a pose.

        ``target`` is a position (m), a vector of seven numbers, a matrix, or a direction. Attempts begin at ``start``,
        the present positions (deg, m) of all joints; joints that are not ``active`` stay there. ``rest`` are positions
        with ``weights``, of which only the ratio counts: a joint with the weight 0 is drawn to its start, with the
        weight 1.
        A link is ``drawn`` to a place, such as an elbow downwards.
        ``priority`` says what is rather met of a pose out of reach.

        Raises RefusedError for lists of a wrong length, for numbers that are none, for an axis of no length, and if
        there is no joint to move, or no posture within limits and constraints.
        """
        if attempts < 1:
            raise RefusedError(f"the number of attempts is at least 1, not {attempts}")
        if priority not in _WEIGHTS:
            raise RefusedError(f"the priority is {' or '.join(_WEIGHTS)}, not {priority!r}")
        goal = goal_of(target, *_WEIGHTS[priority])
        problem = self._problem(start, rest, weights, active, drawn)
        best: Solution | None = None
        least = math.inf
        for number, posture in enumerate(self._starts(problem, goal, attempts), 1):
            positions = self._attempt(problem, posture, goal)
            solution = self._solution(positions / self.chain.internal, goal, number)
            if not solution.reached and solution.near:  # the rest posture has kept it from its target
                positions = self._attempt(replace(problem, rest=positions, point=None), positions, goal)
                solution = self._solution(positions / self.chain.internal, goal, number)
            size = float(np.linalg.norm(goal.scale * goal.error(solution.pose)))
            if best is None or size < least:
                best, least = solution, size
            if solution.reached:
                return solution
        assert best is not None
        return best

    # Reading ---------------------------------------------------------------------------------------------------------

    def _problem(
        self,
        start: ArrayLike,
        rest: ArrayLike | None,
        weights: ArrayLike | None,
        active: Sequence[bool] | None,
        point: PointPreference | None = None,
    ) -> _Problem:
        chain = self.chain
        free = np.array([True] * len(chain) if active is None else list(active), dtype=np.bool_)
        if free.shape != (len(chain),):
            raise RefusedError(f"{chain.name} has {len(chain)} joints, so active has as many values, not {free.size}")
        if not free.any():
            raise RefusedError(f"{chain.name}: no joint is active")
        present = chain.checked(start, batched=False) * chain.internal
        drawn = np.zeros(len(chain)) if weights is None else chain.checked(weights, batched=False)
        if (drawn < 0.0).any():
            raise RefusedError(f"{chain.name}: weights of the rest posture are not negative, as in {drawn.tolist()}")
        low, high = chain.minima * chain.internal, chain.maxima * chain.internal
        aim = present if rest is None else chain.checked(rest, batched=False) * chain.internal
        aim = np.where(drawn > 0.0, np.clip(aim, low, high), present)
        drawn = np.where(drawn > 0.0, drawn, 1.0)
        if point is not None and not np.isfinite([*point.position, *point.weights]).all():
            raise RefusedError(f"{chain.name}: a place and its weights are finite numbers, not {point}")
        matrix, lower, upper = self._constraints(free)
        return _Problem(
            free=free,
            start=present,
            low=np.where(free, low, present),
            high=np.where(free, high, present),
            matrix=matrix,
            lower=lower,
            upper=upper,
            rest=aim,
            squares=np.maximum(drawn / drawn.max(), _LEAST_WEIGHT) ** 2,
            point=point,
        )

    def _constraints(
        self, free: NDArray[np.bool_]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return the constraints of free joints in radians: sums of those stay the same, so bounds have one unit."""
        chain = self.chain
        matrix, lower, upper, names = chain.constraint_rows()
        factors = {one.name: one.factors for one in chain.constraints}
        rows = [place for place, name in enumerate(names) if all(free[chain.index(joint)] for joint in factors[name])]
        return matrix[rows] / chain.internal, lower[rows], upper[rows]

    # Attempts --------------------------------------------------------------------------------------------------------

    def _starts(self, problem: _Problem, goal: Goal, attempts: int) -> Iterator[NDArray[np.float64]]:
        """Yield where attempts begin: at the start, then at postures whose tips are near the target."""
        begun = [self._allowed(problem, problem.start)]
        yield begun[0]
        postures, poses = self._postures
        order = np.argsort(goal.distances(poses), kind="stable")
        near = np.where(problem.free, postures[order[:_NEAREST]], problem.start)
        place = 0
        for _ in range(min(attempts - 1, _NEAREST)):
            begun.append(near[place])
            yield self._allowed(problem, near[place])
            place = int(np.min([np.linalg.norm(near - one, axis=1) for one in begun], axis=0).argmax())

    @cached_property
    def _postures(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Postures within limits and constraints (rad, m), many at limits, where attempts stick; their poses."""
        chain = self.chain
        generator = np.random.default_rng(0)
        shape = _POSTURES, len(chain)
        postures, shares = generator.uniform(chain.minima, chain.maxima, shape), generator.uniform(size=shape)
        postures = np.where(shares < _AT_LIMIT, chain.minima, postures)
        postures = np.where(shares > 1.0 - _AT_LIMIT, chain.maxima, postures)
        problem = self._problem((chain.minima + chain.maxima) / 2.0, None, None, None)
        allowed = np.array([self._allowed(problem, posture) for posture in postures * chain.internal])
        return allowed, chain.pose(allowed / chain.internal)

    def _allowed(self, problem: _Problem, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the nearest positions within limits and constraints."""
        step = self._step(problem, positions, np.eye(len(self.chain)), np.zeros(len(self.chain)))
        if step is None:
            raise RefusedError(f"{self.chain.name}: no posture is within its limits and its constraints")
        moved: NDArray[np.float64] = np.clip(positions + step, problem.low, problem.high)
        return moved

    def _attempt(self, problem: _Problem, positions: NDArray[np.float64], goal: Goal) -> NDArray[np.float64]:
        """Return where the steps from allowed positions end (rad, m)."""
        damping = _DAMPING
        error, jacobian, cost = self._state(problem, positions, goal)
        for _ in range(_STEPS):
            away = problem.squares * (positions - problem.rest)
            hessian = jacobian.T @ jacobian + np.diag(problem.squares + damping)
            step = self._step(problem, positions, hessian, away - jacobian.T @ error)
            longest = 0.0 if step is None else float(np.abs(step).max())
            if step is None or longest < _STUCK or damping > _GREATEST_DAMPING:
                break
            step = step * min(1.0, _LONGEST_STEP / longest)
            moved = np.clip(positions + step, problem.low, problem.high)
            state = self._state(problem, moved, goal)
            if state[2] >= cost:
                damping = max(damping * _WORSE, _DAMPING)
                continue
            positions, (error, jacobian, cost) = moved, state
            damping = max(damping * _BETTER, _LEAST_DAMPING)
            if longest < _DONE and _met(error, goal.scale):
                break
        return positions

    def _state(
        self, problem: _Problem, positions: NDArray[np.float64], goal: Goal
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
        """Return weighted errors and Jacobian at positions (rad, m), and the sum of squares that is to be least."""
        pose, jacobian = self.chain.pose_and_jacobian(positions / self.chain.internal)
        error = goal.scale * goal.error(pose)
        jacobian = goal.scale[:, np.newaxis] * goal.jacobian(pose, jacobian)
        if problem.point is not None:
            point, weights = problem.point, np.array(problem.point.weights)
            frame, rows = self.chain.pose_and_jacobian(positions / self.chain.internal, point.link)
            error = np.concatenate([error, weights * (point.position - frame[:3, 3])])
            jacobian = np.vstack([jacobian, weights[:, np.newaxis] * rows[:3]])
        away = positions - problem.rest
        cost = float(error @ error + problem.squares @ (away * away))
        return error, jacobian * problem.free, cost

    def _step(
        self,
        problem: _Problem,
        positions: NDArray[np.float64],
        hessian: NDArray[np.float64],
        gradient: NDArray[np.float64],
    ) -> NDArray[np.float64] | None:
        """Return the step that makes a quadratic cost least, within limits and constraints; None if there is none."""
        sums = problem.matrix @ positions
        upper = np.concatenate([problem.high - positions, problem.upper - sums])
        lower = np.concatenate([problem.low - positions, problem.lower - sums])
        kinds = np.zeros(upper.size, dtype=np.int32)
        step, _, flag, _ = self._daqp.solve(
            hessian,
            gradient,
            problem.matrix,
            np.minimum(upper, _UNBOUNDED),
            np.maximum(lower, -_UNBOUNDED),
            kinds,
        )
        return np.asarray(step, dtype=np.float64) if flag > 0 else None

    def _solution(self, positions: NDArray[np.float64], goal: Goal, attempts: int) -> Solution:
        pose = self.chain.pose(positions)
        distance, angle = goal.missed(pose)
        reached = distance <= POSITION_TOLERANCE and angle <= ORIENTATION_TOLERANCE
        return Solution(positions, pose, distance, angle, reached, attempts)


@dataclass(frozen=True, slots=True)
class _Problem:
    """What an attempt keeps to, in radians and metres, for all joints."""

    free: NDArray[np.bool_]
    start: NDArray[np.float64]
    low: NDArray[np.float64]  # of a joint that is not free: its position
    high: NDArray[np.float64]
    matrix: NDArray[np.float64]  # of constraints
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    rest: NDArray[np.float64]
    squares: NDArray[np.float64]  # of the weights of the rest posture
    point: PointPreference | None


@cache
def _package() -> Any:  # it has no annotations
    try:
        return import_module("daqp")
    except ImportError as error:
        raise MissingPackageError(
            f"inverse kinematics need the package daqp: pip install 'rtf[kinematics]' ({error})"
        ) from error


def _met(error: NDArray[np.float64], scale: NDArray[np.float64]) -> bool:
    """Return whether a weighted error is well within what counts as reached; a radian of a direction as a metre."""
    plain = np.abs(error[: scale.size] / scale)
    return bool(plain[:3].max() < POSITION_TOLERANCE / 4 and plain.max() < math.radians(ORIENTATION_TOLERANCE) / 4)
