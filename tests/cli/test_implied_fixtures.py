"""Implied fixtures: without a fixture in suite or command line, a test runs with those that it names itself."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import pytest

from harness import Outcome, run_command, write_files
from rtf.robot_testing import RobotTest, Safety
from rtf.testing.events import Diagnosed, FixtureChanged, Message
from rtf.testing.plugin_makers import load_test
from rtf.testing.plugins import find
from rtf.testing.verdict import ExitCode, FixtureState, Verdict

if TYPE_CHECKING:
    from pathlib import Path

RIG = '''
from rtf.testing import FixtureManager, Parameter
class Rig(FixtureManager):
    """Says how high it is."""
    height = Parameter(float, "its height", unit="m", default=0.0)
    def setup(self):
        self.provide(RIG=f"{self.height:g}")
'''
TESTS = {
    "lifts.py": '''
import os
from rtf.testing import Parameter, TestCase
class Lifts(TestCase):
    """Says what it stands on."""
    safety = "motion"
    height = Parameter(float, "how high", unit="m", default=1.0)
    def implied_fixtures(self):
        return (("rig", {"height": f"{self.height:g}"}),)
    def run(self):
        self.report(f"stands on {os.environ.get('RIG')}")
''',
    "lifts_too.py": '''
from lifts import Lifts
class LiftsToo(Lifts):
    """The same."""
    safety = "motion"
''',
    "looks.py": '''
import os
from rtf.testing import TestCase
class Looks(TestCase):
    """Does nothing to anybody, and so is not asked."""
    def implied_fixtures(self):
        raise AssertionError
    def run(self):
        self.report(f"stands on {os.environ.get('RIG')}")
''',
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a fixture, and tests in a sub-folder."""
    write_files(tmp_path, {"rig.py": RIG, **{f"tests/{name}": text for name, text in TESTS.items()}})
    return tmp_path


def said(outcome: Outcome) -> list[str]:
    """Return what the tests reported."""
    return [event.detail for event in outcome.of(Message) if isinstance(event, Message) and event.title == "reports"]


def started(outcome: Outcome) -> list[str]:
    """Return the fixtures that were ready."""
    return [event.fixture for event in outcome.of(FixtureChanged, state=FixtureState.READY)]  # type: ignore[attr-defined]


def test_a_test_gets_its_implied_fixture(folder: Path):
    """A test gets its implied fixture, with its own parameters as values."""
    outcome = run_command(folder, "--test", "tests/lifts.py", "--set", "height=2.5")
    assert outcome.exit_code == ExitCode.PASSED, outcome.stderr
    assert said(outcome) == ["stands on 2.5"]


def test_tests_share_an_implied_fixture(folder: Path):
    """Tests with the same implied fixture share it, and one without runs without."""
    outcome = run_command(folder, "--tests", "tests")
    assert outcome.exit_code == ExitCode.PASSED, outcome.stderr
    assert started(outcome) == ["rig"]
    assert sorted(said(outcome)) == ["stands on 1", "stands on 1", "stands on None"]


def test_fixtures_of_a_suite_replace_implied_ones(folder: Path):
    """A fixture of the suite replaces implied ones."""
    fixture = '<fixture name="high"><parameter name="height">9</parameter> rig </fixture>'
    write_files(folder, {"suite.xml": f'<suite name="s">{fixture}<test>tests/lifts.py</test></suite>'})
    assert said(run_command(folder, "--suite", "suite.xml")) == ["stands on 9"]


def test_a_suite_without_fixtures_has_implied_ones(folder: Path):
    """Tests of a suite without fixtures have their implied ones, so that old suites restore the robot."""
    tests = '<test param="--height 3">tests/lifts.py</test><test>tests/looks.py</test>'
    write_files(folder, {"suite.xml": f'<suite name="s">{tests}</suite>'})
    outcome = run_command(folder, "--suite", "suite.xml")
    assert (outcome.exit_code, said(outcome)) == (ExitCode.PASSED, ["stands on 3", "stands on None"])
    assert started(outcome) == ["rig"]


@pytest.mark.parametrize("option", ["--list", "--dry-run"])
def test_lists_and_dry_runs_have_no_implied_fixtures(folder: Path, option: str):
    """Lists and dry runs have no implied fixtures."""
    outcome = run_command(folder, "--test", "tests/lifts.py", option)
    assert outcome.exit_code == ExitCode.PASSED, outcome.stderr
    assert "rig" not in outcome.stdout


def test_wrong_parameters_are_an_error_of_the_test(folder: Path):
    """Wrong parameters are an error of the test only, and no fixture is started."""
    outcome = run_command(folder, "--test", "tests/lifts.py", "--set", "hight=2")
    assert outcome.verdict("lifts") is Verdict.ERROR
    assert started(outcome) == []
    assert outcome.of(Diagnosed) == []


def test_one_that_cannot_be_asked_is_reported(folder: Path):
    """A test that cannot be asked for its implied fixtures is reported; the others get theirs."""
    text = 'import os\nos._exit(3)\nfrom rtf.testing import TestCase\nclass Dies(TestCase):\n    safety = "motion"\n'
    write_files(folder, {"tests/dies.py": text})
    outcome = run_command(folder, "--tests", "tests")
    (diagnosed,) = outcome.of(Diagnosed)
    assert "dies was not asked what puts right what it may leave behind" in diagnosed.text  # type: ignore[attr-defined]
    assert sorted(said(outcome)) == ["stands on 1", "stands on 1", "stands on None"]


# Robot tests -----------------------------------------------------------------------------------------------------


class Moves(RobotTest):
    """A test that moves a robot."""

    safety = Safety.MOTION


class TestRobotTests:
    """The implied fixtures of robot tests."""

    @pytest.fixture(autouse=True)
    def nowhere(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Remove the variables that name robots and clocks."""
        for name in ("RTF_CLOCK", "YARP_CLOCK", "YARP_ROBOT_NAME"):
            monkeypatch.delenv(name, raising=False)

    def asked(
        self, test: RobotTest, overrides: tuple[tuple[str, str], ...] = (), environment: str = ""
    ) -> list[tuple[str, dict[str, str]]]:
        """Return the implied fixtures of a test with these values, in a suite with this environment."""
        test.resolve_parameters(param="", overrides=overrides, environment=environment)
        return [(name, dict(values)) for name, values in test.implied_fixtures()]

    def test_one_that_moves_is_put_back_by_the_fixture_robot(self, monkeypatch: pytest.MonkeyPatch):
        """A test that moves implies the fixture ``robot``, with all parts of its robot."""
        assert self.asked(Moves()) == [("robot", {"robot": "icubSim", "parts": "*"})]
        assert self.asked(Moves(), (("robot", "/bot"),)) == [("robot", {"robot": "bot", "parts": "*"})]
        monkeypatch.setenv("YARP_ROBOT_NAME", "icub7")
        assert self.asked(Moves()) == [("robot", {"robot": "icub7", "parts": "*"})]
        assert self.asked(Moves(), environment="--robotname icub8") == [("robot", {"robot": "icub8", "parts": "*"})]
        assert self.asked(Moves(), (("robot", "bot"),), "--robotname icub8")[0][1]["robot"] == "bot"

    def test_the_robot_of_a_port_is_the_one_that_is_put_back(self):
        """A test with a port name instead of a robot implies the robot of that port."""
        assert self.asked(load_test(find("test", "MotorTest")), (("portname", "/bot/left_arm"),)) == [
            ("robot", {"robot": "bot", "parts": "*"})
        ]

    def test_one_that_listens_leaves_nothing(self):
        """A test that does not move implies no fixture."""
        assert self.asked(RobotTest()) == []

    def test_in_lockstep_it_would_hold_the_time(self, monkeypatch: pytest.MonkeyPatch):
        """In lockstep a test implies no fixture, because the simulator is reset instead."""
        monkeypatch.setenv("RTF_CLOCK", "lockstep:/clock")
        assert self.asked(Moves()) == []

    def test_without_a_robot_it_says_how_to_get_one(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
        """Without a robot the shipped fixture blocks the test, with a hint; a local file of its name is ignored."""
        monkeypatch.setenv("YARP_CONFIG_HOME", str(tmp_path / "user"))
        write_files(tmp_path, {"robot.py": "raise RuntimeError('not this one')", "user/yarp.conf": "127.0.0.1 9"})
        assert os.environ.get("RTF_PLUGIN_PATH") is None
        outcome = run_command(tmp_path, "--test", "JointLimits", "--set", "part=left_arm")
        assert outcome.exit_code == ExitCode.FIXTURE
        assert outcome.verdict("JointLimits") is Verdict.BLOCKED
        assert "there is no robot /icubSim" in outcome.detail("JointLimits")
        assert "rtf simulator --nameserver" in outcome.detail("JointLimits")
