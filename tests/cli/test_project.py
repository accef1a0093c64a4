"""The defaults of a project: where they are found, their meaning, and errors in them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from harness import read_back, run_command, write_files
from rtf.cli.arguments import build_parser
from rtf.cli.project import _RENAMED, KEYS
from rtf.testing.events import RunStarted
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from pathlib import Path

FINE = """
from rtf.testing import TestCase, Parameter
class Fine(TestCase):
    level = Parameter(int, "a level", default=1)
    def run(self):
        self.check(True, f"level {self.level}")
"""
SETTINGS = """
suites = ["suites/a.xml", "suites/b.xml"]
robot = "icub7"
jobs = 2
history = "history.sqlite"

[limits]
run = "20s"

[reports]
junit = "results.xml"

[set]
level = 7

[device]
serial = "A7"
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A project with two suites."""
    suites = {f"suites/{name}__xml": f'<suite name="{name}"><test>fine.py</test></suite>' for name in "ab"}
    write_files(tmp_path, {"suites/fine__py": FINE, "rtf__toml": SETTINGS, **suites})
    return tmp_path


@pytest.mark.parametrize("where", [".", "suites"])
def test_testrunner_alone_runs_the_project(folder: Path, where: str):
    """Without arguments the project's suites run with its defaults, from any of its folders."""
    done = run_command(folder / where, "-v")
    assert done.exit_code == ExitCode.PASSED, done.stderr
    events, results = read_back(folder / "rtf-runs" / "latest")
    assert [*results.tests] == ["a/fine", "b/fine"]
    (started,) = [event for event in events if isinstance(event, RunStarted)]
    assert (started.robot, started.device) == ("icub7", {"serial": "A7"})
    assert "level 7" in done.stdout
    assert (folder / "results.xml").exists()
    assert (folder / "history.sqlite").exists()


def test_the_command_line_wins(folder: Path):
    """Suites and options of the command line replace those of the project."""
    done = run_command(folder, "suites/b.xml", "--robot", "mine", "--set", "level=8", "-v")
    assert [*done.results.tests] == ["b/fine"]
    assert done.of(RunStarted)[0].robot == "mine"
    assert "level 8" in done.stdout
    assert run_command(folder, "--no-config").exit_code == ExitCode.USAGE


def test_a_run_is_resumed_as_it_was_begun(folder: Path):
    """A resumed run has the defaults with which it was begun."""
    begun = run_command(folder)
    (folder / "rtf.toml").write_text("robot = 'other'\n")
    resumed = run_command(folder, "--resume", "rtf-runs/latest")
    assert resumed.exit_code == ExitCode.PASSED, resumed.stderr
    assert [*resumed.results.tests] == [*begun.results.tests]


def test_other_commands_know_the_project(folder: Path):
    """``validate`` and ``history`` use the project's suites and history."""
    assert "2 suites, 2 tests: 0 errors" in run_command(folder / "suites", "validate").stdout
    run_command(folder)
    assert "1 run" in run_command(folder, "history").stdout
    (folder / "rtf.toml").unlink()
    assert run_command(folder, "validate").exit_code == ExitCode.USAGE


def test_pyproject_is_read_too(folder: Path):
    """The defaults are the table ``tool.rtf`` of pyproject.toml, if there is no rtf.toml."""
    settings = SETTINGS.replace("[", "[tool.rtf.", 4).replace("suites = [tool.rtf.", "suites = [")
    text = f"[project]\nname = 'x'\n[tool.rtf]\n{settings}".replace("[tool.rtf.device]", "[tool.rtf.device]")
    text = text.replace("\n[set]", "\n[tool.rtf.set]").replace("\n[device]", "\n[tool.rtf.device]")
    (folder / "pyproject.toml").write_text(text)
    (folder / "rtf.toml").unlink()
    shown = run_command(folder, "--show-config").stdout
    assert "robot = icub7  (pyproject.toml:6)" in shown
    assert "limits.run = 20.0  (pyproject.toml:11)" in shown
    (folder / "pyproject.toml").write_text("[project]\nname = 'x'\n")
    assert "project: no rtf.toml" in run_command(folder, "--show-config").stdout


def test_show_config_says_what_came_from_where(folder: Path):
    """``--show-config`` prints each setting with its value and source, without secrets."""
    shown = run_command(folder, "--show-config", "-j", "3", "--set", "speed=2").stdout.splitlines()
    assert shown[0] == f"project: {folder / 'rtf.toml'}"
    assert "suites = suites/a.xml suites/b.xml  (rtf.toml:2)" in shown
    assert "jobs = 3  (command line)" in shown
    assert "set = level=7 speed=2  (rtf.toml:13, command line)" in shown
    assert "reports.junit = results.xml  (rtf.toml:11)" in shown
    assert "retries = none  (default)" in shown
    assert "secret" not in run_command(folder, "--show-config", "--set", "password=secret").stdout


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("jbos = 2", "rtf.toml:1: unknown setting 'jbos'; did you mean jobs?"),
        ("\n[limits]\nran = 2", "rtf.toml:3: unknown setting 'limits.ran'; did you mean limits.run?"),
        ("jobs = 'two'", "rtf.toml:1: jobs: 'two' is no whole number"),
        ("style = 'loud'", "rtf.toml:1: style: invalid choice: 'loud'"),
        ("[limits]\nrun = -1", "rtf.toml:2: limits.run: a duration must be positive"),
        ("jobs = [1]", "rtf.toml:1: jobs: must be a text or a number"),
        ("lenient = 1", "rtf.toml:1: lenient: must be true or false, not 1"),
        ("suites = 'a.xml'", "rtf.toml:1: suites: must be a list of texts"),
        ("suites = ['lost.xml']", "rtf.toml:1: suites: there is no file or folder lost.xml"),
        ("set = 3", "rtf.toml:1: set: must be a table"),
        ("[device]\nserial = ''", "serial: the value must be printable text"),
        ("allow-motion = true", "rtf.toml:1: unknown setting 'allow-motion'"),
        ("jobs = ", "rtf.toml: Invalid value"),
    ],
)
def test_a_mistake_is_reported_with_its_line(folder: Path, line: str, said: str):
    """An error in the file is reported with its line; a file cannot allow motion."""
    (folder / "rtf.toml").write_text(f"{line}\n")
    done = run_command(folder, "suites/a.xml")
    assert done.exit_code == ExitCode.USAGE
    assert said in done.stderr
    assert not done.events


def test_every_setting_is_an_option():
    """Each key of the file is an option of the command line."""
    options = {name.removeprefix("--") for action in build_parser()._actions for name in action.option_strings}
    named = {_RENAMED.get(key, key.removeprefix("reports.")) for key in KEYS} - {"suites"}
    assert named <= options
