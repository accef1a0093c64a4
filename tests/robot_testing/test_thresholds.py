"""Thresholds of a robot's profile: a layer over the defaults of tests, under what suites say."""

from __future__ import annotations

from pathlib import Path

import pytest

from rtf.robot.model import RobotModelError, find_robot, load_robot
from rtf.robot_testing.robot_test import RobotTest
from rtf.robot_testing.thresholds import wrong_thresholds
from rtf.testing import Parameter

BENCH = find_robot("bench").parent
PROFILE = """
[thresholds.steadyHand]
origin = "measured on bench 3"
tremor = 0.5
names = ["a b", "c"]
strict = true
"""


class SteadyHand(RobotTest):
    """A test with thresholds."""

    plugin_name = "steady-hand"
    aliases = ("steadyHand",)
    tremor = Parameter(float, "most tremor", unit="deg", default=0.1, low=0.0)
    wait = Parameter(list[float], "time between two looks", unit="s", default=[1.0])
    names = Parameter(list[str], "words", default=[])
    strict = Parameter(bool, "whether all counts", default=False)


def robot_with(folder: Path, text: str) -> Path:
    """A bench with something more in its file, and beside it a test of that name."""
    (folder / "bench.xml").write_text((BENCH / "bench.xml").read_text(encoding="utf-8"), encoding="utf-8")
    file = folder / "robot.toml"
    file.write_text((BENCH / "robot.toml").read_text(encoding="utf-8") + text, encoding="utf-8")
    (folder / "steady_hand.py").write_text(
        "from rtf.robot_testing.robot_test import RobotTest\nfrom rtf.testing import Parameter\n"
        "class SteadyHand(RobotTest):\n    aliases = ('steadyHand',)\n"
        "    tremor = Parameter(float, 'most tremor', default=0.1, low=0.0)\n"
        "    names = Parameter(list[str], 'words', default=[])\n"
        "    strict = Parameter(bool, 'whether all counts', default=False)\n",
        encoding="utf-8",
    )
    return file


def resolve(folder: Path, **layers: object) -> tuple[SteadyHand, dict[str, str]]:
    """A test whose parameters are filled, and the source of each."""
    test = SteadyHand()
    environment = f'--robotmodel "{folder}/"'
    rows = test.resolve_parameters(param="", environment=environment, folder=str(folder), **layers)
    return test, {row["name"]: row["source"] for row in rows}


def test_the_profile_wins_over_defaults_and_the_suite_over_the_profile(tmp_path: Path):
    """Each value has its source: the line of robot.toml, and where that took it from; any name of the test counts."""
    folder = tmp_path / "a bench"
    folder.mkdir()
    file = robot_with(folder, PROFILE)
    line = file.read_text(encoding="utf-8").splitlines().index("tremor = 0.5") + 1
    test, sources = resolve(folder)
    assert (test.tremor, test.wait, test.names, test.strict) == (0.5, [1.0], ["a b", "c"], True)
    assert sources["tremor"] == f"{file}:{line}, measured on bench 3"
    assert sources["wait"] == "default"
    test, sources = resolve(folder, parameters=(("tremor", "0.2"),), place="s.xml:4")
    assert test.tremor == pytest.approx(0.2)
    assert sources["tremor"] == "<parameter> of s.xml:4"


def test_other_tests_of_the_robot_keep_their_defaults(tmp_path: Path):
    """A robot without thresholds changes nothing."""
    robot_with(tmp_path, "")
    test, sources = resolve(tmp_path)
    assert test.tremor == pytest.approx(0.1)
    assert set(sources.values()) == {"default"}


@pytest.mark.parametrize(
    ("written", "said"),
    [
        (PROFILE.replace("tremor", "tremr"), "unknown parameter 'tremr' ({file}:{line}, measured on bench 3); did you"),
        (PROFILE.replace("0.5", "-1"), "tremor: -1 is not at least 0 ({file}:{line}, measured on bench 3)"),
        (PROFILE.replace("0.5", "'much'"), "tremor: much is no number ({file}:{line}, measured on bench 3)"),
    ],
)
def test_a_wrong_value_is_reported_with_its_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, written: str, said: str
):
    """By 'rtf robot check', which tries all of them, and by each run of the test."""
    monkeypatch.chdir(tmp_path)
    file = robot_with(tmp_path, written)
    line = file.read_text(encoding="utf-8").splitlines().index('origin = "measured on bench 3"') + 2
    (problem,) = wrong_thresholds(load_robot(f"{tmp_path}/"))
    assert problem.startswith(said.format(file=file, line=line)), problem
    with pytest.raises(ValueError, match="of SteadyHand") as caught:
        resolve(tmp_path)
    assert said.format(file=file, line=line).split(" is ")[0] in str(caught.value)


def test_an_unknown_test_is_reported_with_its_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Its thresholds would be used nowhere; the nearest name is suggested. A test beside the suite is known."""
    monkeypatch.chdir(tmp_path)
    file = robot_with(tmp_path, PROFILE.replace("steadyHand", "steadyHead"))
    line = file.read_text(encoding="utf-8").splitlines().index("[thresholds.steadyHead]") + 1
    (problem,) = wrong_thresholds(load_robot(f"{tmp_path}/"))
    assert problem.startswith(f"{file}:{line}: thresholds: no test plug-in 'steadyHead'; did you mean")
    with pytest.raises(RobotModelError, match="steadyHead"):
        resolve(tmp_path)


def test_the_shipped_robots_have_thresholds_that_are_in_order():
    """Of tests that there are."""
    assert load_robot("bench").thresholds
    assert wrong_thresholds(load_robot("bench")) == []
