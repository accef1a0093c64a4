"""Outcomes of campaigns whose truth is known, because it is simulated here: no robot is run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import expit

from rtf.campaigns import Measured, Outcome
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence


def outcome(verdict: Verdict = Verdict.PASSED, **members: object) -> Outcome:
    """Return an outcome of a healthy robot, with other members as given."""
    usual: dict[str, object] = {
        "test": "Sweep",
        "robot": "icub",
        "unit": 1,
        "seed": 0,
        "fault": None,
        "joint": None,
        "severity": None,
        "named": None,
        "attempts": 1,
        "seconds": 2.0,
        "processor_seconds": 1.5,
        "measurements": {},
    }
    return Outcome(verdict=verdict, **{**usual, **members})  # type: ignore[arg-type]


def faulty(severity: float | None, *, found: bool, **members: object) -> Outcome:
    """Return an outcome of a robot with a fault of this severity."""
    usual: dict[str, object] = {"fault": "encoder_drift", "joint": "l_elbow", "named": "l_elbow" if found else None}
    return outcome(Verdict.FAILED if found else Verdict.PASSED, **{**usual, "severity": severity, **members})


@dataclass(frozen=True)
class Truth:
    """A test that finds a fault of severity ``middle`` half of the time; ``steepness`` is that of the curve."""

    middle: float = 1.0
    steepness: float = 4.0

    def share(self, severity: float | np.ndarray) -> np.ndarray:
        """Return the true share that is found."""
        shares: np.ndarray = expit(self.steepness * np.log(np.asarray(severity) / self.middle))
        return shares

    @property
    def limit(self) -> float:
        """The severity of which 99 % are found."""
        return float(self.middle * 99.0 ** (1.0 / self.steepness))

    def campaign(
        self, random: np.random.Generator, severities: Sequence[float], runs: int, **members: object
    ) -> list[Outcome]:
        """Return outcomes of so many runs at each severity."""
        return [
            faulty(severity, found=bool(random.random() < self.share(severity)), unit=unit, **members)
            for severity in severities
            for unit in range(runs)
        ]


def measured(values: Iterable[float], lower: float | None = None, upper: float | None = None) -> list[Outcome]:
    """Return outcomes of healthy units that measured these values, judged by their limits."""
    outcomes = []
    for unit, value in enumerate(values):
        inside = (lower is None or value >= lower) and (upper is None or value <= upper)
        verdict = Verdict.PASSED if inside else Verdict.FAILED
        measurements: Mapping[str, Measured] = {"l_elbow/error": Measured(value, "deg", lower, upper)}
        outcomes.append(outcome(verdict, unit=unit, measurements=measurements))
    return outcomes
