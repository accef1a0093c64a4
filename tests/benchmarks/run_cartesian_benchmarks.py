"""Reaches of both arms in lockstep: ``python tests/benchmarks/run_cartesian_benchmarks.py [--poses 200]``.

The simulated iCub, started from its configuration, has a Cartesian controller for each arm. It is led to random poses
within reach, by torso and arm together. Errors are those at rest by the encoders and the tables of the robot, from the
target; the margin is the least distance of a joint from a limit on the way, of joints that neither begin nor end there.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from rtf import clock

ROOT = Path(__file__).parents[2]
SUITE = """<suite name="poses">
    <fixture name="names" param="--namespace /poses"> yarpserver </fixture>
    <fixture name="robot" depends="names" param="--config {config}">
        <parameter name="arguments">(--lockstep yes --clock /poses/clock)</parameter> robotinterface </fixture>
    {tests}
</suite>
"""
TEST = """<test name="{arm}" timeout="3600"> <parameter name="arm">{arm}</parameter>
    <parameter name="poses">{poses}</parameter> {file} </test>
"""
ARMS = ("left", "right")
TOUCHED = 0.1  # deg


def run(poses: int, folder: Path) -> dict[str, dict[str, np.ndarray]]:
    """Return the columns of each arm."""
    config = ROOT / "suites" / "robots" / "icubSim" / "icubSim.xml"
    file = Path(__file__).with_name("cartesian_poses.py")
    tests = "".join(TEST.format(arm=arm, poses=poses, file=file) for arm in ARMS)
    (folder / "suite.xml").write_text(SUITE.format(config=config, tests=tests), encoding="utf-8")
    command = [sys.executable, "-m", "rtf.cli.testrunner", "--suite", "suite.xml"]
    subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)
    found = {}
    for arm in ARMS:
        (path,) = {one.resolve() for one in folder.glob(f"rtf-runs/*/**/{arm}/poses.npz")}
        with np.load(path) as columns:
            found[arm] = {name: columns[name] for name in columns}
    return found


def show(arm: str, asked: int, rows: dict[str, np.ndarray]) -> None:
    """Print the table of an arm."""
    done = np.isfinite(rows["duration"])
    touched = int((rows["margin"] <= TOUCHED).sum())
    print(f"{arm} arm: {done.sum()} of {asked} poses done; {touched} reaches touched a limit")
    print(f"  {'':24} {'median':>8} {'p99':>8} {'most':>8}")
    for name, title in (
        ("position", "position error, mm"),
        ("orientation", "orientation error, deg"),
        ("solution", "of the solution, mm"),
        ("duration", "duration, s"),
        ("peak", "peak of the speed / mean"),
        ("speed", "greatest speed, m/s"),
    ):
        values = rows[name][done]
        print(f"  {title:24} {np.median(values):8.3f} {np.percentile(values, 99):8.3f} {values.max():8.3f}")


def main() -> None:
    """Measure both arms."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--poses", type=int, default=200)
    poses = parser.parse_args().poses
    begin = clock.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        found = run(poses, Path(folder))
    for arm, rows in found.items():
        show(arm, poses, rows)
    print(f"{clock.monotonic() - begin:.0f} s")


if __name__ == "__main__":
    main()
