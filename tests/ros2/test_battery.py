"""Tests of a robot through ROS 2: the healthy bench passes, and a fault of the simulated one is found by its effect."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

import pytest

from harness import Command, Outcome
from rtf.testing.events import TestEnded
from rtf.testing.verdict import Verdict

SUITES = Path(__file__).parents[2] / "suites"
#: The options of a run: the bench counts as a real robot, as it is known by its topics only.
OPTIONS = ("--define", "parts=arm", "--define", "rate=50", "--allow-motion", "--answer", "yes")
READY = '<parameter name="ready_log">'


def run(folder: Path, chosen: str, fault: str = "") -> Outcome:
    """Run some tests of ``suites/any/simulated-ros2.xml``; a fault is there as soon as the simulator is."""
    for name in ("any", "robots/ros2Bench"):
        shutil.copytree(SUITES / name, folder / name)
    suite = folder / "any" / "simulated-ros2.xml"
    if fault:
        inject = f'<parameter name="ready_command">rtf simulator inject --robot benchSim {fault}</parameter>'
        suite.write_text(suite.read_text().replace(READY, f"{inject}{READY}"))
    environment = {
        "ROS_DOMAIN_ID": str(1 + os.getpid() % 200),
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
    }
    command = Command(folder, "--suite", str(suite), *OPTIONS, "-k", chosen, **environment)
    outcome = command.wait(150)
    assert command.left_over() == []
    return outcome


def test_a_healthy_robot_passes_through_dds(tmp_path: Path):
    """Modes, moves and rates, which a busy machine leaves open; the whole battery takes two minutes of real time."""
    outcome = run(tmp_path, "modes or moves or rates")
    verdicts = [one.verdict for one in outcome.of(TestEnded)]
    assert verdicts[:2] == [Verdict.PASSED] * 2, outcome.stdout
    assert verdicts[2:] in ([Verdict.PASSED], [Verdict.INCONCLUSIVE]), outcome.stdout


@pytest.mark.parametrize(("fault", "joint"), [("jam elbow torque=50", "elbow")])
def test_a_fault_is_found_through_dds(tmp_path: Path, fault: str, joint: str):
    """The joint is named."""
    outcome = run(tmp_path, "moves", fault)
    assert [one.verdict for one in outcome.of(TestEnded)] == [Verdict.FAILED], outcome.stdout
    assert f"{joint} ends" in outcome.stdout
    assert "shoulder ends" not in outcome.stdout
