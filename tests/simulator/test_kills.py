"""``kill -9`` of a simulator in mid-motion, and of clients in all control modes.

``RTF_TORTURE_ROUNDS`` sets how many times the simulator is killed.
"""

from __future__ import annotations

import os
import random
import subprocess
import sys
from contextlib import ExitStack
from importlib.util import find_spec
from typing import TYPE_CHECKING, Self

import numpy as np
import pytest

from icub import ICUB, INDEX
from rtf import clock
from rtf.middleware.naming.client import RemoteNames
from rtf.middleware.naming.server import NameServer
from rtf.middleware.ports.network import Network
from rtf.robot.boards.client import connect
from rtf.robot.control_modes import ControlMode
from rtf.robot.errors import RobotError
from rtf.robot.yarp3.client import RemoteControlBoard
from rtf.simulator.robot import SimulatedRobot
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator

pytestmark = pytest.mark.skipif(
    not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"
)

ROUNDS = int(os.environ.get("RTF_TORTURE_ROUNDS", "3"))
_NETWORK = """
import sys
from rtf import clock
from rtf.middleware.wire.contact import Contact
from rtf.middleware.naming.client import RemoteNames
from rtf.middleware.ports.network import Network

network = Network(RemoteNames(Contact("/root", "127.0.0.1", int(sys.argv[1]), "tcp")))
"""
_SIMULATOR = f"""{_NETWORK}
from rtf.robot.model import load_robot
from rtf.simulator.robot import SimulatedRobot
with SimulatedRobot(load_robot("icub"), network=network, parts=("head",), factor=2.0):
    print("ready", flush=True)
    while True:
        clock.sleep(60.0)
"""
_CLIENT = f"""{_NETWORK}
from rtf.robot.boards.client import connect
from rtf.robot.control_modes import ControlMode

client = connect("/icubSim/left_arm", carrier="tcp", network=network)
modes = (
    ControlMode.TORQUE, ControlMode.POSITION, ControlMode.VELOCITY,
    ControlMode.POSITION_DIRECT, ControlMode.PWM, ControlMode.CURRENT,
)
client.set_control_modes(modes, [2, 3, 4, 5, 6, 7])
client.set_reference_speeds(15.0, 3)
client.position_move(75.0, 3)
for step in range(10**9):
    client.set_reference_torques(0.5, 2)
    client.velocity_move(4.0, 4)
    client.set_positions(min(5.0, step / 4), 5)
    client.set_reference_duty_cycles(2.5, 6)
    client.set_reference_currents(0.05, 7)
    if step == 25:
        print("ready", flush=True)
    clock.sleep(0.01)
"""


class Program:
    """A process that says when it is ready, and ends only by force."""

    def __init__(self, text: str, server: NameServer) -> None:
        words = [sys.executable, "-c", text, str(server.contact.port)]
        self.process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)

    def ready(self) -> Self:
        """Wait until it says that it is ready."""
        assert self.process.stdout is not None
        assert self.process.stdout.readline() == "ready\n"
        return self

    def kill(self) -> None:
        """Kill it with SIGKILL."""
        with self.process:  # which waits for it and closes its pipe
            self.process.kill()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.kill()


@pytest.fixture
def server(tmp_path, monkeypatch: pytest.MonkeyPatch) -> Iterator[NameServer]:
    """A name server that all processes know."""
    monkeypatch.setenv("YARP_RUNTIME_DIR", str(tmp_path))
    with NameServer() as server:
        yield server


@pytest.fixture
def network(server: NameServer) -> Iterator[Network]:
    """The network of this process."""
    names = RemoteNames(server.contact)
    yield Network(names, report=lambda _sentence: None)
    names.close()


def moving(client: RemoteControlBoard, target: float) -> bool:
    """Return whether the neck moves; a move is commanded if it does not."""
    try:
        if client.target_positions(2)[0] != target:
            client.set_reference_speeds(30.0, 2)
            client.position_move(target, 2)
        return abs(client.encoder(2)) > 1.0
    except RobotError:
        return False


@pytest.mark.torture
@pytest.mark.timeout(60 + 10 * ROUNDS)
def test_a_simulator_that_is_killed_in_mid_motion_comes_back(server: NameServer, network: Network):
    """It has the same names, is at home and takes commands, and a client that was connected continues with it."""
    chance = random.Random(20261121)
    with ExitStack() as opened:
        simulator = opened.enter_context(Program(_SIMULATOR, server)).ready()
        client = opened.enter_context(connect("/icubSim/head", carrier="tcp", network=network))
        for number in range(ROUNDS):
            target = 40.0 if number % 2 else -40.0
            eventually(lambda: moving(client, target), f"round {number}: the robot does not move")  # noqa: B023
            clock.sleep(chance.uniform(0.0, 0.2))  # the moment of the death is what is varied
            simulator.kill()
            simulator = opened.enter_context(Program(_SIMULATOR, server)).ready()
            with connect("/icubSim/head", carrier="tcp", network=network) as another:
                eventually(lambda: not fails(another), f"round {number}: no state comes")
                assert abs(another.encoder(2)) < 0.5, f"round {number}: it is not at home"
                assert another.control_modes() == (ControlMode.POSITION,) * 6
                assert another.motion_done()


def fails(client: RemoteControlBoard) -> bool:
    """Return whether the board does not answer."""
    try:
        client.encoders()
    except RobotError:
        return True
    return False


def test_a_client_that_is_killed_leaves_every_joint_safe(server: NameServer, network: Network):
    """Speeds, torques, currents and duty cycles end; a move is finished, and a direct position held."""
    with ExitStack() as opened:
        robot = opened.enter_context(SimulatedRobot(ICUB, network=network, parts=("left_arm",), factor=1.0))
        boards, torque = robot.simulation.boards, robot.simulation.data.ctrl
        driven = [INDEX[name] for name in ("l_shoulder_yaw", "l_wrist_yaw", "l_hand_finger")]
        prosup, elbow, wrist = (INDEX[name] for name in ("l_wrist_prosup", "l_elbow", "l_wrist_pitch"))
        victim = opened.enter_context(Program(_CLIENT, server)).ready()
        eventually(lambda: abs(boards.velocity[prosup] - 4.0) < 1.0, "the joint has not reached its speed")
        with robot.simulation.lock:
            assert (torque[driven] != 0).all()
            assert boards.position[elbow] < 70.0
        victim.kill()
        dead = robot.simulation.now
        eventually(lambda: robot.simulation.now > dead + 0.7, "time stands still")
        # A motor that still creeps brakes itself.
        eventually(lambda: np.abs(torque[driven]).max() < 1e-5, "the torques do not end")
        with robot.simulation.lock:
            # A single count of its encoder shows as 0.69 deg/s; its speed was 4 deg/s.
            assert boards.velocity[prosup] == pytest.approx(0.0, abs=0.8)
            rested = float(boards.position[prosup])
        eventually(lambda: robot.simulation.now > dead + 2.5, "time stands still")
        with robot.simulation.lock:
            assert boards.position[prosup] == pytest.approx(rested, abs=0.2)
            assert boards.position[elbow] == pytest.approx(75.0, abs=0.2)
            assert boards.position[wrist] == pytest.approx(5.0, abs=0.2)
            assert boards.mode[prosup] == ControlMode.VELOCITY
