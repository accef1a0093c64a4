"""The outcome of one run of a campaign: what was run, the verdict, the cost and the measurements.

Between the engine, which makes outcomes, and the report, which needs nothing else. Plain data, with no path, process or
database in them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.testing.verdict import Verdict


@dataclass(frozen=True, slots=True)
class Measured:
    """A measured value with its unit and inclusive limits; ``None`` is no limit.

    ``value`` may be NaN or infinite, if the test measured that.
    """

    value: float
    unit: str = ""
    lower: float | None = None
    upper: float | None = None


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of one test in one run.

    ``unit`` is the number of the robot in its population (0 is the nominal robot), ``seed`` that of its noise.
    ``fault`` is the kind of the fault, ``joint`` its target and ``severity`` how far its first parameter is from its
    healthy value, as ``Fault.severity`` says; all are None on a healthy robot, and ``severity`` is None for kinds that
    have no size. ``named`` is the subject of the first failure of the last attempt, None if there was none.

    ``seconds`` are by the clock and ``processor_seconds`` by the processor, over all ``attempts``. The keys of
    ``measurements`` are ``name`` or, in a sub-result, ``subject/name``; what was measured more than once in the last
    attempt is followed by its number: ``subject/name#2``.
    """

    test: str
    robot: str
    unit: int
    seed: int
    fault: str | None
    joint: str | None
    severity: float | None
    verdict: Verdict
    named: str | None
    attempts: int
    seconds: float
    processor_seconds: float
    measurements: Mapping[str, Measured] = field(default_factory=dict)

    @property
    def healthy(self) -> bool:
        """Whether the robot had no fault."""
        return self.fault is None
