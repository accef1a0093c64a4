"""``testrunner history``: its output as text and JSON, and changes of the file."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import pytest

from harness import run_command, write_files
from recorded import put, stored
from rtf.cli.testrunner import main
from rtf.testing.history import History
from rtf.testing.measurement import Measurement, Unit
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

FILE = "h.sqlite"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Twenty runs of a robot: a knee wears, a supply is near its limit, a test is flaky, another fails."""
    for index in range(20):
        slips = index % 4 == 1
        values = {
            ("arm/reach", "left_knee", "error"): Measurement("error", 0.5 + 0.05 * index, Unit.DEG, high=1.6),
            ("arm/reach", "right_knee", "error"): Measurement("error", 0.5 + 0.05 * (index % 2), Unit.DEG, high=1.6),
            ("arm/power", "", "supply"): Measurement("supply", 23.1, Unit.V, low=23, high=25, marginal=0.2),
        }
        tests = {"arm/reach": "failed" if slips else "passed", "arm/power": "passed", "arm/broken": "error"}
        put(tmp_path / FILE, stored(index, verdict="failed"), tests, values)
    return tmp_path


@dataclass
class Shown:
    """The result of a command."""

    exit_code: int
    stdout: str
    stderr: str


@pytest.fixture
def shown(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Callable[..., Shown]:
    """Return a function that runs ``testrunner history`` in a folder."""
    monkeypatch.delenv("FORCE_COLOR", raising=False)

    def run(folder: Path, *words: str) -> Shown:
        monkeypatch.chdir(folder)
        capsys.readouterr()
        code = main(["history", *words, "--history", FILE])
        return Shown(code, *capsys.readouterr())

    return run


def test_the_overview_shows_what_needs_attention(shown: Callable[..., Shown], folder: Path):
    """The overview has the last ten runs, flaky and failing tests, drifts, and values near a limit."""
    done = shown(folder)
    assert (done.exit_code, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    assert lines[0] == f"icub01 on bench, 20 runs  ({FILE})"
    runs = [line for line in lines if "FAILED" in line]
    assert len(runs) == 10
    assert re.fullmatch(r"  2025-06-1\d \d\d:\d\d  FAILED  1 error, 2 passed            12\.5 s  run-19", runs[0])
    assert "FAILED  1 failed, 1 error, 1 passed  12.5 s  run-17" in runs[2]
    text = done.stdout
    assert "Flaky tests\n  arm/reach  passed 75 % (53 to 89 %)  ✓✗✓✓✓✗✓✓✓✗✓✓✓✗✓✓✓✗✓✓\n" in text
    assert f"Failing tests\n  arm/broken  passed 0 % (0 to 16 %)  {'!' * 20}\n" in text
    drift = "▁▁▂▂▂▃▃▃▄▄▄▅▅▅▅▆▆▆▇▇  drifts +0.05 deg/run (p < 0.001), reaches 1.6 deg in about 3 runs"
    assert f"Drifting measurements\n  arm/reach  left_knee: error  1.45 deg  {drift}\n" in text
    assert f"Beyond a limit, or close to it\n  arm/power  supply  23.1 V  {'▁' * 20}  within [23, 25] V\n" in text
    assert "right_knee" not in text


def test_a_name_selects_its_details(shown: Callable[..., Shown], folder: Path):
    """For a name the command prints each measurement and test that has it."""
    done = shown(folder, "left_knee", "power")
    assert (
        "\narm/reach  left_knee: error\n"
        "  last 1.45 deg, passed; at most 1.6 deg\n"
        "  smallest 0.5, median 0.975, largest 1.45 of 20 runs\n"
        "  passed 100 % (84 to 100 %)\n"
        "  drifts +0.05 deg/run (p < 0.001), reaches 1.6 deg in about 3 runs\n"
        "  0.5 ▁▁▂▂▂▃▃▃▄▄▄▅▅▅▅▆▆▆▇▇ 1.6\n"
    ) in done.stdout
    assert "last 23.1 V, marginal; within [23, 25] V\n" in done.stdout
    assert "Tests\n  arm/power  passed 100 %" in done.stdout
    assert "right_knee" not in done.stdout


def test_only_so_many_runs_count(shown: Callable[..., Shown], folder: Path):
    """``--last`` limits the runs; too few of them show no drift."""
    done = shown(folder, "left_knee", "--last", "5")
    assert "5 runs" in done.stdout
    assert "too few runs of one robot to tell a drift" in done.stdout


def test_programs_get_json(shown: Callable[..., Shown], folder: Path):
    """``--json`` has the same trends, also for named measurements."""
    everything = json.loads(shown(folder, "--json").stdout)
    assert len(everything["runs"]) == 20
    assert {*everything["tests"]} == {"arm/reach", "arm/power", "arm/broken"}
    one = json.loads(shown(folder, "*/left_knee/*", "--json").stdout)
    assert [*one["measurements"]] == ["arm/reach\nleft_knee\nerror"]
    assert json.loads(shown(folder, "--robot", "none", "--json").stdout)["runs"] == []


def test_robots_are_mixed_only_when_asked(shown: Callable[..., Shown], folder: Path):
    """The history is that of one robot and station, unless patterns select several."""
    put(folder / FILE, stored(30, robot="icub02", station=""), {"arm/reach": "passed"})
    assert shown(folder).stdout.startswith("icub02 on unnamed station, 1 run  (")
    assert shown(folder, "--robot", "icub01").stdout.startswith("icub01 on bench, 20 runs")
    mixed = shown(folder, "--robot", "*", "--station", "*").stdout
    assert mixed.startswith("several robots or stations, 21 runs")
    assert "icub02 on unnamed station  run-30\n" in mixed
    assert "icub01 on bench            run-19\n" in mixed


def test_all_is_well(shown: Callable[..., Shown], tmp_path: Path):
    """A history without findings ends with a sentence that says so."""
    put(tmp_path / FILE, stored(0), {"arm/reach": "passed"})
    assert shown(tmp_path).stdout.endswith("\n\nNo flaky or failing test, no drift, nothing close to a limit.\n")


def test_colours_only_where_they_are_wanted(shown: Callable[..., Shown], folder: Path):
    """Output into a pipe has no colours, and otherwise the same text."""
    plain, coloured = shown(folder).stdout, shown(folder, "--color", "always").stdout
    assert "\x1b" not in plain
    assert "\x1b[31mFAILED\x1b[0m" in coloured
    assert re.sub(r"\x1b\[\d+m", "", coloured) == plain


def test_an_output_without_such_characters_gets_plain_ones(folder: Path):
    """An ASCII terminal gets plain characters for verdicts and curves."""
    text = run_command(folder, "history", "reach", "--history", FILE, PYTHONIOENCODING="ascii").stdout
    assert "+x+++x+++x+++x+++x++" in text
    assert "0.5 11222333444555566677 1.6" in text


def test_whatever_tests_are_called_the_terminal_stays_whole(shown: Callable[..., Shown], tmp_path: Path):
    """Control characters in names are escaped."""
    hostile = "\x1b[2J\r\n<script>\u202e"
    key = (f"s/{hostile}", hostile, hostile)
    for index in range(12):
        value = Measurement("error", float(index), Unit.DEG, high=2.0)
        put(
            tmp_path / FILE,
            stored(index, robot=hostile),
            {f"s/{hostile}": ("passed", "failed")[index % 2]},
            {key: value},
        )
    for words in ((), ("script",)):
        done = shown(tmp_path, *words)
        assert "\\x1b[2J" in done.stdout
        assert not re.search("[\x00-\x09\x0b-\x1f\x7f-\x9f\u202a-\u202e]", done.stdout)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("nothing",), "no run has 'nothing' in it"),
        (("--robot", "r9"), "no run of that robot and station is in it"),
        (("--forget", "run-99"), "there is no run run-99"),
        (("--import", "nowhere"), "there is no run in "),
    ],
)
def test_what_is_not_there_is_an_error(shown: Callable[..., Shown], folder: Path, words: tuple[str, ...], message: str):
    """A name, robot or option that matches nothing is an error that names it."""
    done = shown(folder, *words)
    assert done.exit_code == ExitCode.USAGE
    assert message in done.stderr
    assert "Traceback" not in done.stderr


def test_without_a_history_it_is_said_how_one_comes_to_be(shown: Callable[..., Shown], tmp_path: Path):
    """A missing history is an error with a hint, and no file is made."""
    done = shown(tmp_path)
    assert done.exit_code == ExitCode.USAGE
    assert "there is no history h.sqlite yet: run tests with --history, or take archived runs in" in done.stderr
    assert not [*tmp_path.iterdir()]


def test_an_empty_history_says_so(shown: Callable[..., Shown], tmp_path: Path):
    """A history without runs is an error that says so."""
    History(tmp_path / FILE, create=True).close()
    done = shown(tmp_path)
    assert (done.exit_code, "no run is in it" in done.stderr) == (ExitCode.USAGE, True)


# Care ----------------------------------------------------------------------------------------------------------------

FINE = """
from rtf.testing import TestCase
class Fine(TestCase):
    def run(self):
        self.measure("error", 0.5, "deg", high=1.0)
"""


def test_archived_runs_are_taken_in_and_out(shown: Callable[..., Shown], tmp_path: Path):
    """Runs are imported once each, and can be removed; a folder without a run is reported."""
    write_files(tmp_path, {"fine__py": FINE})
    for _ in range(2):
        assert run_command(tmp_path, "--test", "fine.py", "-q").exit_code == 0
    (tmp_path / "rtf-runs" / "empty").mkdir()
    runs = sorted(path.name for path in (tmp_path / "rtf-runs").iterdir())
    done = shown(tmp_path, "--import", *(f"rtf-runs/{name}" for name in runs))
    assert done.exit_code == ExitCode.USAGE
    assert done.stdout.count(": 1 passed\n") == 2
    assert done.stderr.count("\n") == 1
    assert shown(tmp_path).stdout.count("PASSED") == 2
    newest = (tmp_path / "rtf-runs" / "latest").resolve().name
    done = shown(tmp_path, "--forget", "rtf-runs/latest")
    assert done.stdout == f"1 run named {newest} taken out of {FILE}\n"
    assert newest not in shown(tmp_path).stdout


def test_only_the_last_runs_are_kept(shown: Callable[..., Shown], folder: Path):
    """``--prune`` keeps the last runs of each robot and station."""
    assert shown(folder, "--prune", "5").stdout == f"15 runs taken out of {FILE}\n"
    assert shown(folder).stdout.startswith("icub01 on bench, 5 runs")


def test_the_help_teaches(tmp_path: Path):
    """The help explains the statistics, with examples; that of the runner names the command."""
    text = run_command(tmp_path, "history", "--help").stdout
    assert all(word in text for word in ("Wilson", "Mann-Kendall", "Theil-Sen", "--import rtf-runs/*"))
    assert "  history [NAME ...] " in run_command(tmp_path, "--help").stdout
