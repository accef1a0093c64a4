"""Measure how long the robot tests take: ``python tests/benchmarks/run_robot_test_benchmarks.py``.

Each is one run of the command itself in lockstep, from its start to its end, with the simulated robot that it starts.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

from measuring import TESTRUNNER

from rtf import clock
from rtf.cli.demo import BATTERY

SUITES = Path(__file__).parents[2] / "suites" / "icubSim"
DRIFT = """<suite name="drift">
    <fixture name="names"> yarpserver </fixture>
    <fixture name="robot" depends="names"> simulator </fixture>
    <test name="drift" timeout="600">
        <parameter name="part">torso</parameter> <parameter name="cycles">{swings}</parameter> OpticalEncodersDrift
    </test>
</suite>
"""


class Job(NamedTuple):
    """What is run, and in how many seconds it is to be over."""

    arguments: tuple[str, ...]
    goal: float


def jobs(folder: Path, swings: int) -> dict[str, Job]:
    """All of them by name. The suite of the third is written to the folder in which they are run."""
    battery = [word for name in BATTERY for word in ("--suite", str(SUITES / f"{name}.xml"))]
    (folder / "drift.xml").write_text(DRIFT.format(swings=swings), encoding="utf-8")
    return {
        "four": Job((*TESTRUNNER, "--suite", str(SUITES / "four.xml")), 60.0),
        "battery": Job((*TESTRUNNER, *battery, "--jobs", "2", "--answer", "default"), 240.0),
        "drift": Job((*TESTRUNNER, "--suite", "drift.xml"), 120.0),
        "proof": Job((sys.executable, "-m", "rtf", "proof", "--fast", "-j", "2"), 120.0),
    }


def main(arguments: list[str] | None = None) -> int:
    """Run what was asked for, in a folder that is gone afterwards; 1 if a run has failed."""
    parser = argparse.ArgumentParser(description="How long the robot tests take; all of them some six minutes.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="four, battery, drift, proof (default: all)")
    parser.add_argument("--swings", type=int, default=1000, help="half-swings of the torso for drift")
    options = parser.parse_args(arguments)
    failed = 0
    with tempfile.TemporaryDirectory(prefix="rtf-benchmark-") as folder:
        known = jobs(Path(folder), options.swings)
        for name in options.names or known:
            began = clock.monotonic()
            ran = subprocess.run(known[name].arguments, cwd=folder, capture_output=True, text=True, check=False)
            took = clock.monotonic() - began
            verdict = (ran.stdout.strip().splitlines() or ran.stderr.strip().splitlines() or ["nothing was said"])[-1]
            print(f"  {name:<8} {took:6.1f} s   goal: {known[name].goal:.0f} s   {verdict}", flush=True)
            failed |= ran.returncode != 0
    return failed


if __name__ == "__main__":
    sys.exit(main())
