"""Faults of buses and of boards that drive motors: ``python tests/torture/run_can_drives.py``.

The claims of the tests ``CanBusLoad``, ``CanBoards`` and ``CanTimeouts`` are on boards of joints. Here they are run on
a leg of the simulated iCub whose motors have boards of their own: on the healthy leg, and with each fault. A fault is
found if a test fails, and says what is wrong, and of which bus or board; and no other board may be accused.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from run_can_battery import Outcome, outcomes

from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

PART = "left_leg"
BUS, BOARD = f"{PART}0", f"{PART}0:2"
_MOVING = "delay=1.2 duration=1"


class Case(NamedTuple):
    """A test, the fault that the robot has, and what the test must say; nothing of a healthy robot."""

    test: str
    fault: str = ""
    said: str = ""

    @property
    def name(self) -> str:
        """The name of the case in the suite."""
        return f"{self.test}-{self.fault.partition(' ')[0] or 'healthy'}-{'moving' if _MOVING in self.fault else 'all'}"


CASES = (
    Case("CanBusLoad"),
    Case("CanBoards"),
    Case("CanTimeouts"),
    Case("CanBusLoad", f"can_frames_lost {BUS} delay=0.3", rf"{BUS}:\d .*% of the expected frames"),
    Case("CanBusLoad", f"can_frames_duplicated {BUS} delay=0.3", f"{BUS} .* frames come twice"),
    Case("CanBusLoad", f"can_frames_reordered {BUS} delay=0.3", f"{BUS} .* frames are overtaken"),
    Case("CanBusLoad", f"can_frames_delayed {BUS} delay=0.3", rf"{BUS}:\d .* answers late"),
    Case("CanBusLoad", f"can_identifier_damaged {BUS} share=0.01 delay=0.3", f"{BUS} frames come from nobody"),
    Case("CanBusLoad", f"can_babbling {BUS} delay=0.3", f"{BUS} is too busy; identifier 0x1ff"),
    Case("CanBusLoad", f"can_termination {BUS} delay=0.3", f"{BUS}, .* error_frames"),
    Case("CanBoards", f"can_bus_off {BOARD}", f"{BOARD} .* does not answer"),
    Case("CanBoards", f"can_bus_off {BOARD} {_MOVING}", f"{BOARD} .* falls silent"),
    Case("CanBoards", f"can_same_address {BOARD} {_MOVING}", f"{BOARD} .* another board with the same address"),
    Case("CanBoards", f"can_board_reset {BOARD} delay=1.2", f"{BOARD} .* it was reset"),
    Case("CanBoards", f"can_wrong_firmware {BOARD}", f"{BOARD} .* its firmware is 2.5.0"),
    Case("CanBoards", f"can_settings_ignored {BOARD}", f"{BOARD} .* does not take a new set_current_limits"),
    Case("CanBoards", f"can_encoder_frame_stuck {BOARD} delay=1 duration=2", f"{BOARD} .* positions .* stand still"),
    Case("CanTimeouts", f"can_watchdog_off {BOARD}", f"{BOARD} has not stopped"),
)

_SUITE = """<suite name="drives">
    <fixture name="names" param="--namespace /drives"> yarpserver </fixture>
    <fixture name="robot" depends="names" param="--clock /drives/clock --parts {part} --can true --drives {part}">
        simulator
    </fixture>
{tests}
</suite>
"""
_TEST = """    <test name="{name}">
        <parameter name="part">{part}</parameter> {fault} {test}
    </test>"""
_FAULT = """<parameter name="inject">{}</parameter>"""


def wrong(case: Case, outcome: Outcome) -> str:
    """Return what is wrong with the outcome of a case; "" if nothing is."""
    said = "\n".join(outcome.said)
    if not case.fault:
        return "" if outcome.verdict == Verdict.PASSED.value else f"{outcome.verdict}: {said}"
    if outcome.verdict != Verdict.FAILED.value or not re.search(case.said, said):
        return f"{outcome.verdict}, and does not say {case.said!r}: {said}"
    others = set(re.findall(rf"{PART}\d:\d", said)) - {BOARD}
    return f"it accuses {', '.join(sorted(others))}, too" if BOARD in case.fault and others else ""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run all cases. Returns 0 when the healthy leg passes and every fault is found, 1 otherwise."""
    parser = argparse.ArgumentParser(description="Faults of buses and of boards that drive motors.")
    parser.add_argument("--folder", type=Path, help="where the run is kept (default: nowhere)")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        found = run(folder)
    bad = 0
    for case in CASES:
        problem = wrong(case, found.get(case.name, Outcome()))
        bad += bool(problem)
        print(f"{'wrong' if problem else 'ok':5}  {case.test:11}  {case.fault or 'healthy':50}  {problem}")
    print(f"CAN DRIVES {'FAILED' if bad else 'PASSED'}  {len(CASES) - bad} of {len(CASES)} cases as expected")
    return int(bool(bad))


def run(folder: Path, cases: Sequence[Case] = CASES) -> dict[str, Outcome]:
    """Run cases on one robot, in a folder that is there; return their outcomes by name."""
    suite = folder / "suite.xml"
    suite.write_text(_SUITE.format(part=PART, tests="\n".join(_tests(cases))))
    command = [sys.executable, "-m", "rtf.cli.testrunner", str(suite), "--run-folder", str(folder / "run")]
    subprocess.run(command, stdout=subprocess.DEVNULL, check=False)
    return outcomes(folder / "run")


def _tests(cases: Sequence[Case]) -> Iterator[str]:
    for case in cases:
        fault = _FAULT.format(case.fault) if case.fault else ""
        yield _TEST.format(name=case.name, part=PART, fault=fault, test=case.test)


if __name__ == "__main__":
    sys.exit(main())
