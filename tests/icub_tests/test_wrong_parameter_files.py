"""A parameter file with one error: what ``testrunner validate`` and a run report."""

from __future__ import annotations

from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

import pytest

from harness import Outcome, run_command, write_files
from rtf.middleware.naming import configuration
from rtf.middleware.naming.configuration import find_network
from rtf.middleware.naming.server import NameServer
from rtf.robot.devices.fake_board import FakeBoard
from rtf.testing.events import Message, ParametersResolved, PhaseStarted, TestEnded
from rtf.testing.verdict import ExitCode, Phase, Verdict
from served import served

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

#: Wrong whatever the robot is: the file, the line of it that is meant (0: none), and the hint.
FILES = {
    "unknown_key": ("part head\nsped 20\n", 2, "did you mean 'speed'?"),
    "wrong_type": ("part head\nspeed fast\n", 2, "speed: element 0: fast is no "),
    "joint_by_name": ("part head\njoints (joint1)\n", 2, "joints: element 0: joint1 is no "),
    "out_of_range": ("part head\n\nspeed -5\n", 3, "-5 is not at least 0.1 deg/s"),
    "missing_include": ("[include lost.ini]\npart head\n", 1, "there is no file 'lost.ini'; tried "),
    "missing_file": (None, 0, "missing_file.ini: not found\n"),
    "too_few_values": (
        "part head\njoints (0 1 2)\nspeed (20 20)\n",
        3,
        "speed has 2 values; give one, or one for each",
    ),
    "values_of_a_leg": ("joints (0 1 2 3 4 5)\nspeed (9 9 9 9)\n", 2, "speed has 4 values; give one, or one for each"),
    "values_that_differ": ("lower (1 1)\nupper (9 9 9)\n", 1, "of the 3 joints that upper has values for"),
    "swapped_limits": ("lower (-9 5)\nupper (9 1)\n", 2, "upper: element 1 is 1; it has to be above that of lower, 5"),
    "too_few_targets": ("part head\njoints 3\ntarget 5 5\n", 3, "target has 2 values; give one, or one for each"),
    "small_matrix": ("joints (0 1 2)\nmatrix (1 0 0 1)\n", 2, "matrix has 4 numbers; 3 joints need 9"),
    "no_rate": ("[PORTS]\n/bot/head/state:o 100\n", 1, "a line has a port, its rate and tolerance in Hz"),
    "no_ports": ("time 1\n\n[PORTS]\n", 3, "[PORTS] names nothing; leave it out"),
    "no_such_fault": ("part head\ninject nonsense\n", 2, "inject: there is no fault 'nonsense'; there are jam, "),
    "no_such_victim": ('part head\ninject "jam neck_yow"\n', 2, "has no joint 'neck_yow'; did you mean 'neck_yaw'?"),
    "no_such_number": ('inject "jam l_elbow force=3"\n', 1, "jam has no parameter force; its parameters: torque"),
}
#: The tests that some of the files are for; all others are for JointLimits.
TESTS = {
    "too_few_targets": "MotorTest",
    "small_matrix": "OpticalEncodersConsistency",
    "no_rate": "PortsFrequency",
    "no_ports": "PortsFrequency",
}
#: Wrong for this robot, which has to be asked: the file, the value that is meant, and the hint.
ROBOT_FILES = {
    "no_such_part": ("part left_wing\n", "part", "/bot/left_wing cannot be opened: "),
    "no_such_joint": ("part head\njoints (0 99)\n", "joints", "head has no joint 99; it has 0 to 2: joint0, "),
    "too_many_values": ("part head\nspeed (9 9)\n", "speed", "give one, or one for each of the 3 joints"),
}


@dataclass
class Bench:
    """The reports on a suite with one test for each file, and the positions of the joints afterwards (deg)."""

    folder: Path
    validated: Outcome
    ran: Outcome
    positions: list[float]

    def validation(self, test: str) -> str:
        """All that the validation said of a test."""
        _, _, text = self.validated.stderr.partition(f" error: test {test}: ")
        return text.partition("\nsuite.xml:")[0] + "\n"

    def said(self, test: str) -> str:
        """All that the run said of a test."""
        (end,) = self.ran.of(TestEnded, test=f"s/{test}")
        return "\n".join([end.detail, *(event.detail for event in self.ran.of(Message, test=f"s/{test}"))])


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    """The suite, validated without a robot and run on one of three joints that may be moved."""
    folder = tmp_path_factory.mktemp("wrong")
    names = [*FILES, *ROBOT_FILES]
    tests = "".join(
        f'\n<test name="{name}" param="--from {name}.ini"> {TESTS.get(name, "JointLimits")} </test>' for name in names
    )
    texts = {name: text for name, (text, *_) in {**FILES, **ROBOT_FILES}.items() if text is not None}
    write_files(folder, {"suite.xml": f'<suite name="s">{tests}\n</suite>'})
    write_files(folder, {f"{name}.ini": text for name, text in texts.items()})
    validated = run_command(folder, "validate", "suite.xml")
    with pytest.MonkeyPatch.context() as patch, ExitStack() as opened:
        patch.setenv("YARP_CONFIG_HOME", str(folder / "user"))
        configuration.write_place(opened.enter_context(NameServer()).contact)
        board = opened.enter_context(head())
        words = ("--suite", "suite.xml", "--allow-motion", "--answer", "yes")
        ran = run_command(folder, *words, YARP_ROBOT_NAME="bot", RTF_CLOCK="", YARP_CLOCK="")
        yield Bench(folder, validated, ran, board.encoders().tolist())


@contextmanager
def head() -> Iterator[FakeBoard]:
    """``/bot/head``, a part of three joints."""
    network = find_network()
    board = FakeBoard("head", network=network)
    with closing(network.names), served(board, "/bot/head", network=network, period=0.02):
        yield board


@pytest.mark.parametrize("kind", FILES)
def test_what_is_wrong_on_any_robot_is_known_before_a_run(bench: Bench, kind: str):
    """The report has suite, test, file, line and a hint; the run reports the same, and does not set the test up."""
    _, line, hint = FILES[kind]
    place = f"{bench.folder / kind}.ini:{line}" if line else f"{kind}.ini"
    for text in (bench.validation(kind), bench.said(kind)):
        assert hint in text
        assert place in text
    assert f"suite.xml:{[*FILES].index(kind) + 2}:1: error: test {kind}: " in bench.validated.stderr
    assert bench.ran.verdict(kind) is Verdict.ERROR
    assert not bench.ran.of(PhaseStarted, test=f"s/{kind}", phase=Phase.SETUP)


@pytest.mark.parametrize("kind", ROBOT_FILES)
def test_what_is_wrong_for_this_robot_is_known_before_it_moves(bench: Bench, kind: str):
    """The robot is asked in setup: the test never runs; its error names value and hint, and the record the place."""
    _, key, hint = ROBOT_FILES[kind]
    assert hint in bench.said(kind)
    assert bench.ran.verdict(kind) is Verdict.ERROR
    (resolved,) = bench.ran.of(ParametersResolved, test=f"s/{kind}")
    (row,) = [row for row in resolved.parameters if row["name"] == key]
    line = 1 + (key != "part")
    assert row["source"] == f"{bench.folder / kind}.ini:{line}"
    assert row["source"] in bench.said(kind)
    assert not bench.ran.of(PhaseStarted, test=f"s/{kind}", phase=Phase.RUN)


def test_nothing_has_moved(bench: Bench):
    """All of it was allowed, and the joints are where they were."""
    assert bench.validated.exit_code == ExitCode.USAGE
    assert f"{len(FILES)} errors" in bench.validated.stdout
    assert bench.ran.exit_code == ExitCode.FAILURES
    assert bench.positions == [0.0, 0.0, 0.0]
