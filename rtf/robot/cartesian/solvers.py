"""Solvers: what finds the posture for a target. One is part of the controller, another a program of its own."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, NamedTuple

from rtf.robot.interfaces.cartesian import CartesianSolution
from rtf.robot.kinematics import InverseKinematics, vector_of

if TYPE_CHECKING:
    from rtf.robot.cartesian.settings import Settings
    from rtf.robot.interfaces.axes import FloatArray
    from rtf.robot.kinematics import Chain, PointPreference


class Problem(NamedTuple):
    """A target, a position (3,) or a pose (7,), and where the joints are (deg, all of the chain).

    ``chain`` has the tool, and the limits of the settings.
    """

    chain: Chain
    settings: Settings
    target: FloatArray
    start: FloatArray
    attempts: int


class PoseSolver(ABC):
    """A solver. Raises RefusedError for a target that it does not take, and if it is not there."""

    @abstractmethod
    def solve(self, problem: Problem) -> CartesianSolution:
        """Return the posture, of all joints. It may take some time, which is bounded."""

    def ask(self, problem: Problem) -> CartesianSolution:
        """Return the posture for a question that is followed by no motion: ``start`` need not be the present one."""
        return self.solve(problem)

    @abstractmethod
    def request(self, problem: Problem) -> None:
        """Ask for a posture, and do not wait; it takes the place of an earlier question."""

    @abstractmethod
    def answer(self) -> CartesianSolution | None:
        """Return the answer to the last ``request`` once, when it is there."""

    @abstractmethod
    def connected(self) -> bool:
        """Return whether it is there."""

    @abstractmethod
    def close(self) -> None:
        """Close its ports."""


class OwnSolver(PoseSolver):
    """The inverse kinematics of this process. A link is ``drawn`` to a place, such as an elbow downwards."""

    def __init__(self, drawn: PointPreference | None = None) -> None:
        self.drawn = drawn
        self._inverse: InverseKinematics | None = None
        self._answer: CartesianSolution | None = None

    def solve(self, problem: Problem) -> CartesianSolution:
        inverse, settings = self._inverse, problem.settings
        if inverse is None or inverse.chain is not problem.chain:
            inverse = self._inverse = InverseKinematics(problem.chain)
        found = inverse.solve(
            problem.target,
            problem.start,
            rest=settings.rest,
            weights=settings.weights,
            active=settings.active,
            drawn=self.drawn,
            priority=settings.priority,
            attempts=problem.attempts,
        )
        return CartesianSolution(vector_of(found.pose), found.positions)

    def request(self, problem: Problem) -> None:
        self._answer = self.solve(problem)

    def answer(self) -> CartesianSolution | None:
        found, self._answer = self._answer, None
        return found

    def connected(self) -> bool:
        return True

    def close(self) -> None:
        """Do nothing: it has no ports."""
