"""Designs: which runs of a campaign are made, from what is known so far.

A design is a function of the results alone. A campaign that is resumed, extended or run again asks it once more, and
does what it names and has not got.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from rtf.campaigns.errors import CampaignError
from rtf.campaigns.file import Range

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from rtf.campaigns.campaign import Campaign, Cell
    from rtf.campaigns.tasks import Task

    #: For each task that is done, by its key: whether its test failed; None if it says nothing of the robot.
    Found = Mapping[str, bool | None]

T = TypeVar("T")


class Design(ABC):
    """A design of a campaign."""

    def __init__(self, campaign: Campaign) -> None:
        self.campaign = campaign

    @abstractmethod
    def tasks(self, found: Found) -> Iterator[Task]:
        """Yield the tasks that are wanted now, those that are done among them."""

    @property
    def most(self) -> int:
        """The number of its tasks; of a sequential design the greatest possible one."""
        return len({task.key for task in self.tasks({})})


class Grid(Design):
    """All combinations."""

    def tasks(self, found: Found) -> Iterator[Task]:  # noqa: ARG002 - of the base class
        campaign = self.campaign
        combinations = [*product(*map(_texts, campaign.overrides))]
        for cell in campaign.cells:
            for severity in _grid(campaign.severities(cell)):
                for unit, seed, overrides in product(cell.units, campaign.file.all_seeds, combinations):
                    yield campaign.task(cell, unit, seed, severity, overrides)


class Drawn(Design):
    """Points of a cube with a side for the cell, the unit, the severity, the seed and each override."""

    def tasks(self, found: Found) -> Iterator[Task]:  # noqa: ARG002 - of the base class
        campaign = self.campaign
        sides = 4 + len(campaign.overrides)
        for point in self._points(sides):
            place, unit, severity, seed, *values = (float(share) for share in point)
            cell = _one(campaign.cells, place)
            yield campaign.task(
                cell,
                _one(cell.units, unit),
                _one(campaign.file.all_seeds, seed),
                _pick(campaign.severities(cell), severity),
                [str(_pick(given, share)) for given, share in zip(campaign.overrides, values, strict=True)],
            )

    def _points(self, sides: int) -> NDArray[np.float64]:
        design = self.campaign.file.design
        if design.kind == "random":  # more points continue the same sequence
            return np.random.default_rng(design.seed).random((design.points, sides))
        try:
            from scipy.stats import qmc
        except ImportError:
            raise CampaignError("a Latin hypercube needs scipy: pip install 'rtf[campaign]'") from None
        points: NDArray[np.float64] = qmc.LatinHypercube(sides, rng=design.seed).random(design.points)
        return points


class Claimed(Design):
    """What the claims of tests say: faults that they find, faults that they do not mind, and healthy robots."""

    def tasks(self, found: Found) -> Iterator[Task]:  # noqa: ARG002 - of the base class
        from rtf.campaigns.claims import task_of
        from rtf.robot_testing.proof import shipped_cases

        file = self.campaign.file
        for case in shipped_cases([test.name for test in file.tests], fast=file.design.fast):
            for seed in file.all_seeds:
                yield task_of(case, seed)


@dataclass(frozen=True, slots=True)
class _Level:
    """What is known of one severity: the runs that are wanted for it, and whether the fault is found (None: open)."""

    wanted: list[Task]
    decided: bool | None


class Sequential(Design):
    """Runs until an interval decides; between the ends of a range of severities it bisects.

    A look at the results after each batch is one of several, so each has the risk of the whole divided by their number
    (Bonferroni): the promised confidence holds for the decision, however many looks it took.
    """

    def __init__(self, campaign: Campaign) -> None:
        super().__init__(campaign)
        try:
            from rtf.campaigns.report.rates import exact_rate
        except ImportError:
            raise CampaignError("a sequential design needs scipy: pip install 'rtf[campaign]'") from None
        self._rate = exact_rate
        self._design = campaign.file.design
        self._batches: dict[tuple[int, float | None, tuple[str, ...], int], dict[str, Task]] = {}
        self._overrides = [*product(*map(_texts, campaign.overrides))]
        self._pools = {units: self._pool(units) for units in {tuple(cell.units) for cell in campaign.cells}}

    def _pool(self, units: tuple[int, ...]) -> list[tuple[int, int]]:
        """Return units and seeds in the order in which they are used: a mixture, and the same one at every level."""
        pairs = [*product(units, self.campaign.file.all_seeds)]
        order = np.random.default_rng(self._design.seed).permutation(len(pairs))
        return [pairs[place] for place in order]

    @property
    def most(self) -> int:
        """The number of tasks if no interval ever decides early."""
        total = 0
        for cell in self.campaign.cells:
            severities = self.campaign.severities(cell)
            levels = self._steps + 2 if isinstance(severities, Range) else len(severities)
            total += levels * len(self._pools[tuple(cell.units)]) * len(self._overrides)
        return total

    @property
    def _steps(self) -> int:
        """The number of bisections until the interval is as small as the resolution."""
        return math.ceil(math.log2(1.0 / self._design.resolution))

    def tasks(self, found: Found) -> Iterator[Task]:
        for cell, overrides in product(self.campaign.cells, self._overrides):
            severities = self.campaign.severities(cell)
            if isinstance(severities, Range):
                yield from self._bisection(cell, severities, overrides, found)
            else:
                for severity in severities:
                    yield from self._level(cell, severity, overrides, found).wanted

    def _bisection(self, cell: Cell, severities: Range, overrides: tuple[str, ...], found: Found) -> Iterator[Task]:
        """Look at the greatest severity, at the smallest, then in the middle of what is left."""
        high = self._level(cell, severities.at(1.0), overrides, found)
        yield from high.wanted
        if high.decided is not True:  # open yet, or not even that one is found
            return
        low = self._level(cell, severities.at(0.0), overrides, found)
        yield from low.wanted
        if low.decided is not False:
            return
        missed, seen = 0.0, 1.0
        for _ in range(self._steps):
            middle = self._level(cell, severities.at((missed + seen) / 2), overrides, found)
            yield from middle.wanted
            if middle.decided is None:
                return
            missed, seen = (missed, (missed + seen) / 2) if middle.decided else ((missed + seen) / 2, seen)

    def _level(self, cell: Cell, severity: float | None, overrides: tuple[str, ...], found: Found) -> _Level:
        """Return the runs of a severity so far with the next batch, or those that have decided."""
        pool, batch = self._pools[tuple(cell.units)], self._design.batch
        rate = self._design.alarms if cell.fault is None else self._design.rate
        looks = math.ceil(len(pool) / batch)
        wanted: list[Task] = []
        failures = judged = 0
        for first in range(0, len(pool), batch):
            tasks = self._batch(cell, severity, overrides, first)
            wanted += tasks.values()
            results = [found[key] for key in tasks if key in found]
            if len(results) < len(tasks):
                return _Level(wanted, None)
            judged += sum(result is not None for result in results)
            failures += sum(result is True for result in results)
            known = self._rate(failures, judged, 1.0 - (1.0 - self._design.confidence) / looks)
            if known.low > rate or known.high < rate:
                return _Level(wanted, known.low > rate)
        return _Level(wanted, judged > 0 and failures >= rate * judged)  # all is used: the best estimate

    def _batch(self, cell: Cell, severity: float | None, overrides: tuple[str, ...], first: int) -> dict[str, Task]:
        """Return the tasks of a batch by their keys. Kept, because each look at the results asks for them."""
        place = (id(cell), severity, overrides, first)
        if place not in self._batches:
            pairs = self._pools[tuple(cell.units)][first : first + self._design.batch]
            tasks = [self.campaign.task(cell, *pair, severity, overrides) for pair in pairs]
            self._batches[place] = {task.key: task for task in tasks}
        return self._batches[place]


def make_design(campaign: Campaign) -> Design:
    """Return the design of a campaign. Raises CampaignError if it needs a package that is not installed."""
    kinds = {"grid": Grid, "random": Drawn, "latin_hypercube": Drawn, "sequential": Sequential, "claims": Claimed}
    made: Design = kinds[campaign.file.design.kind](campaign)  # type: ignore[abstract]  # these are not
    return made


def _grid(values: Sequence[T] | Range) -> Sequence[T | float]:
    return values.grid() if isinstance(values, Range) else values


def _texts(values: Sequence[str] | Range) -> list[str]:
    return [str(one) for one in _grid(values)]


def _pick(values: Sequence[T] | Range, share: float) -> T | float:
    """Return the value at this share, from 0 to less than 1, of a list or a range."""
    return values.at(share) if isinstance(values, Range) else _one(values, share)


def _one(values: Sequence[T], share: float) -> T:
    return values[int(share * len(values))]
