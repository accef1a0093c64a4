"""``rtf proof`` runs real tests on simulated robots, writes the matrix, and says whether the claims hold.

It runs the claims of a few tests only. All tests run in ``tests/icub_tests``, on a healthy robot and with faults.
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
#: The tests whose fast cases have faults, or sizes of faults, that ``tests/icub_tests`` does not have.
PROVED_HERE = ("ControlModes", "FtSensorTest", "JointSweep")


@pytest.mark.timeout(400)
def test_the_claims_hold(tmp_path: Path):
    """Faults are found and named, on two robots at the same time; a resumed proof has the cases selected first."""
    proof = [sys.executable, "-m", "rtf", "proof"]
    words = ["--fast", "-j", "2", *(word for name in PROVED_HERE for word in ("--test", name))]
    cases = [case for claims in CLAIMS if claims.test in PROVED_HERE for case in cases_of(claims, fast=True)]
    for more in (words, ["--resume", "-j", "1"]):
        done = subprocess.run([*proof, *more], cwd=tmp_path, capture_output=True, text=True, timeout=390, check=False)
        assert done.returncode == 0, done.stdout[-5000:] + done.stderr
        assert done.stdout.splitlines()[-1] == f"PROOF PASSED  all {len(cases)} claims hold"
    folder = tmp_path / "rtf-runs" / "proof"
    kinds = [event.kind for event in journal.read(folder / "run") if isinstance(event, SuiteStarted | SuiteEnded)]
    assert kinds[:2] == ["suite_started", "suite_started"]
    matrix = (folder / "proof.md").read_text()
    assert [case.name for case in cases if case.fault and f"| {case.fault} |" not in matrix] == []
    assert "| ft_bias | sensor | FtSensorTest |" in matrix


def test_every_test_of_the_robot_takes_part():
    """Each shipped test has claims, but those that test computers and files, which no fault of a robot changes."""
    others = {"cluster_tests", "models_consistency", "skin_wrapper_test", "system_status"}
    assert {claims.file.stem for claims in CLAIMS} == {
        file.stem for file in shipped_folder("test").glob("*.py")
    } - others
    assert len(TESTS) == len(CLAIMS)
