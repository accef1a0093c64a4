"""The commands describe, validate, report and where, and the command ``rtf``."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from harness import run_command, write_files
from rtf.testing.verdict import ExitCode

ELBOW = """
from enum import Enum
from rtf.testing import TestCase, FixtureManager, Parameter
class Safety(Enum):
    MOTION = 1
class Elbow(TestCase):
    '''Reaches a target.

    More is said here.
    '''
    plugin_name = "elbow-reach"
    tags = ("motion",)
    safety = Safety.MOTION
    speed = Parameter(float, "reference speed", unit="deg/s", default=20.0, low=1.0, high=100.0)
    part = Parameter(str, "part of the robot")
    def run(self):
        self.measure("error", 0.1, "deg", high=1.0)
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with one plug-in and a suite."""
    suite = '<suite name="s"><test param="--part arm"> elbow.py </test></suite>'
    write_files(tmp_path, {"elbow__py": ELBOW, "s__xml": suite})
    return tmp_path


def test_describe_prints_the_declared_parameters(folder: Path):
    """``describe`` prints names, parameters with unit and range, safety, and the author's text."""
    done = run_command(folder, "describe", "elbow-reach")
    assert done.exit_code == 0
    assert "Elbow (also: elbow-reach)" in done.stdout
    assert "More is said here." in done.stdout
    assert "speed" in done.stdout
    assert "within [1, 100] deg/s" in done.stdout
    assert "required" in done.stdout
    assert "  safety: motion\n" in done.stdout


def test_describe_writes_markdown_for_the_documentation(folder: Path):
    """``--markdown`` prints the table of parameters for a page."""
    done = run_command(folder, "describe", "elbow.py", "--markdown")
    assert "| `speed` | float | deg/s | `20` | within [1, 100] deg/s | reference speed |" in done.stdout


def test_describe_survives_a_plugin_that_does_not_load(folder: Path):
    """A plug-in that crashes while it is loaded is reported, with exit code 4."""
    (folder / "crash.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGSEGV)\n")
    done = run_command(folder, "describe", "crash.py")
    assert done.exit_code == ExitCode.USAGE
    assert "SIGSEGV" in done.stderr


def test_describe_of_nothing_lists_all(folder: Path):
    """Without a name ``describe`` lists all tests, or all fixtures."""
    assert "Elbow  Reaches a target." in run_command(folder, "describe").stdout
    assert "process" in run_command(folder, "describe", "--fixture").stdout.lower()


def test_validate_reports_every_problem_of_every_file(folder: Path):
    """``validate`` reports all problems of suites, plug-ins, parameters and their files."""
    (folder / "bad.xml").write_text(
        '<suite name="bad">\n<fixture>nonesuch</fixture>\n<test param="--part arm --sped 3">elbow.py</test>\n'
        '<test>missing</test>\n<test param="--from lost.ini">elbow.py</test>\n</suite>',
    )
    done = run_command(folder, "validate", "bad.xml", "s.xml")
    assert done.exit_code == ExitCode.USAGE
    for said in ("did you mean 'speed'", "no fixture plug-in 'nonesuch'", "no test plug-in 'missing'", "lost.ini"):
        assert said in done.stderr, said
    assert "2 suites, 4 tests: 4 errors, 0 warnings" in done.stdout
    assert run_command(folder, "validate", "s.xml").exit_code == ExitCode.PASSED


@pytest.mark.parametrize(
    ("body", "hint"), [("<tst>elbow.py</tst>", "test"), ('<test timeot="3">elbow.py</test>', "timeout")]
)
@pytest.mark.parametrize("command", [["--suite"], ["validate"]])
def test_a_name_that_no_suite_knows_is_refused_unless_leniently(folder: Path, command: list[str], body: str, hint: str):
    """An unknown element or attribute is an error with a hint; with ``--lenient`` the suite runs."""
    text = f'<suite name="t"><test param="--part arm"> elbow.py </test>{body}</suite>'
    write_files(folder, {"t__xml": text.replace("timeot", 'param="--part arm" timeot')})
    done = run_command(folder, *command, "t.xml")
    assert done.exit_code == ExitCode.USAGE
    assert f"did you mean '{hint}'?" in done.stderr
    lenient = run_command(folder, *command, "t.xml", "--lenient")
    assert lenient.exit_code == ExitCode.PASSED, lenient.stderr


def test_validate_of_a_folder_without_suites_is_an_error(folder: Path):
    """A folder without suites is an error of ``validate``; other XML files are ignored."""
    (folder / "empty").mkdir()
    (folder / "empty" / "notes.xml").write_text("<notes/>")
    done = run_command(folder, "validate", "empty", "s.xml")
    assert done.exit_code == ExitCode.USAGE
    assert done.stderr == "empty: error: there is no suite in this folder\n"
    assert "1 suite, 1 test: 1 error, 0 warnings" in done.stdout
    assert run_command(folder, "validate", ".").exit_code == ExitCode.PASSED


@pytest.mark.parametrize(
    ("robot", "test", "said"),
    [
        ('param="--parts head,torso"', "--part left_arm", "the simulated robot has no 'left_arm', but head, torso"),
        ("", "--part left_flipper", "the simulated robot has no 'left_flipper', but head, "),
        ("", "--part left_arm", ""),
        ('param="--parts head"', "--part left_arm --robot icub7", ""),
    ],
)
def test_validate_warns_of_a_part_that_the_simulated_robot_has_not(folder: Path, robot: str, test: str, said: str):
    """``validate`` warns of a part that the simulated robot lacks, not of parts of other robots."""
    (folder / "sim.xml").write_text(
        f'<suite name="sim"><fixture name="names">yarpserver</fixture>'
        f'<fixture name="robot" depends="names" {robot}>simulator</fixture>'
        f'<test param="{test}">JointLimits</test><test param="--part wing" fixtures="names">JointLimits</test></suite>'
    )
    done = run_command(folder, "validate", "sim.xml")
    assert done.exit_code == ExitCode.PASSED
    assert f"1 suite, 2 tests: 0 errors, {1 if said else 0} warning" in done.stdout
    assert said in done.stderr


BOMB = """
import os
from rtf.testing import Parameter, TestCase

class Bomb(TestCase):
    speed = Parameter(int, "how fast", default=1)

    def resolve_parameters(self, **values):
        if "9" in values["param"]:
            os.abort()
        return super().resolve_parameters(**values)
"""


def test_validate_loses_no_finding_to_a_plug_in_that_crashes(folder: Path):
    """A plug-in that crashes with one use does not hide the findings of its other uses."""
    (folder / "bomb.py").write_text(BOMB)
    uses = "".join(f'<test name="{speed}" param="--speed {speed}">bomb.py</test>' for speed in ("1", "9", "quick"))
    (folder / "bombs.xml").write_text(f'<suite name="bombs">{uses}</suite>')
    done = run_command(folder, "validate", "bombs.xml")
    assert "test 9: its process ended while it was being loaded: killed by SIGABRT" in done.stderr
    assert "test quick: speed: " in done.stderr
    assert "1 suite, 3 tests: 2 errors, 0 warnings" in done.stdout


def test_report_rebuilds_reports_from_the_journal(folder: Path):
    """A report from the journal has the bytes of the report of the run."""
    run_command(folder, "-s", "s.xml", "--junit", "then.xml")
    done = run_command(folder, "report", "rtf-runs/latest", "--junit", "later.xml", "-q")
    assert done.exit_code == 0
    assert (folder / "later.xml").read_bytes() == (folder / "then.xml").read_bytes()


def test_report_exits_as_the_run_did(folder: Path):
    """``report`` has the exit code of the run."""
    run_command(folder, "-t", "elbow.py")
    assert run_command(folder, "report", "rtf-runs/latest").exit_code == ExitCode.FAILURES


def test_report_of_nothing_is_an_error(folder: Path):
    """The error about a missing run names the path."""
    done = run_command(folder, "report", "nowhere")
    assert done.exit_code == ExitCode.USAGE
    assert "nowhere" in done.stderr


def test_where_prints_every_place_and_which_one_wins(folder: Path):
    """``where`` prints the path of the nearest file, and those that it shadows."""
    (folder / "camera.ini").write_text("a 1\n")
    context = folder / "contexts" / "icubSim"
    context.mkdir(parents=True)
    (context / "camera.ini").write_text("a 2\n")
    done = run_command(folder, "where", "camera.ini", "--context", "icubSim")
    assert done.exit_code == 0
    assert done.stdout.splitlines()[0] == f"camera.ini: {folder / 'camera.ini'}"
    assert "shadowed" in done.stdout
    assert run_command(folder, "where", "nonesuch.ini").exit_code == ExitCode.FAILURES


def test_rtf_gathers_the_tools(folder: Path):
    """``rtf`` runs each tool by a word, and names an unknown one."""

    def rtf(*arguments: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "rtf", *arguments]
        return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60, check=False)

    assert rtf("--help").returncode == 0
    assert rtf("version").stdout.startswith("rtf version ")
    assert rtf("run", "-s", "s.xml", "-q").returncode == 0
    assert rtf("describe", "elbow.py").returncode == 0
    wrong = rtf("descrbe")
    assert wrong.returncode == ExitCode.USAGE
    assert "descrbe" in wrong.stderr
