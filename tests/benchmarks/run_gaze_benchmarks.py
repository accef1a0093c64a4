"""The gaze controller on the simulated iCub in lockstep: ``python tests/benchmarks/run_gaze_benchmarks.py``.

Angles between the eyes and their point, by the encoders and the tables of the chains, the greater of both eyes: after
motions to random points, and while the torso turns under a gaze that is kept.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from gaze_bench import EYES, SimulatedGaze, random_point

#: How long a gaze settles before it is measured, and how often it is measured while the torso turns (s).
SETTLE, STEP = 0.1, 0.02
#: The torso turns at this speed (deg/s), for this time (s), to one side and back.
SPEED, TURN = 20.0, 1.0
#: After this time (s) it turns evenly; before that it is accelerated.
EVEN = 0.2
TURNS = {"pitch": (1.0, 0.0, 0.0), "roll": (0.0, 1.0, 0.0), "yaw": (0.0, 0.0, 1.0)}
REFLEXES = {"gyroscope": (1.0, 0.0), "no reflex": (0.0, 0.0)}


def row(name: str, values: list[float], unit: str) -> str:
    """A line of the table."""
    return f"{name:<44} {np.median(values):8.3f} {np.percentile(values, 99):8.3f} {max(values):8.3f} {unit}"


def look_around(robot: SimulatedGaze, count: int, generator: np.random.Generator) -> None:
    """Motions to random points, with saccades and without."""
    for saccades in (True, False):
        robot.gaze.set_saccades(saccades)
        errors, times, unended = [], [], 0
        for _ in range(count):
            point = random_point(generator)
            try:
                times.append(robot.look(point))
            except TimeoutError:
                unended += 1
            robot.run(SETTLE)
            errors.append(robot.error(point))
        name = f"{count} points, {'with' if saccades else 'without'} saccades"
        print(row(name, errors, "deg"))
        print(row(f"  motion done ({unended} did not end)", times, "s"))


def turn_under_it(robot: SimulatedGaze, vor: float, ocr: float) -> tuple[list[float], list[float]]:
    """Errors while the torso turns to both sides about each of its axes, and the gaze is kept: evenly, and before."""
    gaze = robot.gaze
    gaze.set_vor_gain(vor)
    gaze.set_ocr_gain(ocr)
    even: list[float] = []
    begins: list[float] = []
    for axis in TURNS.values():
        point = EYES.point_of((5.0, -5.0, 5.0))
        gaze.set_tracking(True)
        robot.look(point)
        robot.run(0.5)
        for sign in (1.0, -1.0):
            for number in range(round(TURN / STEP)):
                robot.turn_torso(np.array(axis) * SPEED * sign)  # boards stop a joint without commands
                robot.run(STEP)
                (even if number * STEP >= EVEN else begins).append(robot.error(point))
        robot.turn_torso((0.0, 0.0, 0.0))
        robot.run(0.5)
        gaze.set_tracking(False)
    return even, begins


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    with SimulatedGaze(given.seed) as robot:
        robot.run(0.2)
        begin = time.process_time()
        print(f"{'':<44} {'median':>8} {'p99':>8} {'max':>8}")
        look_around(robot, given.points, np.random.default_rng(given.seed))
        for name, (vor, ocr) in REFLEXES.items():
            even, begins = turn_under_it(robot, vor, ocr)
            print(row(f"torso at {SPEED:g} deg/s, {name}", even, "deg"))
            print(row(f"  in the first {EVEN:g} s of a turn", begins, "deg"))
        print(f"{time.process_time() - begin:.0f} s of the processor")


if __name__ == "__main__":
    main()
