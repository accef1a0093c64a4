"""The fast part of the proof, by the command itself: the tests with a fault that is soon found.

It is also where the command is seen to run real tests, to write the matrix, and to say that the claims hold. That the
other tests pass on a healthy robot is a test of their own in ``tests/icub_tests``.
"""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from rtf.robot_testing.proof import cases_of, read_claims
from rtf.testing import journal
from rtf.testing.events import SuiteEnded, SuiteStarted
from rtf.testing.plugins import shipped_folder

if TYPE_CHECKING:
    from pathlib import Path

CLAIMS = [read_claims(file) for file in sorted((shipped_folder("test") / "claims").glob("*.toml"))]
TESTS = [claims.test for claims in CLAIMS if [*cases_of(claims, fast=True)]]
WITH_FAULTS = [claims.test for claims in CLAIMS if len([*cases_of(claims, fast=True)]) > 1]


@pytest.mark.timeout(800)
def test_the_claims_hold(tmp_path: Path):
    """Claimed faults are found and named, the healthy robot passes, and the matrix has all cases."""
    words = [sys.executable, "-m", "rtf", "proof", "--fast", "-j", "1", "--folder", str(tmp_path / "proof")]
    words += [word for name in WITH_FAULTS for word in ("--test", name)]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=790, check=False)
    assert done.returncode == 0, done.stdout[-5000:] + done.stderr
    assert done.stdout.splitlines()[-1].startswith("PROOF PASSED")
    matrix = (tmp_path / "proof" / "proof.md").read_text()
    assert [name for name in WITH_FAULTS if f"| {name} |" not in matrix] == []
    assert "| duplicate | network | SensorsDuplicateReadings |" in matrix


@pytest.mark.timeout(200)
def test_two_robots_are_tested_at_the_same_time(tmp_path: Path):
    """Each in a queue of its own; a resumed proof keeps its cases, whatever is selected then."""
    proof = [sys.executable, "-m", "rtf", "proof"]
    words = ["-j", "2", "--test", "SensorsDuplicateReadings"]
    for more in (words, ["--resume", "-j", "1"]):
        done = subprocess.run([*proof, *more], cwd=tmp_path, capture_output=True, text=True, timeout=95, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        assert done.stdout.splitlines()[-1] == "PROOF PASSED  all 9 claims hold"
    events = [*journal.read(tmp_path / "rtf-runs" / "proof" / "run")]
    told = [event.kind for event in events if isinstance(event, SuiteStarted | SuiteEnded)]
    assert told[:4] == ["suite_started", "suite_started", "suite_ended", "suite_ended"]


def test_every_test_of_the_robot_takes_part():
    """The other tests are about computers and files, which no fault of a robot changes."""
    others = {"cluster_tests", "models_consistency", "skin_wrapper_test", "system_status"}
    assert {claims.file.stem for claims in CLAIMS} == {
        file.stem for file in shipped_folder("test").glob("*.py")
    } - others
    assert len(TESTS) == len(CLAIMS)
