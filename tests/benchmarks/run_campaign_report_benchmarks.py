"""What a report of a campaign takes: ``python tests/benchmarks/run_campaign_report_benchmarks.py``.

*Report*: a file of a campaign with so many runs is read, evaluated and written as page, JSON and tables; 10 000 in at
most 30 s. *History*: trends over a history with so many rows of measurements; 100 000 in at most 1 s. The rows are
simulated and nothing is run. Seconds are those of the processor, as other programs may be at work; the clock's are
beside them. It ends with an error if a limit is not kept.
"""

from __future__ import annotations

import argparse
import os
import random
import resource
import sys
import tempfile
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rtf import clock
from rtf.campaigns.report.files import write_json, write_page, write_tables
from rtf.campaigns.report.summary import make_report
from rtf.campaigns.store import CampaignStore, outcomes_of
from rtf.campaigns.tasks import FaultValues, Task, to_json
from rtf.testing.history import History, StoredRun, trends

if TYPE_CHECKING:
    from collections.abc import Iterator

MOST_REPORT, MOST_HISTORY = 30.0, 1.0
TESTS, FAULTS, MEASUREMENTS, UNITS, ROWS = 10, 8, 20, 20, 100
LIMITS = (-4.0, 4.0)
SEVERITIES = (0.125, 0.25, 0.5, 1.0, 2.0, 4.0)


@dataclass
class Taken:
    """Seconds of the processor and of the clock."""

    processor: float = 0.0
    wall: float = 0.0

    def __str__(self) -> str:
        return f"{self.processor:.2f} s of the processor, {self.wall:.2f} s by the clock"


def main() -> int:
    """Measure and print; returns 1 if a limit is not kept."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=10_000, help="runs of the campaign")
    parser.add_argument("--rows", type=int, default=100_000, help="rows of measurements in the history")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        report = measure_report(Path(name), options.runs)
        histories = measure_history(Path(name), options.rows)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"report of {options.runs} runs: {report}, {memory:.0f} MiB")
    for name, taken in histories.items():
        print(f"{options.rows} rows of history, {name}: {taken}")
    kept = report.processor <= MOST_REPORT and all(one.processor <= MOST_HISTORY for one in histories.values())
    return 0 if kept else 1


@contextmanager
def measured() -> Iterator[Taken]:
    """Measure the block."""
    taken, processor, wall = Taken(), sum(os.times()[:2]), clock.monotonic()
    yield taken
    taken.processor, taken.wall = sum(os.times()[:2]) - processor, clock.monotonic() - wall


def measure_report(folder: Path, runs: int) -> Taken:
    """Write a file of so many runs, and measure all that its report takes."""
    path = folder / "campaign.sqlite"
    write_campaign(path, runs)
    with measured() as taken:
        outcomes = [*outcomes_of(path)]
        report = make_report(outcomes, "benchmark", budget=300.0)
        write_page(folder / "report.html", report)
        write_json(folder / "report.json", report)
        write_tables(folder / "tables", report, outcomes)
    assert report.size.runs == runs
    return taken


def write_campaign(path: Path, runs: int) -> None:
    """Write tasks that are done, and their runs: four of five with a fault."""
    drawn = random.Random(1)
    with CampaignStore(path, create=True) as store, store.transaction():
        for number in range(runs):
            test, severity = f"Test{number % TESTS}", drawn.choice(SEVERITIES)
            kind = f"kind_{number // TESTS % FAULTS}"
            fault = FaultValues(kind, "elbow", severity=severity) if number % 5 else None
            task = Task(test=test, model="bench", unit=number % UNITS, seed=number, fault=fault)
            failed = fault is not None and drawn.random() < severity / (1.0 + severity)
            run = record(store, number, f"campaign/{test}", drawn, failed=failed)
            store._connection.execute(
                "INSERT INTO tasks (key, task, robot, state, attempts, detail, run) "
                "VALUES (?, ?, '', 'done', 0, '', ?)",
                (task.key, to_json(task).decode(), run),
            )


def record(
    history: History, number: int, test: str, drawn: random.Random, *, failed: bool, rows: int = MEASUREMENTS
) -> int:
    """Add a run with one test."""
    verdict = "failed" if failed else "passed"
    run = StoredRun(
        f"run-{number}", "", 1e9 + number, 1e9 + number + 2.0, 2.0, verdict, int(failed), f"bench-unit{number % UNITS}",
        "", "0", number, "", "", "[]",
    )  # fmt: skip
    return history.record(
        run,
        [(test, test, "campaign", verdict, verdict, 1, 2.0, "", 1.0, "elbow" if failed else None)],
        [
            (
                test,
                f"joint {row % 10}",
                f"value {row}",
                0,
                drawn.gauss(0.0, 1.0),
                None,
                "deg",
                -4.0,
                4.0,
                None,
                "passed",
            )
            for row in range(rows)
        ],
    )


def measure_history(folder: Path, rows: int) -> dict[str, Taken]:
    """Write a history of so many rows, and measure queries of one measurement and of all."""
    path, drawn = folder / "history.sqlite", random.Random(2)
    with History(path, create=True) as history, history.transaction():
        for number in range(rows // ROWS):
            record(history, number, "suite/test", drawn, failed=False, rows=ROWS)
    found = {}
    with History(path) as history:
        for name, names in (("one measurement", ["value 7"]), ("all", [])):
            with measured() as taken:
                shown = trends(history, names=names, robot="*", station="*", last=rows)
            assert len(shown["runs"]) == rows // ROWS
            found[name] = taken
    return found


if __name__ == "__main__":
    sys.exit(main())
