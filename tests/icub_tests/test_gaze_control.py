"""The tests of gaze control on the simulated robot, whose configuration has a gaze controller."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from harness import Outcome, run_command, write_files
from robot_outcomes import failed_parts, said
from rtf.testing.verdict import Verdict

GAZE = "/iKinGazeCtrl"
LOOK, STRESS = "GazeControlSimpleLook", "GazeControllerStress"
#: Name, test, parameters.
CASES = {
    "look": (LOOK, {}),
    "original": ("GazeControlSimpleLookTest", {"robot": "icubSim"}),
    "stress": (STRESS, {"looks": "4", "longest": "1.0"}),
    "behind": (LOOK, {"targets": "(0.5 0.0 0.3)"}),
    "jam": (LOOK, {"inject": "jam neck_yaw"}),
    "silent": (LOOK, {"inject": f"controller_silent {GAZE} delay=0.6"}),
    "stop": (LOOK, {"inject": f"controller_stop_ignored {GAZE}"}),
    "early": (LOOK, {"inject": f"controller_early {GAZE}"}),
    "slip": (LOOK, {"inject": "encoder_bias neck_yaw bias=10 delay=0.6"}),
    "limit": (LOOK, {"inject": "wrong_upper_limit neck_pitch"}),
    "foreign": (LOOK, {"controller": "/nobody"}),
    "after": (LOOK, {}),
}
HEAD = """<suite name="s">
<fixture name="names"> yarpserver </fixture>
<fixture name="robot" depends="names" param="--config {config}">
<parameter name="arguments">(--lockstep yes)</parameter> robotinterface </fixture>
"""


@pytest.fixture(scope="module")
def outcome(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    """One run of all of them, on one robot."""
    folder = tmp_path_factory.mktemp("gaze")
    config = Path(__file__).parents[2] / "suites" / "robots" / "icubSim" / "icubSim.xml"
    tests = ""
    for name, (test, parameters) in CASES.items():
        rows = "".join(f'<parameter name="{key}">{value}</parameter>' for key, value in parameters.items())
        tests += f'<test name="{name}">{rows} {test} </test>\n'
    write_files(folder, {"suite.xml": f"{HEAD.format(config=config)}{tests}</suite>"})
    return run_command(folder, "--suite", "suite.xml", limit=240.0)


@pytest.mark.parametrize("name", ["look", "original", "stress", "after"])
def test_a_healthy_robot_looks_at_its_targets(outcome: Outcome, measured, name: str):
    """By the controller's word and by the encoders, in time; also after tests that failed."""
    assert outcome.verdict(name) is Verdict.PASSED, outcome.detail(name)
    angles = [one.value for one in measured(outcome, name, "eyes from the point")]
    assert len(angles) == (1 if name == "stress" else 3)
    assert all(0.0 <= one <= 0.3 for one in angles)
    assert all(one.value <= 0.2 for one in measured(outcome, name, "controller from encoders"))
    assert all(0.3 <= one.value <= 2.0 for one in measured(outcome, name, "duration"))
    assert all(0.0 < one.value < 30.0 for one in measured(outcome, name, "way after a stop"))


def test_a_target_behind_the_head_is_reported(outcome: Outcome, measured):
    """The controller ends at its limits, and calls it done; the eyes do not look at the point."""
    assert outcome.verdict("behind") is Verdict.FAILED
    assert measured(outcome, "behind", "eyes from the point")[0].value > 30.0
    assert "a target out of reach" in said(outcome, "behind")


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("jam", "neck_yaw"),
        ("silent", f"{GAZE} does not answer: .*likely: a controller that has stopped, or hangs"),
        ("slip", "neck_yaw: joint and motor encoder disagree"),
        ("stop", f"{GAZE} goes on after it was stopped"),
        ("early", f"{GAZE} says that its motion is done, and it is not: "),
        ("limit", rf"neck_pitch: the upper limit of {GAZE} is [-\d.]+ deg, that of its board"),
    ],
)
def test_faults_are_named(outcome: Outcome, name: str, text: str):
    """A joint, or the controller."""
    assert outcome.verdict(name) is Verdict.FAILED, outcome.detail(name)
    assert re.search(text, said(outcome, name) + outcome.detail(name))
    if name == "limit":
        assert failed_parts(outcome, name) == ["neck_pitch"]


def test_without_a_controller_there_is_an_error(outcome: Outcome):
    """It names what is missing, and what to do."""
    assert outcome.verdict("foreign") is Verdict.ERROR
    assert "there is no gaze controller /nobody; start it" in outcome.detail("foreign")
