"""Plug-ins of installed packages are found by entry points: tests, fixtures, reporters, faults and languages."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import pytest

from harness import run_command, write_files
from rtf.robot.errors import RefusedError
from rtf.simulator.faults import find_kind
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from pathlib import Path

PACKAGE = """
from pathlib import Path
from rtf.testing import FixtureManager, Matrix, Parameter, Reporter, TestCase
class Lamp(TestCase):
    '''Shines.'''
    colour = Parameter(str, "colour", default="")
    matrix = Matrix(colour=("red", "green"))
    def run(self): self.check(True, "shines")
class Bench(FixtureManager):
    '''Is there.'''
class Tally(Reporter):
    plugin_name = "tally"
    def close(self, results): print("tally:", *results.tests)
class Recipe(TestCase):
    def __init__(self, path): self.path = path
    def run(self): self.check("salt" in self.path.read_text(), "there is salt")
def load_recipe(ref): return Recipe(Path(ref.path))
"""
FAULT = """
from rtf.simulator.faults.base import RobotFault, Layer
class Wobble(RobotFault):
    kind, layer = "wobble", Layer.PLANT
    description, symptom = "It wobbles.", "It shows."
    def begin(self): pass
    def end(self): pass
"""
POINTS = {
    "tests": "lamp = lab_plugins:Lamp",
    "fixtures": "bench = lab_plugins:Bench",
    "reporters": "tally = lab_plugins:Tally",
    "faults": "wobble = lab_faults:Wobble",
    "languages": "recipe = lab_plugins:load_recipe",
}


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """A folder as an installation makes it."""
    points = "".join(f"[rtf.{group}]\n{line}\n" for group, line in POINTS.items())
    files = {"METADATA": "Metadata-Version: 2.1\nName: lab\nVersion: 1.0\n", "entry_points.txt": points}
    write_files(tmp_path / "site", {f"lab-1.0.dist-info/{name}": text for name, text in files.items()})
    write_files(tmp_path / "site", {"lab_plugins.py": PACKAGE, "lab_faults.py": FAULT})
    return tmp_path / "site"


def test_tests_fixtures_reporters_and_languages_of_a_package_are_used_by_name(tmp_path: Path, site: Path):
    """A suite uses a package's plug-ins by name, matrices included."""
    body = '<fixture> bench </fixture><test> lamp </test><test type="recipe"> soup.txt </test>'
    write_files(tmp_path, {"s.xml": f'<suite name="s">{body}</suite>', "soup.txt": "salt and water"})
    outcome = run_command(tmp_path, "--suite", "s.xml", "--report", "tally", PYTHONPATH=str(site))
    assert outcome.exit_code == ExitCode.PASSED, outcome.stdout + outcome.stderr
    assert "tally: s/lamp[red] s/lamp[green] s/soup" in outcome.stdout


def test_a_fault_is_a_plug_in_of_a_package_or_a_file(tmp_path: Path, site: Path, monkeypatch: pytest.MonkeyPatch):
    """A fault is found by entry point or file name; a name with a folder is refused."""
    monkeypatch.syspath_prepend(str(site))
    assert find_kind("wobble").__module__ == "lab_faults"
    sys.modules.pop("lab_faults")
    write_files(tmp_path / "own", {"tremble.py": FAULT.replace("obble", "hirl")})
    monkeypatch.setenv("RTF_PLUGIN_PATH", str(tmp_path / "own"))
    assert find_kind("tremble").kind == "whirl"
    for name in ("nothing", str(tmp_path / "own" / "tremble.py"), "../own/tremble"):
        with pytest.raises(RefusedError, match="there is no fault"):
            find_kind(name)
