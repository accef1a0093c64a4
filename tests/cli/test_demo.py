"""The demonstration, from the checkout, and from a wheel in an empty environment."""

from __future__ import annotations

import os
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest

from rtf.bottle import Dialect
from rtf.cli.demo import BATTERY, CAN_SHARE, YARP4_SHARE, battery_suites

ROOT = Path(__file__).parents[2]
#: The test that the demonstration is compared with.
BEFORE = """
from rtf.testing import TestCase

class Before(TestCase):
    def run(self):
        self.check(True, "fine")
"""


def call(*command: str | Path, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a command to its end."""
    environment = {name: value for name, value in os.environ.items() if name not in {"PYTHONPATH", "VIRTUAL_ENV"}}
    words = [str(word) for word in command]
    return subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, timeout=280, check=False)


def test_the_demo_sees_what_happens(tmp_path: Path):
    """All verdicts are the expected ones, and the last lines have the result and the archived page."""
    (tmp_path / "before.py").write_text(BEFORE)
    assert call(sys.executable, "-m", "rtf.cli.testrunner", "--test", "before.py", folder=tmp_path).returncode == 0
    done = call(sys.executable, "-m", "rtf", "demo", "--quick", folder=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "python3 relay.py first on pc2 is restarted, attempt 1 of 3" in done.stdout
    assert "all programs were stopped, and nothing is left on the nodes" in done.stdout
    assert "head0:3 is a MC_4DC with firmware 3.5.0" in done.stdout
    assert "board head0:2 (neck_yaw, eyes_tilt): it does not answer" in done.stdout
    page, verdict = done.stdout.rstrip().splitlines()[-2:]
    assert verdict.startswith("DEMO PASSED")
    assert Path(page.partition(": ")[2]).read_text(encoding="utf-8").startswith("<!doctype html>")


def test_both_dialects_are_shown_unless_one_is_set():
    """Without a set dialect the suite of YARP 4 is among the demonstration's suites; that of CAN buses always is."""
    assert {*BATTERY, YARP4_SHARE, CAN_SHARE} <= {*battery_suites(None)}
    assert YARP4_SHARE not in {*battery_suites(Dialect.YARP3), *battery_suites(Dialect.YARP4)}
    assert all((ROOT / "suites" / "icubSim" / f"{name}.xml").exists() for name in battery_suites(None))


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built from the checkout."""
    folder = tmp_path_factory.mktemp("wheel")
    done = call(sys.executable, "-m", "build", "--no-isolation", "--wheel", "--outdir", folder, ROOT, folder=folder)
    assert done.returncode == 0, done.stdout + done.stderr
    (built,) = folder.glob("*.whl")
    return built


def test_the_wheel_puts_only_rtf_into_site_packages(wheel: Path):
    """The wheel installs the package ``rtf`` only, with all data inside it."""
    tops = {name.partition("/")[0] for name in zipfile.ZipFile(wheel).namelist()}
    assert {top for top in tops if not top.endswith(".dist-info")} == {"rtf"}
    names = zipfile.ZipFile(wheel).namelist()
    for shipped in (
        "rtf/shipped/reports/junit.py",
        "rtf/shipped/fixtures/process.py",
        "rtf/testing/languages/prelude.lua",
        "rtf/shipped/suites/demo/demo.xml",
        "rtf/cli/templates/test/NAME.py.j2",
    ):
        assert shipped in names


def test_the_wheel_runs_the_demo_in_an_empty_environment(wheel: Path, tmp_path: Path):
    """The installed wheel runs the demonstration without the checkout."""
    venv.create(tmp_path / "env")
    pip = (sys.executable, "-m", "pip", "--python", tmp_path / "env")
    installed = call(*pip, "install", "--quiet", "--no-compile", f"{wheel}[lua]", folder=tmp_path)
    assert installed.returncode == 0, installed.stderr
    done = call(tmp_path / "env" / "bin" / "rtf", "demo", folder=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "DEMO PASSED" in done.stdout
