"""``rtf ros1``: a robot on a topic until a signal; what it refuses, and what it says without a master or rosbags."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from typing import TYPE_CHECKING, Any

import pytest
from ros1.conftest import Ros

from rtf.middleware.naming import configuration
from rtf.middleware.naming.server import NameServer
from rtf.middleware.ports.network import Network
from rtf.robot.devices.fake_board import FakeBoard
from rtf.ros1.messages import JointState
from rtf.ros1.node import Node
from served import PATIENT, served
from waiting import eventually

if TYPE_CHECKING:
    from pathlib import Path

WITHOUT_ROSBAGS = "import sys; sys.modules['rosbags'] = None; sys.modules['rosbags.interfaces'] = None; "


def run(*words: str, before: str = "") -> subprocess.CompletedProcess[str]:
    """Run the command to its end."""
    return subprocess.run(program(*words, before=before), capture_output=True, text=True, check=False, timeout=60)


def program(*words: str, before: str) -> list[str]:
    """Return the command as a process that runs ``before`` first."""
    return [sys.executable, "-c", f"{before}\nimport sys\nfrom rtf.cli.tools import main\nsys.exit(main({[*words]!r}))"]


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ((), "nothing to publish: name --parts, --image, --wrench or --imu"),
        (("--image", "camera"), "'camera' is not /PORT=TOPIC"),
        (("--wrench", "/foot="), "'/foot=' is not /PORT=TOPIC"),
    ],
)
def test_wrong_words_are_refused(words: tuple[str, ...], complaint: str):
    """With the usage."""
    done = run("ros1", *words)
    assert done.returncode == 4
    assert complaint in done.stderr


def test_without_a_master_it_fails():
    """And says where it was looked for."""
    done = run("ros1", "--parts", "arm", "--master", "http://127.0.0.1:9")
    assert done.returncode == 1
    assert "FAILED: the node rtf could not be started: http://127.0.0.1:9 does not answer getPid" in done.stderr


def test_without_rosbags_it_says_what_to_install():
    """In one line."""
    done = run("ros1", "--parts", "arm", "--master", "http://127.0.0.1:9", before=WITHOUT_ROSBAGS)
    assert done.returncode == 1
    assert "ROS 1 needs the package rosbags: pip install 'rtf[ros]'" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_robot_is_published_until_a_signal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """All states of a part; then the topic is gone."""
    ros = Ros(str(tmp_path))
    monkeypatch.setenv("YARP_CONFIG_HOME", str(tmp_path))
    for name in ("YARP_NAMESPACE", "YARP_PORT_PREFIX", "YARP_CLOCK", "RTF_CLOCK", "ROS_HOSTNAME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("ROS_MASTER_URI", ros.uri)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
    got: list[Any] = []
    with ros.at_work(), NameServer() as server, Node("listener") as listener:
        configuration.write_place(server.contact)
        network = Network(configuration.find_names())
        listener.subscribe("/lab/joint_states", JointState, got.append)
        board = FakeBoard("board", network=network)
        words = ("ros1", "--robot", "robot", "--parts", "arm", "--node", "bridge", "--namespace", "/lab")
        with served(board, "/robot/arm", network=network, period=0.01):
            with subprocess.Popen(program(*words, before=PATIENT), stderr=-1, text=True) as bridge:
                assert bridge.stderr is not None
                assert bridge.stderr.readline() == "READY the node bridge\n"
                eventually(lambda: len(got) > 20, "no states came")
                bridge.send_signal(signal.SIGTERM)
                assert bridge.stderr.read() == "SIGTERM: ends\n"
            assert bridge.returncode == 0
        assert not [one for one in listener.master.call("getSystemState")[0] if one[0] == "/lab/joint_states"]
