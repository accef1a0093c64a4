"""The robot is lost in the middle of a test; ``run_robot_lost.py`` does the same to every robot test."""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING

import pytest

from .robot_lost import Subject, findings

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = [
    pytest.mark.torture,
    pytest.mark.skipif(not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"),
]


@pytest.mark.usefixtures("no_process_left")
def test_what_happens_to_the_robot_is_not_blamed_on_a_test(tmp_path: Path):
    """When the robot is killed or frozen, the test is fixture lost, and the next one passes on a new generation."""
    simulator = {"parts": "head,torso", "alive_timeout": "1"}
    subject = Subject("MotorTest", {"part": "torso"}, simulator, 'backoff="0.01" check-period="0.1"')
    found = findings(tmp_path, subject, ["kill", "freeze"], 5, (0.4, 0.1))
    assert [(one.strike, one.wrong, one.missed) for one in found] == [("kill", [], False), ("freeze", [], False)]
