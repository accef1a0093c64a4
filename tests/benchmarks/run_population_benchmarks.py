"""Count the false alarms of tests on different healthy robots.

``python tests/benchmarks/run_population_benchmarks.py --folder DIR --units 1-20``

Each unit of the population (:mod:`rtf.simulator.units`) runs the suites once, in lockstep. A test that fails there, or
ends with an error, blames a healthy robot. The table has the rate of each such test with its confidence interval of
95 %. Units whose runs are in the folder are not run again.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path
from statistics import NormalDist
from typing import NamedTuple

from measuring import TESTRUNNER

from rtf.testing import journal
from rtf.testing.events import RunEnded
from rtf.testing.results import RunResult
from rtf.testing.verdict import Verdict

BATTERY = Path(__file__).parents[2] / "suites" / "icubSim" / "battery.xml"
ALARMS = (Verdict.FAILED, Verdict.ERROR)
_CONFIDENCE = 0.95


class Outcome(NamedTuple):
    """What a test came to on a unit."""

    verdict: Verdict
    detail: str


def main(arguments: list[str] | None = None) -> int:
    """Run the units one after the other, and print the table; 1 if there was a false alarm."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, required=True, help="where the runs are kept")
    parser.add_argument("--units", type=_range, default=range(1, 21), metavar="A-B", help="default: 1-20")
    parser.add_argument("--suite", type=Path, default=BATTERY, help="default: the battery of the iCub")
    parser.add_argument("--define", action="append", default=[], metavar="NAME=VALUE", help="a variable of the suite")
    options = parser.parse_args(arguments)
    options.folder.mkdir(parents=True, exist_ok=True)
    defines = [word for pair in options.define for word in ("--define", pair)]
    units = {unit: run_unit(options.folder, options.suite, unit, defines) for unit in options.units}
    print(table(units))
    return int(any(one.verdict in ALARMS for tests in units.values() for one in tests.values()))


def _range(text: str) -> range:
    first, _, last = text.partition("-")
    return range(int(first), int(last or first) + 1)


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


def run_unit(folder: Path, suite: Path, unit: int, defines: list[str]) -> dict[str, Outcome]:
    """Run a unit, unless that has been done; return the outcomes of its tests."""
    run = folder / f"unit{unit:03}"
    if not (found := _read(run)):
        own = folder / f"unit{unit:03}.xml"
        own.write_text(suite_of_unit(suite, unit, folder), encoding="utf-8")
        words = [*TESTRUNNER, "--suite", str(own), "--run-folder", str(run), "--answer", "default", *defines]
        with run.with_suffix(".txt").open("wb") as output:
            subprocess.run(words, stdout=output, stderr=subprocess.STDOUT, check=False)
        found = _read(run)
    if not found:
        raise SystemExit(f"the run of unit {unit} has no end; see {run.with_suffix('.txt')}")
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
    return {
        name: Outcome(result.verdict or Verdict.NOT_RUN, result.last.detail if result.last is not None else "")
        for name, result in results.tests.items()
    }


def interval(alarms: int, runs: int) -> tuple[float, float]:
    """Return the confidence interval of a rate by Wilson, which also holds for a rate of 0."""
    z = NormalDist().inv_cdf(0.5 + _CONFIDENCE / 2)
    rate, scale = alarms / runs, 1 + z * z / runs
    centre = (rate + z * z / (2 * runs)) / scale
    half = z * (rate * (1 - rate) / runs + z * z / (4 * runs * runs)) ** 0.5 / scale
    return max(0.0, centre - half), min(1.0, centre + half)


def table(units: dict[int, dict[str, Outcome]]) -> str:
    """Return the table of docs/healthy.md: the tests with false alarms, and all together."""
    runs, alarms, unsure = Counter[str](), Counter[str](), Counter[str]()
    for tests in units.values():
        for name, one in tests.items():
            runs[name.partition("/")[2]] += 1
            alarms[name.partition("/")[2]] += one.verdict in ALARMS
            unsure[name.partition("/")[2]] += one.verdict is Verdict.INCONCLUSIVE
    lines = ["| test | units | false alarms | rate | 95 % interval | inconclusive |", "| --- " * 6 + "|"]
    lines += [_row(name, runs[name], alarms[name], unsure[name]) for name in runs if alarms[name] or unsure[name]]
    return "\n".join([*lines, _row("all", runs.total(), alarms.total(), unsure.total())])


def _row(name: str, runs: int, alarms: int, unsure: int) -> str:
    low, high = interval(alarms, runs)
    return f"| {name} | {runs} | {alarms} | {alarms / runs:.2%} | {low:.2%} to {high:.2%} | {unsure} |"


if __name__ == "__main__":
    sys.exit(main())
