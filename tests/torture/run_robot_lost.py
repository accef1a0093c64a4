"""Lose the robot in the middle of each robot test: ``python tests/torture/run_robot_lost.py [TEST …]``.

The simulator is killed, frozen, slowed and made to stutter while a test runs, at random moments. A test under which the
robot was lost is *fixture lost*, one under which it was only slow has the verdict that it has without that, and the
test that comes next finds a healthy robot. A strike that missed, as the test had ended before, is tried again sooner.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))  # the helpers that all tests share

from robot_lost import STRIKES, Finding, Subject, findings

_TORSO = {"part": "torso"}
_PARTS = (
    *("ControlModes", "MotorTest", "MovementReferencesTest", "OpenLoopConsistency", "PositionDirect"),
    *("PositionControlAccuracy", "TorqueControlAccuracy", "TorqueControlConsistency"),
    *("TorqueControlGravityConsistency", "TorqueControlStiffDampCheck", "MotorEncodersSignCheck"),
    *("OpticalEncodersConsistency", "OpticalEncodersDrift", "JointLimits", "MotorStiction", "position-stress"),
)
_OTHERS = ("FtSensorTest", "Imu", "models-consistency", "SkinWrapperTest", "PortsFrequency", "SensorsDuplicateReadings")
SUBJECTS = (
    *(Subject(test, _TORSO) for test in _PARTS),
    Subject("PositionControlAccuracyExternalPid", {"part": "left_arm"}),
    *(Subject(test) for test in _OTHERS),
    Subject("CameraTest", simulator={"cameras": "yes"}),
    Subject("SystemStatus"),
    Subject("cluster-tests", {"hosts": "(pc104)"}),
)


def main(arguments: list[str] | None = None) -> int:
    """Strike each test as the arguments say. Returns 0 when all findings are as expected, 1 otherwise."""
    options = _options(arguments)
    subjects = [subject for subject in SUBJECTS if not options.tests or subject.test in options.tests]
    wrong = missed = done = 0
    with tempfile.TemporaryDirectory(prefix="rtf-lost-") as own, ThreadPoolExecutor(options.jobs) as pool:
        folder = options.folder or Path(own)
        strikes = options.strike or [*STRIKES]
        running = [
            pool.submit(
                findings, folder / subject.test / f"round{number}", subject, strikes, f"{options.seed} {number}"
            )
            for subject in subjects
            for number in range(options.rounds)
        ]
        for future in as_completed(running):
            for finding in future.result():
                print(line(finding), flush=True)
                done += 1
                missed += finding.missed
                wrong += bool(finding.wrong)
    verdict = "FAILED" if wrong or not done else "PASSED"
    print(f"ROBOT LOST {verdict}  {done} strikes at {len(subjects)} tests: {wrong} came out wrong, {missed} missed")
    return int(verdict == "FAILED")


def _options(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Lose the robot in the middle of each robot test.")
    known = [subject.test for subject in SUBJECTS]
    parser.add_argument("tests", nargs="*", metavar="TEST", help="only these tests (default: all)")
    parser.add_argument("--strike", action="append", choices=[*STRIKES], help="only this one; may be repeated")
    parser.add_argument("--rounds", type=int, default=1, help="how often each test is struck in each way (default: 1)")
    parser.add_argument("--seed", type=int, default=1, help="where the random moments begin (default: 1)")
    parser.add_argument("-j", "--jobs", type=int, default=1, help="tests at a time (default: 1)")
    parser.add_argument("--folder", type=Path, help="a new folder in which the runs are kept (default: they are not)")
    options = parser.parse_args(arguments)
    unknown = {*options.tests} - {*known}
    if unknown:
        parser.error(f"there is no {', '.join(sorted(unknown))}; there are {', '.join(known)}")
    return options


def line(finding: Finding) -> str:
    """Return the lines that people read about a finding."""
    what = f"{finding.subject:36} {finding.strike:8} {finding.moment:6.2f} of {finding.duration:6.2f} s"
    if finding.missed:
        return f"{what}  missed: the test had ended"
    came = f"{finding.healthy} -> {finding.verdict}"
    times = f"ended after {finding.stopped_after:5.2f} s, next after {finding.back_after:5.2f} s"
    return "\n    WRONG: ".join([f"{what}  {came:24} {times}", *finding.wrong])


if __name__ == "__main__":
    sys.exit(main())
