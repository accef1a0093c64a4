"""``rtf gaze`` as a process: the controller of a simulated robot in the network, in real time, on real ports."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from contextlib import ExitStack, closing
from importlib.util import find_spec
from typing import TYPE_CHECKING

import pytest

from gaze_bench import EYES
from rtf.bottle import Bottle, Property, Vocab
from rtf.middleware.naming import configuration
from rtf.middleware.naming.server import NameServer
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.rpc import RpcClient
from rtf.robot.device import make_device
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import FixationPoint, IEncoders, IGazeControl, StereoPixels
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

pytestmark = pytest.mark.skipif(
    not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"
)


class Lab:
    """A folder, a network with a name server, and programs in it."""

    def __init__(self, folder: Path, opened: ExitStack) -> None:
        self.folder = folder
        self.network = Network(configuration.find_names())
        self._opened = opened

    def start(self, *words: str) -> tuple[subprocess.Popen[bytes], Path]:
        """Start a program, and return it with the file of its messages."""
        said = self.folder / f"{len(list(self.folder.iterdir()))}.txt"
        with said.open("wb") as err:
            program = subprocess.Popen(
                [sys.executable, "-m", "rtf", *words], stdin=subprocess.DEVNULL, stderr=err, cwd=self.folder
            )
        self._opened.callback(program.wait, 10.0)
        self._opened.callback(program.kill)
        return program, said

    def ready(self, *words: str) -> tuple[subprocess.Popen[bytes], Path]:
        """Start a program, and wait until it is ready."""
        program, said = self.start(*words)
        eventually(lambda: "READY" in said.read_text() or program.poll() is not None, "it is not ready", 30.0)
        assert "READY" in said.read_text(), said.read_text()
        return program, said

    def gaze(self, opened: ExitStack) -> IGazeControl:
        """Return a client of the controller."""
        where = Property.parse("(remote /iKinGazeCtrl) (carrier tcp)")
        client = opened.enter_context(closing(make_device("gazecontrollerclient", where, network=self.network)))
        return client.view(IGazeControl)


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    """A name server and a robot without a controller: head and torso."""
    folder = tmp_path_factory.mktemp("gaze")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("YARP_CONFIG_HOME", str(folder / "user"))
        for name in ("YARP_NAMESPACE", "YARP_PORT_PREFIX", "YARP_ROBOT_NAME", "RTF_CLOCK", "YARP_CLOCK"):
            patch.delenv(name, raising=False)
        patch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
        with NameServer() as server, ExitStack() as opened:
            configuration.write_place(server.contact)
            lab = Lab(folder, opened)
            lab.ready("simulator", "--robot", "icubSim", "--parts", "head,torso", "--collision", "none")
            yield lab


def test_a_robot_is_moved_as_by_the_original(lab: Lab):
    """With the shipped file of this robot; a signal ends the program in the middle of a motion, and the eyes stop."""
    program, said = lab.ready("gaze", "--from", "configSim.ini", "--imu::stabilization_gain", "5")
    assert said.read_text().startswith("imu::stabilization_gain is not used: this controller has no such setting\n")
    point = EYES.point_of((10.0, 5.0, 6.0))
    with ExitStack() as opened:
        gaze = lab.gaze(opened)
        assert (gaze.vor_gain(), gaze.ocr_gain()) == (1.0, 0.0)  # the gyroscope was found
        left, right = (tuple(gaze.pixel_of(eye, point)) for eye in ("left", "right"))
        gaze.look_at(StereoPixels(left, right))
        eventually(gaze.motion_done, "the motion does not end")
        assert gaze.angles_of(gaze.fixation_point().values) == pytest.approx(gaze.angles_of(point), abs=0.5)
        gaze.look_at(FixationPoint(EYES.point_of((-30.0, 0.0, 6.0))))
        eventually(lambda: not gaze.motion_done(), "the motion does not begin")
        program.send_signal(signal.SIGTERM)
        assert program.wait(20.0) == 0
    lines = said.read_text().splitlines()
    assert lines[1:] == ["READY /iKinGazeCtrl", "SIGTERM: ends"]
    board = make_device("remote_controlboard", Property.parse("(remote /icubSim/head) (local /l)"), network=lab.network)
    with closing(board):
        encoders = board.view(IEncoders)
        eventually(lambda: max(abs(encoders.encoder_speeds()[3:])) < 0.5, "the eyes do not stop")


def test_a_robot_without_torso_and_gyroscope(lab: Lab):
    """By options, which go before the file; it ends by a request."""
    (lab.folder / "mine.ini").write_text("robot nobody\nsaccades on\n[imu]\nmode off\nfilter on\n")
    words = ("--robot", "icubSim", "--from", "mine.ini", "--torso", "off", "--saccades", "off")
    program, said = lab.ready("gaze", *words)
    assert re.match(r".*mine\.ini:5(:\d+)?: imu::filter is not used", said.read_text())
    with ExitStack() as opened:
        gaze = lab.gaze(opened)
        assert (gaze.vor_gain(), gaze.ocr_gain(), gaze.saccades()) == (0.0, 1.0, False)
        with pytest.raises(RefusedError):
            gaze.set_stabilization(True)
    with RpcClient("", "/iKinGazeCtrl/rpc", network=lab.network) as client:
        assert client.call(Bottle(["quit"])) == Bottle([Vocab("bye")])
    assert program.wait(20.0) == 0


@pytest.mark.parametrize(
    ("words", "code", "text"),
    [
        (("--robot", "nobody", "--ping_robot_tmo", "0.1"), 1, "there is no /nobody/head/state:o, /nobody/torso"),
        (("--robot", "icubSim", "--head_version", "v9"), 1, "head_version: '9' is no version"),
        (("--robot", "icubSim", "--imu::source_port_name", "/gone"), 1, "there is no /gone/measures:o; start it"),
        (("--from", "nothing.ini"), 4, "nothing.ini"),
    ],
)
def test_what_cannot_be_started_is_reported(lab: Lab, words: tuple[str, ...], code: int, text: str):
    """With the thing, and an exit code."""
    program, said = lab.start("gaze", *words)
    assert program.wait(30.0) == code, said.read_text()
    assert text in said.read_text()


def test_a_signal_ends_the_wait_for_a_robot(lab: Lab):
    """It does not last until the robot comes."""
    program, said = lab.start("gaze", "--robot", "nobody", "--imu::unknown", "1")
    eventually(lambda: "unknown" in said.read_text(), "it does not start", 30.0)
    program.send_signal(signal.SIGINT)
    assert program.wait(20.0) == 0
    assert "FAILED" not in said.read_text()
