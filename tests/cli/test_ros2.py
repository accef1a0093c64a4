"""``rtf ros2``: a robot on topics until a signal, which obeys only with permission; and what it refuses."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest

from rtf.middleware.naming import configuration
from rtf.middleware.naming.server import NameServer
from rtf.middleware.ports.network import Network
from rtf.robot.devices.fake_board import FakeBoard
from rtf.ros2.description import read_joints
from rtf.ros2.messages import Float64MultiArray, JointState, String
from rtf.ros2.node import Node, default_qos
from served import PATIENT, served
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

WITHOUT_DDS = "import sys; sys.modules['cyclonedds'] = None; "
PATIENT_COMMANDS = f"{PATIENT}from rtf.ros2 import commands\ncommands._CHANGE = 20.0\n"
WORDS = ("ros2", "--robot", "robot", "--parts", "arm", "--node", "bridge", "--namespace", "/lab")


def run(*words: str, before: str = "") -> subprocess.CompletedProcess[str]:
    """Run the command to its end."""
    return subprocess.run(program(*words, before=before), capture_output=True, text=True, check=False, timeout=60)


def program(*words: str, before: str) -> list[str]:
    """Return the command as a process that runs ``before`` first."""
    return [sys.executable, "-c", f"{before}\nimport sys\nfrom rtf.cli.tools import main\nsys.exit(main({[*words]!r}))"]


@pytest.fixture
def board(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeBoard]:
    """A board that is not simulated, in a network and a domain of its own."""
    monkeypatch.setenv("YARP_CONFIG_HOME", str(tmp_path))
    for name in ("YARP_NAMESPACE", "YARP_PORT_PREFIX", "YARP_CLOCK", "RTF_CLOCK", "CYCLONEDDS_URI"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("ROS_DOMAIN_ID", str(1 + os.getpid() % 200))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
    with NameServer() as server:
        configuration.write_place(server.contact)
        network = Network(configuration.find_names())
        made = FakeBoard("board", network=network)
        with served(made, "/robot/arm", network=network, period=0.01):
            yield made


@contextmanager
def running(*words: str) -> Iterator[None]:
    """Run the command until a signal ends it."""
    command = program(*WORDS, *words, before=PATIENT_COMMANDS)
    with subprocess.Popen(command, stderr=-1, text=True) as running:
        assert running.stderr is not None
        assert running.stderr.readline() == "READY the node bridge\n"
        try:
            yield
        finally:
            running.send_signal(signal.SIGTERM)
        assert running.stderr.read() == "SIGTERM: ends\n"
    assert running.returncode == 0


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ((), "nothing to publish: name --parts, --image"),
        (("--image", "/camera=image", "--commands"), "argument --commands: name the --parts that obey"),
    ],
)
def test_wrong_words_are_refused(words: tuple[str, ...], complaint: str):
    """With the usage."""
    done = run("ros2", *words)
    assert done.returncode == 4
    assert complaint in done.stderr


def test_without_dds_it_says_what_to_install():
    """In one line."""
    done = run("ros2", "--parts", "arm", before=WITHOUT_DDS)
    assert done.returncode != 0
    assert "ROS 2 needs the package cyclonedds: pip install 'rtf[dds]'" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_real_robot_obeys_with_permission_only(board: FakeBoard):
    """Else the command is not even started."""
    done = run(*WORDS, "--commands", before=PATIENT)
    assert done.returncode == 1
    assert "/robot/arm is not simulated: with --allow-motion it obeys whatever is on the topics" in done.stderr
    with Node("user") as user, running("--commands", "--allow-motion"):
        there = user.publisher("/lab/arm_position_controller/commands", Float64MultiArray)
        assert there.await_reader(20.0)
        there.publish(Float64MultiArray(data=[0.1, 0.0, 0.0]))
        eventually(lambda: board.encoders()[0] > 5.7, "it does not arrive")


def test_without_commands_nothing_can_be_moved(board: FakeBoard):
    """States and the description are there, nobody listens; a description of one's own may be published."""
    states: list[JointState] = []
    texts: list[str] = []
    with Node("user") as user:
        user.subscribe("/lab/joint_states", JointState, states.append)
        latched = default_qos(depth=1, latched=True)
        user.subscribe("/lab/robot_description", String, lambda message: texts.append(message.data), latched)
        with running():
            eventually(lambda: len(states) > 20 and texts, "nothing came")
            there = user.publisher("/lab/arm_position_controller/commands", Float64MultiArray)
            assert not there.await_reader(0.3)
    assert [*read_joints(texts[0])] == states[0].name == ["joint0", "joint1", "joint2"]
