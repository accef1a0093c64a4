"""What counts as found among the faults of boards that drive motors, and a case. See :mod:`run_can_drives`."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # as for a script
from run_can_battery import Outcome
from run_can_drives import BOARD, CASES, Case, run, wrong

OFF = Case("CanBoards", f"can_bus_off {BOARD}", f"{BOARD} .* does not answer")


@pytest.mark.parametrize(
    ("case", "verdict", "said", "problem"),
    [
        (Case("CanBoards"), "passed", "", ""),
        (Case("CanBoards"), "failed", "a joint is slow", "failed: a joint is slow"),
        (OFF, "failed", f"board {BOARD} (l_hip_roll): it does not answer", ""),
        (OFF, "passed", "", "passed, and does not say"),
        (OFF, "error", f"board {BOARD} (l_hip_roll): it does not answer", "error, and does not say"),
        (OFF, "failed", f"board {BOARD} (l_hip_roll): it does not answer\nleft_leg0:3 is late", "left_leg0:3, too"),
    ],
)
def test_a_fault_is_found_by_its_name_alone(case: Case, verdict: str, said: str, problem: str):
    """A test that fails for another reason, or accuses another board, has not found it."""
    found = wrong(case, Outcome(verdict, [said]))
    assert problem in found
    assert bool(found) == bool(problem)


def test_each_case_has_a_name_of_its_own():
    """They are the names of the tests in the suite."""
    assert len({case.name for case in CASES}) == len(CASES)


def test_an_old_firmware_of_a_drive_is_found(tmp_path: Path):
    """On a leg with such boards."""
    (case,) = [one for one in CASES if one.fault.startswith("can_wrong_firmware")]
    found = run(tmp_path, [case])
    assert not wrong(case, found[case.name])
