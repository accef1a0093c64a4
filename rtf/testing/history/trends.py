"""Trends of the history: pass rates, flaky tests, and measurements that drift.

Everything is computed on request, from the last runs of one robot on one station. The result is strict JSON in the
shape of ``docs/page.md``. In addition a run has its ``duration``, and a drift has whether it may be ``believed``, and
which ``limit`` it would reach ``after`` how many runs.
"""

from __future__ import annotations

import fnmatch
import itertools
import math
from collections import Counter
from functools import cache, partial
from statistics import median
from typing import TYPE_CHECKING, Any

from rtf.testing.measurement import MeasurementVerdict, wilson_interval
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from rtf.testing.history.database import History, MeasurementRow, StoredRun, TestRow

#: The normal approximation of the Mann-Kendall test needs so many values.
_FEWEST = 10
_BELIEVED = 0.05
#: A line through so many runs is followed at most so many times as far.
_AHEAD = 10
#: Of more values than this in one run a plot gets the smallest, the middle and the largest.
_MOST_POINTS = 20

_GOOD = frozenset(verdict.value for verdict in Verdict if verdict.good and verdict.ran)
#: A test with one of these verdicts was not judged, or was stopped by a person.
_UNJUDGED = frozenset(verdict.value for verdict in Verdict if not verdict.ran) | {Verdict.INTERRUPTED.value}

Point = tuple[int, float | None, float | None, float | None, str]


def trends(
    history: History,
    *,
    names: Sequence[str] = (),
    suites: Collection[str] | None = None,
    robot: str | None = None,
    station: str | None = None,
    last: int = 50,
) -> dict[str, Any]:
    """The last runs in which there is something that is asked for, and what became of it in them.

    A name with ``*``, ``?`` or ``[`` is a pattern for the whole of a test's id, a subject, a measurement's name or all
    of them joined by ``/``; any other is looked for anywhere in them, in capitals or not. Without names and suites
    everything is asked for, runs in which there is nothing too.

    Robot and station are those of the newest run unless they are given; ``*`` mixes all. In the file of a campaign they
    are all unless they are given, and runs in which the robot had a fault are left out. Raises HistoryError.
    """
    tests: dict[str, dict[int, str]] = {}
    points: dict[tuple[str, str, str], list[Point]] = {}
    units: dict[tuple[str, str, str], str] = {}
    with history.snapshot():
        robot, station = _of_the_newest(history, robot, station)
        faulty = history.faulty()
        healthy = ((number, run) for number, run in history.runs(robot, station) if number not in faulty)
        found = [*itertools.islice(_selected(history, healthy, names, suites), last)]
    found.reverse()
    mixed = len({(run.robot, run.station) for run, _, _ in found}) > 1
    for index, (_, of_tests, of_measurements) in enumerate(found):
        for row in of_tests:
            tests.setdefault(row[0], {})[index] = row[3]
        for test, subject, name, _, value, _, unit, low, high, _, verdict in of_measurements:
            points.setdefault((test, subject, name), []).append((index, value, low, high, verdict))
            units[test, subject, name] = unit
    return {
        "runs": [_run(run) for run, _, _ in found],
        "measurements": _measurements(points, units, mixed=mixed),
        "tests": {
            test: _test([verdicts.get(index) for index in range(len(found))]) for test, verdicts in tests.items()
        },
    }


#: So many runs of a campaign are on a page.
_OF_A_CAMPAIGN = 500


def trends_for_a_run(
    history: History, suites: Collection[str], robot: str | None, station: str | None
) -> dict[str, Any]:
    """Return the trends for the page of a run: those of its robot on its station.

    In the file of a campaign they are those of all robots and units. Raises HistoryError.
    """
    if history.is_campaign:
        return trends(history, suites=suites, last=_OF_A_CAMPAIGN)
    return trends(history, suites=suites, robot=robot, station=station)


def _of_the_newest(history: History, robot: str | None, station: str | None) -> tuple[str, str]:
    """Return robot and station; one that is not given is that of the newest run which the other allows."""
    wanted = "*" if robot is None else robot, "*" if station is None else station
    known = (robot is not None and station is not None) or history.is_campaign
    runs = [] if known else history.runs(*wanted)
    if not runs:
        return wanted
    newest = runs[0][1]
    return newest.robot if robot is None else robot, newest.station if station is None else station


_Found = tuple["StoredRun", "list[TestRow]", "list[MeasurementRow]"]


def _selected(
    history: History, runs: Iterable[tuple[int, StoredRun]], names: Sequence[str], suites: Collection[str] | None
) -> Iterator[_Found]:
    named = cache(partial(_named, names))  # the same ones come in every run
    for number, run in runs:
        tests = [row for row in history.tests(number) if suites is None or row[2] in suites]
        ids = {row[0] for row in tests}
        measurements = [row for row in history.measurements(number) if suites is None or row[0] in ids]
        tests = [row for row in tests if named(row[:1])]
        measurements = [row for row in measurements if named(row[:3])]
        if tests or measurements or (not names and suites is None):
            yield run, tests, measurements


def _named(names: Sequence[str], parts: tuple[str, ...]) -> bool:
    whole = "/".join(part for part in parts if part)
    return not names or any(
        any(fnmatch.fnmatchcase(text, name) for text in (whole, *parts))
        if any(character in name for character in "*?[")
        else name.casefold() in whole.casefold()
        for name in names
    )


def _run(run: StoredRun) -> dict[str, Any]:
    return {
        "run": run.run,
        "started": run.started,
        "duration": run.duration,
        "verdict": run.verdict,
        "robot": run.robot,
        "station": run.station,
        "version": run.version,
    }


# Tests ---------------------------------------------------------------------------------------------------------------


def _test(verdicts: list[str | None]) -> dict[str, Any]:
    judged = [verdict in _GOOD for verdict in verdicts if verdict is not None and verdict not in _UNJUDGED]
    return {"verdicts": verdicts, "pass_rate": _rate(judged), "flaky": Verdict.FLAKY in verdicts or _alternates(judged)}


def _alternates(judged: list[bool]) -> bool:
    """Return whether a test changed between good and bad more than once; a defect that came, or went, does it once."""
    return sum(before is not after for before, after in itertools.pairwise(judged)) > 1


def _rate(judged: list[bool]) -> list[float]:
    """Return the rate of good verdicts, with its 95 % interval; 0 within (0, 1) if nothing was judged."""
    rate = sum(judged) / len(judged) if judged else 0.0
    return [rate, *wilson_interval(sum(judged), len(judged))]


# Measurements --------------------------------------------------------------------------------------------------------


def middles(points: Iterable[Point]) -> dict[int, float]:
    """Return the middle value of each run that has one. Each point begins with its run and its value."""
    values: dict[int, list[float]] = {}
    for run, value, *_ in points:
        if value is not None:
            values.setdefault(run, []).append(value)
    return {run: median(of_a_run) for run, of_a_run in values.items()}


def _measurements(
    points: dict[tuple[str, str, str], list[Point]], units: dict[tuple[str, str, str], str], *, mixed: bool
) -> dict[str, Any]:
    measurements = {"\n".join(key): _measurement(of_one, units[key], mixed=mixed) for key, of_one in points.items()}
    drifts = [item["drift"] for item in measurements.values() if item["drift"] is not None]
    believed = discovery_limit((drift["p"] for drift in drifts), _BELIEVED)
    for drift in drifts:
        drift["believed"] = drift["p"] <= believed and drift["slope"] != 0
    return measurements


def _measurement(points: list[Point], unit: str, *, mixed: bool) -> dict[str, Any]:
    """Return what became of one measurement; runs of several robots are no series in time, and do not drift."""
    runs = [[*of_a_run] for _, of_a_run in itertools.groupby(points, key=lambda point: point[0])]
    verdicts = [{point[4] for point in of_a_run} - {MeasurementVerdict.RECORDED} for of_a_run in runs]
    return {
        "unit": unit,
        "points": [point for of_a_run in runs for point in _thinned(of_a_run)],
        "drift": None if mixed else _drift(points, unit),
        "pass_rate": _rate([MeasurementVerdict.FAILED not in of_a_run for of_a_run in verdicts if of_a_run]),
    }


def _thinned(points: list[Point]) -> list[Point]:
    if len(points) <= _MOST_POINTS:
        return points
    ordered = sorted((point for point in points if point[1] is not None), key=lambda point: point[1] or 0.0)
    return [ordered[0], ordered[len(ordered) // 2], ordered[-1]] if ordered else points[:1]


def _drift(points: list[Point], unit: str) -> dict[str, Any] | None:
    """Return how a run's middle value changes from run to run; None if too few runs have one."""
    values = [middle for middle in middles(points).values() if math.isfinite(middle)]
    if len(values) < _FEWEST:
        return None
    slope, p = theil_sen(values), mann_kendall(values)
    if not math.isfinite(slope):
        return None
    drift = {"slope": slope, "unit": f"{unit or '1'}/run", "p": p, "limit": None, "after": None}
    if slope and p < _BELIEVED:
        _, _, low, high, _ = points[-1]
        drift.update(_reaches(values, slope, low=low, high=high))
    return drift


def _reaches(values: list[float], slope: float, *, low: float | None, high: float | None) -> dict[str, Any]:
    """Return the limit that the line leads to, and the runs until then; nothing if that is too far to tell."""
    limit = high if slope > 0 else low
    if limit is None:
        return {}
    count = len(values)
    now = median([value + slope * (count - 1 - index) for index, value in enumerate(values)])
    ahead = (limit - now) / slope
    near = math.isfinite(ahead) and ahead <= _AHEAD * count
    return {"limit": limit, "after": max(0, math.ceil(ahead)) if near else None}


# Statistics; NumPy is imported when a trend is asked for --------------------------------------------------------------


def theil_sen(values: Sequence[float]) -> float:
    """Return the slope per step of consecutive finite values: the median over all pairs (P. K. Sen, 1968).

    Up to 29 % of the values may be outliers without the slope following them. It is 0 for fewer than two values.
    """
    import numpy as np

    if len(values) < 2:  # noqa: PLR2004 - a slope has two ends
        return 0.0
    steps, differences = _pairs(values)
    with np.errstate(all="ignore"):  # the difference of two of the largest numbers is no number
        return float(np.median(differences / steps))


def mann_kendall(values: Sequence[float]) -> float:
    """Return the two-sided p value of a trend: how likely trendless finite values rise or fall as much as these.

    The normal approximation with ties and continuity correction (H. B. Mann, 1945; M. G. Kendall, Rank Correlation
    Methods, 1975, chapter 4), which is good from ten values on. The values must not depend on each other.
    """
    import numpy as np

    count = len(values)
    _, differences = _pairs(values)
    score = int(np.sign(differences).sum())
    tied = sum(_spread(repeated) for repeated in Counter(values).values())
    variance = (_spread(count) - tied) / 18
    if variance <= 0 or score == 0:
        return 1.0
    return math.erfc((abs(score) - 1) / math.sqrt(2 * variance))


def _pairs(values: Sequence[float]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return for each pair of values their distance in steps and their difference; infinite if that is too large."""
    import numpy as np

    row = np.asarray(values, dtype=float)
    first, second = np.triu_indices(len(row), 1)
    with np.errstate(over="ignore"):
        return second - first, row[second] - row[first]


def _spread(count: int) -> int:
    return count * (count - 1) * (2 * count + 5)


def discovery_limit(p_values: Iterable[float], rate: float = 0.05) -> float:
    """Return the largest p value that may be believed if at most this share of the believed ones may be chance.

    Y. Benjamini and Y. Hochberg, 1995. Of a thousand measurements fifty have a p value below 0.05 by chance alone; this
    keeps them off a list. It is 0 when none may be believed.
    """
    ordered = sorted(p_values)
    believed = [p for rank, p in enumerate(ordered, 1) if p <= rate * rank / len(ordered)]
    return believed[-1] if believed else 0.0
