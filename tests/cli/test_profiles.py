"""The facts of a run on its robots' profiles, and the warning about thresholds that are not validated."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from rtf.cli.profiles import profiles_of
from rtf.robot.model import find_robot
from rtf.testing.plan import load_files
from rtf.testing.verdict import Severity

BENCH = find_robot("bench").parent
PLUGIN = "from rtf.testing import TestCase\nclass Fine(TestCase):\n    def run(self): pass\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a test and a robot whose thresholds are not validated."""
    (tmp_path / "fine.py").write_text(PLUGIN, encoding="utf-8")
    (tmp_path / "bench.xml").write_text((BENCH / "bench.xml").read_text(encoding="utf-8"), encoding="utf-8")
    text = (BENCH / "robot.toml").read_text(encoding="utf-8").replace('profile = "chosen"', 'profile = "unvalidated"')
    (tmp_path / "robot.toml").write_text(text.replace('"bench"', '"draft"'), encoding="utf-8")
    return tmp_path


def profiles(folder: Path, inside: str):
    """Return the facts and warnings about a suite."""
    file = folder / "s.xml"
    file.write_text(f'<suite name="s">{inside}<test> fine </test></suite>', encoding="utf-8")
    return profiles_of(load_files([(file, True)], {}).suites)


def test_a_suite_that_names_no_robot_says_nothing(folder: Path):
    """A suite without a robot model has no profile, also if it names the robot's ports."""
    assert profiles(folder, "<environment>--robotname icubSim</environment>") == ({}, [])


def test_a_validated_profile_is_named_without_a_warning(folder: Path):
    """The profile of a robot model of the suite, or of its simulator, is a fact without a warning."""
    for inside in (
        "<environment>--robotmodel bench</environment>",
        '<fixture param="--model bench"> simulator </fixture>',
    ):
        assert profiles(folder, inside) == ({"profile.bench": "chosen"}, [])


def test_simulated_units_are_named(folder: Path):
    """In the facts of the run, and as a warning, as the robot is not the nominal one; unit 0 is."""
    facts, (said,) = profiles(folder, '<fixture param="--unit 7"> simulator </fixture>')
    assert facts == {"simulated units": "7"}
    assert said.severity is Severity.WARNING
    assert said.text == "unit 7 of the population is simulated, not the nominal robot"
    assert profiles(folder, '<fixture param="--unit 0"> simulator </fixture>') == ({}, [])


def test_a_robot_that_cannot_be_read_is_a_warning(folder: Path):
    """A robot model that cannot be read is a warning of the run."""
    facts, (said,) = profiles(folder, "<environment>--robotmodel tin</environment>")
    assert facts == {}
    assert said.severity is Severity.WARNING
    assert "no robot 'tin'" in said.text


def test_the_run_says_that_a_profile_is_not_validated(folder: Path):
    """The warning is on the console; JUnit and JSON have the profile, with other origins of single tests."""
    (folder / "s.xml").write_text(
        f'<suite name="s"><environment>--robotmodel "{folder}/"</environment><test> fine </test></suite>',
        encoding="utf-8",
    )
    words = ["s.xml", "--junit", "j.xml", "--json", "j.json"]
    ran = subprocess.run(
        [sys.executable, "-m", "rtf.cli.testrunner", *words],
        cwd=folder, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stdout + ran.stderr
    sentence = f"the thresholds of draft are not validated; {folder} says so"
    assert f"warning: {sentence}" in ran.stderr
    origins = "unvalidated; JointLimits: chosen; TorqueControlAccuracy: chosen"
    assert f'<property name="profile.draft" value="{origins}"/>' in (folder / "j.xml").read_text(encoding="utf-8")
    result = json.loads((folder / "j.json").read_text(encoding="utf-8"))
    assert result["run"]["environment"]["profile.draft"] == origins
    assert [one["text"] for one in result["diagnostics"]] == [sentence]
