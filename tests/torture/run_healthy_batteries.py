"""Run the battery again and again on a healthy robot: ``python tests/torture/run_healthy_batteries.py --folder DIR``.

No test may fail or be an error, however busy the machine is: each such verdict is a false alarm. Inconclusive tests are
counted and listed: such a test has seen that the machine did not keep up. In lockstep the tests that have not measured
the same to the last bit each time are listed, too. With a folder, batteries that are complete are not run again, so
that the program may be interrupted; an incomplete battery is run anew.
"""

from __future__ import annotations

import argparse
import hashlib
import shutil
import subprocess
import sys
from collections import Counter, defaultdict
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rtf.testing import journal
from rtf.testing.events import Measured, RunEnded
from rtf.testing.results import RunResult
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Iterable

_SUITES = Path(__file__).parents[2] / "suites" / "icubSim"
#: Verdicts that are no alarm.
_SILENT = (Verdict.PASSED, Verdict.MEASURED, Verdict.SKIPPED, Verdict.INCONCLUSIVE)
_BUSY = "while True: sum(range(10000))"


class Battery(NamedTuple):
    """The result of a battery: its folder, the tests of each verdict, and a digest of what each test measured."""

    folder: Path
    counts: Counter[str]
    alarms: list[str]
    unsure: list[str]
    seconds: float
    digests: dict[str, str]


def main(arguments: list[str] | None = None) -> int:
    """Run the batteries. Returns 0 when no battery has an alarm, 1 otherwise."""
    options = _options(arguments)
    suite = options.suite or _SUITES / ("realtime.xml" if options.realtime else "battery.xml")
    batteries: list[Battery] = []
    with ExitStack() as busy:
        for _ in range(options.busy):
            program = busy.enter_context(subprocess.Popen([sys.executable, "-c", _BUSY]))
            busy.callback(program.kill)
        pool = busy.enter_context(ThreadPoolExecutor(options.at_once))
        running = [
            pool.submit(battery, options.folder / f"battery{number:02}", suite) for number in range(options.count)
        ]
        for future in as_completed(running):
            batteries.append(future.result())
            print(f"{len(batteries):3} of {options.count}  {line(batteries[-1])}", flush=True)
    if not options.realtime:
        print("\n".join(different(batteries)))
    alarms, unsure = (sum(len(getattr(one, name)) for one in batteries) for name in ("alarms", "unsure"))
    clean = sum(not one.alarms for one in batteries)
    verdict = "PASSED" if clean == len(batteries) == options.count else "FAILED"
    print(
        f"HEALTHY BATTERIES {verdict}  {clean} of {options.count} without a false alarm "
        f"({'in real time' if options.realtime else 'in lockstep'}); {alarms} alarms, {unsure} inconclusive"
    )
    return int(verdict == "FAILED")


def _options(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Run the battery again and again on a healthy simulated robot.")
    parser.add_argument("--folder", type=Path, required=True, help="where the runs are kept; those in it are not run")
    parser.add_argument("--count", type=int, default=20, help="how many batteries (default: 20)")
    parser.add_argument("--at-once", type=int, default=2, help="how many at a time (default: 2)")
    parser.add_argument("--busy", type=int, default=0, help="programs that only keep the machine busy (default: 0)")
    parser.add_argument("--realtime", action="store_true", help="at a real robot's pace, and not in lockstep")
    parser.add_argument("--suite", type=Path, help="another suite than the battery")
    return parser.parse_args(arguments)


def battery(folder: Path, suite: Path) -> Battery:
    """Run one battery unless its folder is complete, and return its result."""
    if not (found := _read(folder)):
        shutil.rmtree(folder, ignore_errors=True)
        folder.parent.mkdir(parents=True, exist_ok=True)
        words = [sys.executable, "-m", "rtf.cli.testrunner", "--suite", str(suite), "--run-folder", str(folder)]
        with folder.with_suffix(".txt").open("wb") as output:
            subprocess.run(words, stdout=output, stderr=subprocess.STDOUT, check=False)
        found = _read(folder)
    if not found:
        raise SystemExit(f"{folder}: the run has no end; see {folder.with_suffix('.txt')}")
    return found


def _read(folder: Path) -> Battery | None:
    """Return a battery from its journal, or None if it is incomplete."""
    if not (folder / journal.FILE_NAME).exists():
        return None
    results, ended = RunResult(), None
    measured: defaultdict[str, hashlib._Hash] = defaultdict(hashlib.sha256)
    for event in journal.read(folder):
        results.apply(event)
        if isinstance(event, RunEnded):
            ended = event
        elif isinstance(event, Measured):
            measured[event.test].update(f"{event.subject} {event.name} {event.value!r}\n".encode())
    if ended is None:
        return None
    of = {test: result.verdict or Verdict.NOT_RUN for test, result in results.tests.items()}
    return Battery(
        folder,
        Counter(verdict.value for verdict in of.values()),
        [f"{test}: {verdict.value}" for test, verdict in of.items() if verdict not in _SILENT],
        [test for test, verdict in of.items() if verdict is Verdict.INCONCLUSIVE],
        sum(result.duration for result in results.tests.values()),
        {test: digest.hexdigest() for test, digest in measured.items()},
    )


def line(one: Battery) -> str:
    """Return the lines that people read about a battery."""
    counts = ", ".join(f"{number} {verdict}" for verdict, number in sorted(one.counts.items()))
    said = [f"ALARM {alarm}" for alarm in one.alarms] + [f"inconclusive: {test}" for test in one.unsure]
    return "\n        ".join([f"{one.folder.name}: {counts} in {one.seconds / 60:.1f} min of tests", *said])


def different(batteries: Iterable[Battery]) -> list[str]:
    """Return a line for each test that has not measured the same each time; the last line has the counts."""
    values: defaultdict[str, set[str]] = defaultdict(set)
    for one in batteries:
        for test, digest in one.digests.items():
            values[test].add(digest)
    lines = [f"not the same each time: {test} ({len(found)} ways)" for test, found in values.items() if len(found) > 1]
    return [*lines, f"{len(values) - len(lines)} of {len(values)} tests have measured the same each time"]


if __name__ == "__main__":
    sys.exit(main())
