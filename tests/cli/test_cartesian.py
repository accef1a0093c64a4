"""``rtf cartesian`` as processes: a controller and a solver of a robot in the network, on real ports."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import ExitStack, closing
from typing import TYPE_CHECKING

import pytest

from rtf.bottle import Bottle, Property
from rtf.middleware.naming import configuration
from rtf.middleware.naming.server import NameServer
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.rpc import RpcClient
from rtf.robot.boards.server import ControlBoardServer
from rtf.robot.control_modes import ControlMode
from rtf.robot.device import make_device
from rtf.robot.devices.fake_board import FakeBoard
from rtf.robot.interfaces import ICartesianControl
from rtf.robot.kinematics import robot_chains
from rtf.robot.model import load_robot
from rtf.robot.publishing import PeriodicPublishing
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

CHAIN = robot_chains(load_robot("icub")).chain("left_arm", "2.5")
START = [-30.0, 30.0, 0.0, 45.0, 0.0, 0.0, 0.0]
LIMB = "/bot/cartesianController/left_arm"


class Lab:
    """A robot with a torso and an arm in this process, and the programs that use it."""

    def __init__(self, folder: Path, opened: ExitStack) -> None:
        self.folder = folder
        self.network = Network(configuration.find_names())
        self._opened = opened
        self._serve("torso", CHAIN.joints[2::-1])
        arm = self._serve("left_arm", CHAIN.joints[3:])
        arm.set_control_modes(ControlMode.POSITION_DIRECT)
        arm.set_positions(START)

    def _serve(self, part: str, joints: tuple[str, ...]) -> FakeBoard:
        board = FakeBoard(part)
        limits = f"(LIMITS (Min {'-95 ' * len(joints)}) (Max {'160 ' * len(joints)}))"
        board.open(Property.parse(f"(GENERAL (Joints {len(joints)}) (AxisName {' '.join(joints)})) {limits}"))
        server = self._opened.enter_context(closing(ControlBoardServer(board, f"/bot/{part}", network=self.network)))
        publishing = PeriodicPublishing(server, name=part, report=self.network.report)
        self._opened.callback(publishing.stop)
        return board

    def start(self, *words: str) -> tuple[subprocess.Popen[bytes], Path]:
        """Start a program, and return it with the file of its messages."""
        said = self.folder / f"{words[0]}.txt"
        with said.open("wb") as err:
            program = subprocess.Popen(
                [sys.executable, "-m", "rtf", "cartesian", *words],
                stdin=subprocess.DEVNULL,
                stderr=err,
                cwd=self.folder,
            )
        self._opened.callback(program.wait, 10.0)
        self._opened.callback(program.kill)
        return program, said

    def ready(self, *words: str) -> subprocess.Popen[bytes]:
        """Start a program, and wait until it is ready."""
        program, said = self.start(*words)
        eventually(lambda: "READY" in said.read_text() or program.poll() is not None, "it is not ready")
        assert "READY" in said.read_text(), said.read_text()
        return program


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Lab]:
    """A name server and a robot."""
    monkeypatch.setenv("YARP_CONFIG_HOME", str(tmp_path / "user"))
    for name in ("YARP_NAMESPACE", "YARP_PORT_PREFIX", "YARP_ROBOT_NAME", "RTF_CLOCK", "YARP_CLOCK"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
    with NameServer() as server, ExitStack() as opened:
        configuration.write_place(server.contact)
        yield Lab(tmp_path, opened)


def test_a_controller_with_a_solver_moves_the_robot(lab: Lab):
    """Both are programs; the torso stands; the solver ends when it is asked to, the controller by a signal."""
    solver = lab.ready("solver", "left_arm", "--robot", "bot", "--drawn", "(5 (0 0 -1) (0 0 1))")
    control = lab.ready("control", "left_arm", "--robot", "bot", "--solver", "/cartesianSolver/left_arm")
    asker = RpcClient("/asks", f"{LIMB}/rpc:i", network=lab.network)
    with closing(asker):
        eventually(
            lambda: asker.call(Bottle.parse("get ison"), timeout=5.0).to_text() == "[ack] [true]", "there is no solver"
        )
    where = Property.parse(f"(remote {LIMB}) (carrier tcp)")
    with closing(make_device("cartesiancontrollerclient", where, network=lab.network)) as client:
        arm = client.view(ICartesianControl)
        assert arm.active_joints() == (False,) * 3 + (True,) * 7
        target = CHAIN.pose([0, 0, 0, -40, 40, 10, 60, 10, -5, 5])[:3, 3]
        arm.go_to(target, 0.2)
        eventually(arm.motion_done, "the motion does not end")
        assert arm.desired().pose[:3] == pytest.approx(target, abs=2e-4)
        # The stream of poses may be behind the answer that the motion is done.
        eventually(lambda: arm.pose().vector[:3] == pytest.approx(target, abs=0.012), "the tip is not at its target")
    with RpcClient("/asks", "/cartesianSolver/left_arm/rpc", network=lab.network) as ends:
        assert ends.call(Bottle.parse("quit"), timeout=5.0).to_text() == "[ack]"
    assert solver.wait(20.0) == 0
    control.send_signal(signal.SIGTERM)
    assert control.wait(20.0) == 0


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("solver", "left_hand"), "has no chain 'left_hand'; its chains are"),
        (("control", "left_arm", "--robot", "nobody"), "/nobody/torso cannot be opened"),
        (("solver", "left_arm", "--robot", "bot", "--drawn", "(50 (0 0 -1) (0 0 1))"), "Drawn"),
        (("solver", "left_arm", "--context", "nothing"), "cartesianSolver.ini has no group [left_arm]"),
    ],
)
def test_what_cannot_be_started_is_reported(lab: Lab, words: tuple[str, ...], text: str):
    """With the thing, and an exit code."""
    program, said = lab.start(*words)
    assert program.wait(30.0) == (4 if "--context" in words else 1)
    assert text in said.read_text()


def test_a_solver_takes_the_command_line_of_the_original(lab: Lab):
    """With a file, whose group has its name, its robot and its settings."""
    (lab.folder / "solvers.ini").write_text(
        "[left_arm]\nname someSolver\nrobot bot\ntype left_v2.5\ndof (1 0 1)\nrest_pos (0 5)\nrest_weights (2 2)\n"
        "pose xyz\nmode cont\n"
    )
    lab.ready("solver", "--part", "left_arm", "--from", "solvers.ini")
    with RpcClient("/asks", "/someSolver/rpc", network=lab.network) as asker:
        answers = {
            word: asker.call(Bottle.parse(f"get {word}"), timeout=5.0).to_text()
            for word in ("dof", "pose", "mode", "resp", "resw")
        }
    assert answers["dof"] == "[ack] (1 0 1 1 1 1 1 1 1 1)"
    assert (answers["pose"], answers["mode"]) == ("[ack] [xyz]", "[ack] [cont]")
    assert answers["resp"].startswith("[ack] (0.0 5.0 0.0")
    assert answers["resw"].startswith("[ack] (2.0 2.0 0.0")
