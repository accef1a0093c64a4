"""What each test costs, and which tests find everything for the least time.

The smallest set of tests that finds all faults is a weighted set cover; the greedy choice takes at most ``ln(n) + 1``
times the time of the best one (V. Chvatal, Mathematics of Operations Research 4, 1979).
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rtf.campaigns.report.detection import WANTED

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from rtf.campaigns.outcomes import Outcome
    from rtf.campaigns.report.detection import Curve

#: A test that is done at once still costs something.
_LEAST = 1e-3


@dataclass(frozen=True, slots=True)
class Cost:
    """The time of one test on one robot: of runs on healthy robots if there are any, else of all its runs."""

    test: str
    robot: str
    runs: int
    seconds: float
    longest: float
    processor_seconds: float


@dataclass(frozen=True, slots=True)
class Need:
    """A fault that is to be found; ``severity`` is None for kinds without a size."""

    fault: str
    direction: str
    severity: float | None


@dataclass(frozen=True, slots=True)
class Step:
    """A test of the choice: its time, the time with those before it, what it adds, and the share that is found then."""

    test: str
    seconds: float
    total_seconds: float
    adds: tuple[Need, ...]
    share: float


@dataclass(frozen=True, slots=True)
class Choice:
    """The tests to run on one robot, in the order of the choice.

    ``needs`` is how many faults some test finds at 99 %; ``missed`` are those of them which the choice does not find,
    for lack of time, and ``found_by_none`` what no test finds at 99 %.
    """

    robot: str
    budget: float | None
    needs: int
    steps: tuple[Step, ...]
    missed: tuple[Need, ...]
    found_by_none: tuple[Need, ...]


def costs(outcomes: Iterable[Outcome]) -> tuple[Cost, ...]:
    """Return the cost of each test and robot, the longest first."""
    groups: dict[tuple[str, str], list[Outcome]] = defaultdict(list)
    for outcome in outcomes:
        groups[outcome.test, outcome.robot].append(outcome)
    found = [_cost(*key, group) for key, group in groups.items()]
    return tuple(sorted(found, key=lambda cost: (-cost.seconds, cost.test, cost.robot)))


def _cost(test: str, robot: str, group: Sequence[Outcome]) -> Cost:
    these = [outcome for outcome in group if outcome.healthy] or group
    seconds = np.array([outcome.seconds for outcome in these])
    processor = np.array([outcome.processor_seconds for outcome in these])
    return Cost(test, robot, len(these), float(seconds.mean()), float(seconds.max()), float(processor.mean()))


def choices(curves: Sequence[Curve], prices: Sequence[Cost], budget: float | None = None) -> tuple[Choice, ...]:
    """Return the choice for each robot that has had faults; ``budget`` is the time for all tests, in seconds."""
    return tuple(
        _choice(robot, [curve for curve in curves if curve.robot == robot], _prices(prices, robot), budget)
        for robot in sorted({curve.robot for curve in curves})
    )


def _prices(prices: Sequence[Cost], robot: str) -> dict[str, float]:
    return {cost.test: max(cost.seconds, _LEAST) for cost in prices if cost.robot == robot}


def _choice(robot: str, curves: Sequence[Curve], prices: Mapping[str, float], budget: float | None) -> Choice:
    needs = {need for curve in curves for need in _needs(curve)}
    finds: dict[str, set[Need]] = defaultdict(set)
    for curve in curves:
        finds[curve.test] |= {need for need in needs if _finds(curve, need)}
    findable = set().union(*finds.values())
    chosen = _without_idle(_greedy(finds, prices, budget), finds)
    steps, done, total = [], set[Need](), 0.0
    for test in chosen:
        adds = finds[test] - done
        done |= adds
        total += prices[test]
        steps.append(Step(test, prices[test], total, _sorted(adds), len(done) / len(findable)))
    return Choice(robot, budget, len(findable), tuple(steps), _sorted(findable - done), _sorted(needs - findable))


def _needs(curve: Curve) -> list[Need]:
    """Return what a curve is about: each severity that was tried, or the fault itself."""
    severities: list[float | None] = [level.severity for level in curve.levels if level.severity]
    return [Need(curve.fault, curve.direction, severity) for severity in severities or [None]]


def _finds(curve: Curve, need: Need) -> bool:
    """Return whether a test finds this fault in 99 % of all cases, by its curve."""
    if (curve.fault, curve.direction) != (need.fault, need.direction):
        return False
    if need.severity is None:
        return curve.found.share is not None and curve.found.share >= WANTED
    return curve.limit.severity is not None and need.severity >= curve.limit.severity


def _greedy(finds: Mapping[str, set[Need]], prices: Mapping[str, float], budget: float | None) -> list[str]:
    """Return tests in the order of what each adds in a second, as long as it adds something and there is time."""
    chosen: list[str] = []
    done: set[Need] = set()
    left = float("inf") if budget is None else budget
    while True:
        useful = {test: len(found - done) for test, found in finds.items() if found - done and prices[test] <= left}
        if not useful:
            return chosen
        best = max(sorted(useful), key=lambda test: useful[test] / prices[test])
        chosen.append(best)
        done |= finds[best]
        left -= prices[best]


def _without_idle(chosen: Sequence[str], finds: Mapping[str, set[Need]]) -> list[str]:
    """Return the chosen tests without those that later ones have made needless."""
    kept = [*chosen]
    for test in chosen:
        others = set().union(*(finds[other] for other in kept if other != test))
        if finds[test] <= others:
            kept.remove(test)
    return kept


def _sorted(needs: Iterable[Need]) -> tuple[Need, ...]:
    return tuple(sorted(needs, key=lambda need: (need.fault, need.direction, need.severity or 0.0)))
