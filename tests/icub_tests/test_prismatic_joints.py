"""Prismatic joints are tested like revolute ones, with values in metres."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest

from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from pathlib import Path

    from harness import Outcome

DESCRIPTION = """<mujoco model="lift"><worldbody>
<body name="carriage" pos="0 0 0.5">
  <joint name="lift" type="slide" axis="0 0 1" range="0 0.3"/>
  <geom type="box" size="0.05 0.05 0.05" mass="2"/>
  <body name="fore" pos="0 0.12 0">
    <joint name="elbow" axis="0 1 0" range="-60 100"/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.25" size="0.02" mass="0.6"/>
  </body>
</body></worldbody></mujoco>"""
TESTS = {
    "moves": ("MotorTest", ""),
    "step": ("PositionControlAccuracy", ""),
    "limits": ("JointLimits", ""),
    "swings": ("OpticalEncodersConsistency", ""),
    "jammed": ("MotorTest", "jam lift"),
    "narrow": ("JointLimits", "limits_ignored lift"),
}
SUITE = "".join(
    f'<test name="{name}"><parameter name="part">lift</parameter>'
    + (f'<parameter name="inject">"{fault}"</parameter>' if fault else "")
    + f" {test} </test>"
    for name, (test, fault) in TESTS.items()
)


@pytest.fixture(scope="module")
def outcome(tmp_path_factory: pytest.TempPathFactory, run_on_robot) -> Outcome:
    """One run of all of them on a draft of a robot with a slide and an elbow."""
    from rtf.simulator.derive import draft

    folder: Path = tmp_path_factory.mktemp("lift")
    (folder / "lift.xml").write_text(DESCRIPTION, encoding="utf-8")
    (folder / "robot.toml").write_text(draft("lift", folder / "lift.xml", 'file = "lift.xml"').text, encoding="utf-8")
    return run_on_robot(SUITE, model=folder / "robot.toml")


@pytest.mark.parametrize("name", ["moves", "step", "limits", "swings"])
def test_a_healthy_slide_passes(outcome: Outcome, name: str):
    """Moved, stepped, driven to its limits, and compared with its motor."""
    assert outcome.verdict(name) is Verdict.PASSED, outcome.detail(name)


def test_its_values_are_in_metres(outcome: Outcome, measured):
    """Those of the elbow are in degrees, though both have the same parameter as their tolerance."""
    (lift,) = [one for one in measured(outcome, "limits", "short of the upper limit") if one.subject == "lift"]
    (elbow,) = [one for one in measured(outcome, "limits", "short of the upper limit") if one.subject == "elbow"]
    assert (lift.unit, elbow.unit) == ("m", "deg")
    assert lift.high == pytest.approx(0.5 * 0.003)
    assert elbow.high == 0.5


def test_a_jammed_slide_is_found(outcome: Outcome):
    """It is released, and the elbow passes."""
    assert outcome.verdict("jammed") is Verdict.FAILED
    assert re.search(r"lift \(/liftSim/lift joint 0\) draws .*; it was released", outcome.detail("jammed"))
    assert "elbow" not in outcome.detail("jammed")


def test_commands_beyond_the_limits_of_a_slide_are_found(outcome: Outcome):
    """Its board does not limit them."""
    assert outcome.verdict("narrow") is Verdict.FAILED
    assert " m" in outcome.detail("narrow")
    assert "elbow" not in outcome.detail("narrow")
