"""Count the false alarms of tests on different healthy robots.

``python tests/benchmarks/run_population_benchmarks.py --folder DIR --units 1-20``

Each unit of the population (:mod:`rtf.simulator.units`) runs the suites once, in lockstep. A test that fails there, or
ends with an error, blames a healthy robot. The table has the false alarms of each test with the confidence interval of
95 % of their rate, and the stops of the guard. Units whose runs are in the folder are not run again.
"""

from __future__ import annotations

import argparse
import math
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from measuring import TESTRUNNER

from rtf.cli.proof import range_of_units
from rtf.testing import journal
from rtf.testing.events import Message, RunEnded
from rtf.testing.results import RunResult
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Callable

BATTERY = Path(__file__).parents[2] / "suites" / "icubSim" / "battery.xml"
ALARMS = (Verdict.FAILED, Verdict.ERROR)
#: What says nothing about a robot: on a machine that is too busy a simulator may not begin in time.
NOT_RUN = (Verdict.BLOCKED, Verdict.NOT_RUN)
_CONFIDENCE, _EXACT = 0.95, 1e-9
#: How the guard says that it had to stop a motion.
_STOPPED = re.compile(r"; it was (stopped|released|held)")


class Outcome(NamedTuple):
    """What a test came to on a unit, and how often the guard had to stop a motion in it."""

    verdict: Verdict
    detail: str
    stops: int = 0


def main(arguments: list[str] | None = None) -> int:
    """Run the units one after the other, and print the table; 1 if there was a false alarm."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, required=True, help="where the runs are kept")
    parser.add_argument("--units", type=range_of_units, default=range(1, 21), metavar="A-B", help="default: 1-20")
    parser.add_argument("--suite", type=Path, default=BATTERY, help="default: the battery of the iCub")
    parser.add_argument("--define", action="append", default=[], metavar="NAME=VALUE", help="a variable of the suite")
    parser.add_argument("-k", dest="chosen", default="", metavar="EXPRESSION", help="tests whose name matches")
    options = parser.parse_args(arguments)
    options.folder.mkdir(parents=True, exist_ok=True)
    words = [word for pair in options.define for word in ("--define", pair)]
    words += ["-k", options.chosen] if options.chosen else []
    units = {unit: run_unit(options.folder, options.suite, unit, words) for unit in options.units}
    print(table(units))
    return int(any(one.verdict in ALARMS for tests in units.values() for one in tests.values()))


def suite_of_unit(suite: Path, unit: int, folder: Path) -> str:
    """Return a suite whose simulators simulate a unit, for a file in a folder."""
    root = ET.fromstring(suite.read_text(encoding="utf-8"))
    for fixture in root.iter("fixture"):
        if (fixture.text or "").strip() == "simulator":
            words = fixture.get("param", "").replace("--unit ${unit}", "")
            fixture.set("param", f"{words} --unit {unit}".strip())
    for include in root.iter("include"):
        include.text = os.path.relpath(suite.parent / (include.text or "").strip(), folder)
    return ET.tostring(root, encoding="unicode")


def run_unit(folder: Path, suite: Path, unit: int, options: list[str]) -> dict[str, Outcome]:
    """Run a unit with options of the runner, unless that has been done; return the outcomes of its tests."""
    run = folder / f"unit{unit:03}"
    if not (found := _read(run)):
        own = folder / f"unit{unit:03}.xml"
        own.write_text(suite_of_unit(suite, unit, folder), encoding="utf-8")
        words = [*TESTRUNNER, "--suite", str(own), "--run-folder", str(run), "--answer", "default", *options]
        with run.with_suffix(".txt").open("wb") as output:
            subprocess.run(words, stdout=output, stderr=subprocess.STDOUT, check=False)
        found = _read(run)
    if not found:
        raise SystemExit(f"the run of unit {unit} has no end; see {run.with_suffix('.txt')}")
    if any(one.verdict in NOT_RUN for one in found.values()):
        raise SystemExit(f"tests of unit {unit} were not run; see {run.with_suffix('.txt')}, and remove {run}")
    alarms = [f"{name}: {one.detail.splitlines()[0]}" for name, one in found.items() if one.verdict in ALARMS]
    print("\n    ".join([f"unit {unit}: {len(found)} tests, {len(alarms)} false alarms", *alarms]), flush=True)
    return found


def _read(folder: Path) -> dict[str, Outcome]:
    """Return the outcomes of the tests of a run; none of one that has not ended."""
    if not (folder / journal.FILE_NAME).exists():
        return {}
    events = list(journal.read(folder))
    if not any(isinstance(event, RunEnded) for event in events):
        return {}
    results = RunResult.of(events)
    stops = Counter(one.test for one in events if isinstance(one, Message) and _STOPPED.search(one.detail))
    return {
        name: Outcome(
            result.verdict or Verdict.NOT_RUN, result.last.detail if result.last is not None else "", stops[name]
        )
        for name, result in results.tests.items()
    }


def interval(alarms: int, runs: int) -> tuple[float, float]:
    """Return the exact confidence interval of a rate by Clopper and Pearson (1934).

    Its bounds are the rates with which so many alarms, or more, and so many, or fewer, have half of the risk each.
    """
    risk = (1.0 - _CONFIDENCE) / 2
    low = _rate(lambda rate: 1.0 - _at_most(alarms - 1, runs, rate) <= risk) if alarms else 0.0
    high = _rate(lambda rate: _at_most(alarms, runs, rate) >= risk) if alarms < runs else 1.0
    return low, high


def _at_most(alarms: int, runs: int, rate: float) -> float:
    """Return the probability of no more than so many alarms."""
    return sum(math.comb(runs, one) * rate**one * (1.0 - rate) ** (runs - one) for one in range(alarms + 1))


def _rate(holds: Callable[[float], bool]) -> float:
    """Return the greatest rate for which something holds that holds for small ones, to 1e-9."""
    low, high = 0.0, 1.0
    while high - low > _EXACT:
        middle = (low + high) / 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def table(units: dict[int, dict[str, Outcome]]) -> str:
    """Return the table of docs/healthy.md: each test, and all together; ``stops`` are those of the guard."""
    of_tests: dict[str, list[Outcome]] = {}
    for tests in units.values():
        for name, one in tests.items():
            if one.verdict not in (Verdict.NOT_RUN, Verdict.SKIPPED):
                of_tests.setdefault(name.partition("/")[2], []).append(one)
    lines = ["| test | runs | false alarms | rate, 95 % interval | inconclusive | stops |", "| --- " * 6 + "|"]
    lines += [_row(name, outcomes) for name, outcomes in of_tests.items()]
    return "\n".join([*lines, _row("all", [one for outcomes in of_tests.values() for one in outcomes])])


def _row(name: str, outcomes: list[Outcome]) -> str:
    alarms = sum(one.verdict in ALARMS for one in outcomes)
    unsure = sum(one.verdict is Verdict.INCONCLUSIVE for one in outcomes)
    low, high = interval(alarms, len(outcomes))
    stops = sum(one.stops for one in outcomes)
    return f"| {name} | {len(outcomes)} | {alarms} | {low:.1%} to {high:.1%} | {unsure} | {stops} |"


if __name__ == "__main__":
    sys.exit(main())
