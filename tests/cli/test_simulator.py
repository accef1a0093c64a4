"""``rtf simulator`` on the command line: settings, the list of faults, and commands to a running simulator."""

from __future__ import annotations

import json
import os
from importlib.util import find_spec
from typing import TYPE_CHECKING

import pytest

from icub import ICUB
from rtf.bottle import Dialect
from rtf.cli.tools import main
from rtf.middleware.naming import configuration
from rtf.middleware.naming.server import NameServer
from rtf.middleware.ports.network import Network
from rtf.simulator import program
from rtf.simulator.faults import KINDS

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from rtf.simulator.control_service import SimulatorService

Captured = pytest.CaptureFixture[str]


def simulator(words: list[str]) -> int:
    """Run ``rtf simulator`` with these words."""
    return main(["simulator", *words])


class TestStarting:
    """The settings of the command line."""

    @pytest.fixture(autouse=True)
    def started(self, monkeypatch: pytest.MonkeyPatch) -> list[program.Settings]:
        """The settings with which the simulator would be started."""
        found: list[program.Settings] = []
        monkeypatch.setattr(program, "run_simulator", lambda settings: found.append(settings) or 0)
        return found

    def test_nothing_said_is_a_whole_robot_in_real_time(self, started: list[program.Settings]):
        """Without options the settings are the defaults."""
        assert simulator([]) == 0
        assert started == [program.Settings(ICUB)]

    def test_everything_said(self, started: list[program.Settings], tmp_path: Path):
        """Each option sets its field of the settings."""
        words = "--robot /bot --parts head,left_arm --cameras auto --seed 5 --lockstep --clock /time --collision none"
        words += f" --dialect 4 --nameserver --ready-file {tmp_path / 'ready'}"
        assert simulator(words.split()) == 0
        (settings,) = started
        assert settings == program.Settings(
            ICUB,
            robot="bot",
            parts=("head", "left_arm"),
            seed=5,
            lockstep=True,
            cameras="auto",
            clock="/time",
            collision="none",
            dialect=Dialect.YARP4,
            nameserver=True,
            ready_file=tmp_path / "ready",
        )

    def test_cameras_alone_means_yes(self, started: list[program.Settings]):
        """``--cameras`` without a value means yes, and the factor may be infinite."""
        assert simulator(["--cameras", "--realtime-factor", "inf"]) == 0
        assert (started[0].cameras, started[0].factor) == ("yes", float("inf"))

    def test_rates_are_those_of_the_robot_unless_others_are_given(self, started: list[program.Settings]):
        """The rates of states and of cameras are set independently."""
        assert simulator(["--state-rate", "50"]) == simulator(["--camera-rate", "60"]) == 0
        assert [(one.state_rate, one.camera_rate) for one in started] == [(50.0, None), (None, 60.0)]

    @pytest.mark.parametrize(
        ("words", "hint"),
        [
            ("--parts arm", "there are head, left_arm"),
            ("--parts ,", "write the names of parts"),
            ("--realtime-factor 0", "write a number from 0.1 on, or inf"),
            ("--realtime-factor nan", "write a number from 0.1 on, or inf"),
            ("--realtime-factor fast", "write a number from 0.1 on, or inf"),
            ("--lockstep --realtime-factor 2", "not allowed with"),
            ("--state-rate 0", "write a number of Hz above 0, 1000 at most"),
            ("--camera-rate fast", "write a number of Hz above 0, 1000 at most"),
            ("--seed -1", "must not be negative"),
            ("--robot /", "is no name of a robot"),
            ("--clock clock", "is not a port name"),
            ("--dialect 2", "invalid choice: 2"),
            ("--cameras maybe", "invalid choice: 'maybe'"),
            ("dance", "unrecognized arguments: dance"),
        ],
    )
    def test_mistakes_are_reported(self, words: str, hint: str, started: list[program.Settings], capsys: Captured):
        """A wrong option ends with 4 and a hint, and no simulator is started."""
        with pytest.raises(SystemExit) as ended:
            simulator(words.split())
        assert ended.value.code == 4
        assert hint in capsys.readouterr().err
        assert started == []


class TestFaults:
    """The list of faults."""

    def test_all_of_them(self, capsys: Captured):
        """All kinds of faults are listed by layer, with their parameters."""
        assert simulator(["faults"]) == 0
        text = capsys.readouterr().out
        assert all(f"  {kind}  (" in text for kind in KINDS)
        assert text.index("PLANT") < text.index("ENCODER") < text.index("PROCESS")

    def test_one_of_them(self, capsys: Captured):
        """One kind is described with units, meaning and range of its parameters."""
        assert simulator(["faults", "jam"]) == 0
        text = capsys.readouterr().out
        assert "torque=400 Nm: the torque that would move it; 0 … 100000" in text
        assert "friction  (" not in text

    def test_for_programs(self, capsys: Captured):
        """``--json`` lists all kinds."""
        assert simulator(["faults", "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
        assert [one["kind"] for one in found] == [*KINDS]

    def test_a_kind_that_is_not_there(self, capsys: Captured):
        """The error about an unknown kind lists the known ones."""
        assert simulator(["faults", "quake"]) == 1
        assert "there are jam, friction" in capsys.readouterr().err


@pytest.mark.skipif(not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'")
class TestTalking:
    """Commands to a running simulator."""

    @pytest.fixture
    def service(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[SimulatorService]:
        """A simulated robot of one part in lockstep, found by the configuration."""
        from rtf.simulator.control_service import SimulatorService
        from rtf.simulator.robot import SimulatedRobot

        monkeypatch.setenv("YARP_CONFIG_HOME", str(tmp_path / "user"))
        for name in ("YARP_NAMESPACE", "YARP_PORT_PREFIX"):
            monkeypatch.delenv(name, raising=False)
        with NameServer() as server:
            configuration.write_place(server.contact)
            network = Network(configuration.find_names())
            with SimulatedRobot(ICUB, "bot", network=network, parts=("left_arm",), lockstep=True) as robot:
                made = SimulatorService(robot, network=network, end=os.abort)
                yield made
                made.close()

    def test_break_look_and_repair(self, service: SimulatorService, capsys: Captured):
        """A fault is injected, shown by ``status``, and cleared."""
        words = "inject encoder_drift l_elbow rate=0.5 --delay 2 --duration 500ms --robot bot"
        assert simulator(words.split()) == 0
        assert capsys.readouterr().out == "1\n"
        (active,) = service.injector.active
        assert (active.fault.kind, active.fault.target, active.begins, active.ends) == (
            "encoder_drift",
            "l_elbow",
            2.0,
            2.5,
        )
        assert active.fault.rate == 0.5
        assert simulator(["status", "--robot", "bot"]) == 0
        assert "encoder_drift l_elbow to come, from 2.000 s to 2.500 s" in capsys.readouterr().out
        assert simulator(["clear", "1", "--robot", "bot"]) == 0
        assert simulator(["clear", "--robot", "bot"]) == 0
        assert capsys.readouterr().out == "1\n0\n"
        assert service.injector.active == ()

    def test_refusals_are_reported(self, service: SimulatorService, capsys: Captured):
        """A refusal of the simulator is printed, with exit code 1."""
        assert simulator(["inject", "jam", "l_elbow", "force=1", "--robot", "bot"]) == 1
        assert "jam has no parameter force; its parameters: torque" in capsys.readouterr().err
        assert service.injector.active == ()

    @pytest.mark.parametrize(
        ("words", "hint"),
        [
            ("inject jam a b", "there is one target, a, and then 'b'"),
            ("inject jam l_elbow torque=much", "torque: 'much' is no number"),
            ("inject jam l_elbow --delay -1", "a duration must be positive"),
            ("inject", "the following arguments are required: KIND"),
            ("clear all", "'all' is no whole number"),
        ],
    )
    def test_mistakes_are_reported(self, words: str, hint: str, capsys: Captured):
        """A wrong command ends with 4 and a hint, before the simulator is asked."""
        with pytest.raises(SystemExit) as ended:
            simulator(words.split())
        assert ended.value.code == 4
        assert hint in capsys.readouterr().err

    def test_a_missing_simulator(self, service: SimulatorService, capsys: Captured):
        """The error about a missing simulator names its port."""
        assert service.robot.name == "bot"
        assert simulator(["status", "--robot", "nobody"]) == 1
        assert "/nobody/simulator/rpc:i" in capsys.readouterr().err
