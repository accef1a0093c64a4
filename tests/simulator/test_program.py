"""The simulator as a program: the ports that it opens, its output and exit codes, and that nothing of it is left."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from rtf import clock
from rtf.bottle import Bottle, Dialect
from rtf.middleware.clocks.network_clock import LockstepClock
from rtf.middleware.naming import configuration
from rtf.middleware.naming.server import NameServer
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcClient
from rtf.simulator.control_client import SimulatorControl
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator

pytestmark = pytest.mark.skipif(
    not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"
)

PROGRAM = """
import sys
from pathlib import Path
from rtf.bottle import Dialect
from rtf.robot.model import load_robot
from rtf.simulator.program import Settings, run_simulator
{before}
sys.exit(run_simulator(Settings(load_robot("icub"), {settings})))
"""
BLIND = "import ctypes.util; ctypes.util.find_library = lambda name: None"
_LIMIT = 30.0


class Program:
    """One run of the program."""

    def __init__(self, folder: Path, settings: str, before: str) -> None:
        self._err = folder / f"stderr-{len([*folder.iterdir()])}.txt"
        with self._err.open("wb") as err:
            self.process = subprocess.Popen(
                [sys.executable, "-c", PROGRAM.format(before=before, settings=settings)],
                stdin=subprocess.DEVNULL,
                stderr=err,
                cwd=folder,
            )

    @property
    def said(self) -> str:
        """Its output so far."""
        return self._err.read_text(encoding="utf-8")

    def until(self, text: str) -> None:
        """Wait until its output has a text."""
        eventually(lambda: text in self.said or self.process.poll() is not None, f"{text!r} does not come", _LIMIT)
        assert text in self.said, self.said

    def end(self, *signals: signal.Signals) -> int:
        """Send signals, each after the report of the one before; wait for its end."""
        for number, one in enumerate(signals, 1):
            self.process.send_signal(one)
            eventually(
                lambda number=number: self.said.count(": ends") >= number or self.process.poll() is not None,
                "not heard",
            )
        code = self.process.wait(_LIMIT)
        assert "Traceback" not in self.said, self.said
        return code


class Lab:
    """A folder with a name server, and the programs that ran."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.programs: list[Program] = []

    def start(self, settings: str = "parts=('head',)", before: str = "") -> Program:
        """Start the program."""
        self.programs.append(Program(self.folder, settings, before))
        return self.programs[-1]

    def ready(self, settings: str = "parts=('head',)", before: str = "") -> Program:
        """Start the program, and wait until it is ready."""
        program = self.start(settings, before)
        program.until("READY")
        return program

    @property
    def network(self) -> Network:
        """The network of its name server."""
        return Network(configuration.find_names())

    @property
    def names(self) -> list[str]:
        """The registered names, without that of the name server."""
        return [name for name in (contact.name for contact in self.network.names.list()) if name not in _OWN]


_OWN = {"/root", "fallback"}


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Lab]:
    """A name server of the test; afterwards no program runs, and all names are unregistered."""
    monkeypatch.setenv("YARP_CONFIG_HOME", str(tmp_path / "user"))
    for name in ("YARP_NAMESPACE", "YARP_PORT_PREFIX"):
        monkeypatch.delenv(name, raising=False)
    with NameServer() as server:
        configuration.write_place(server.contact)
        made = Lab(tmp_path)
        yield made
        left = [program for program in made.programs if program.process.poll() is None]
        for program in left:
            program.process.kill()
            program.process.wait()
        assert [program.said for program in left] == []


def test_it_opens_says_what_and_is_ready(lab: Lab):
    """All ports are registered when it says READY, and unregistered when it ends."""
    program = lab.ready("robot='bot', parts=('head', 'left_arm')")
    line = next(line for line in program.said.splitlines() if line.startswith("READY"))
    assert line.startswith("READY bot in ")
    assert "2 parts, 19 streams, 0 cameras, clock /clock (factor 1), control /bot/simulator/rpc:i" in line
    assert "/bot/left_arm: rpc:i command:i state:o stateExt:o" in program.said
    expected = {f"/bot/{part}/{port}" for part in ("head", "left_arm") for port in ("rpc:i", "command:i", "state:o")}
    assert {
        *expected,
        "/bot/simulator/rpc:i",
        "/clock",
        "/bot/inertial",
        "/bot/FTs/measures:o",
        "/bot/left_hand/analog:o",
    } <= set(lab.names)
    assert program.end(signal.SIGTERM) == 0
    assert lab.names == []


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_it_in_order(lab: Lab, how: signal.Signals):
    """With exit code 0 and all names unregistered, also while a participant waits for the time."""
    program = lab.ready("parts=('head',), lockstep=True")
    with RpcClient("/waits", "/clock", network=lab.network) as client:
        client.call(Bottle(["join", "one"]))
        with clock.use(LockstepClock("/clock", "two", network=lab.network)):
            assert program.end(how) == 0
    assert f"{how.name}: ends" in program.said
    assert [name for name in lab.names if name != "/waits"] == []


def test_a_second_signal_ends_it_at_once(lab: Lab):
    """Although closing its ports hangs."""
    hangs = (
        "import threading, rtf.simulator.robot as icub\nicub.SimulatedRobot.close = lambda _: threading.Event().wait()"
    )
    program = lab.ready(before=hangs)
    assert program.end(signal.SIGINT, signal.SIGINT) == 2


def test_a_signal_while_it_starts(lab: Lab):
    """The ports that are open by then are closed."""
    early = "import os, signal, rtf.simulator.robot as icub\nmade = icub.SimulatedRobot.__init__\n"
    early += "def make(*a, **k):\n    os.kill(os.getpid(), signal.SIGTERM)\n    made(*a, **k)\n"
    program = lab.start(before=f"{early}icub.SimulatedRobot.__init__ = make")
    assert program.end() == 0
    assert "READY" not in program.said
    assert lab.names == []


def test_its_control_port_ends_it(lab: Lab):
    """A request to quit is answered, and the program ends."""
    program = lab.ready()
    with SimulatorControl(network=lab.network) as control:
        control.quit()
    assert program.end() == 0
    assert lab.names == []


def test_faults_of_the_process(lab: Lab):
    """A hang leaves the ports without answers, a crash leaves no process."""
    program = lab.ready()
    with SimulatorControl(network=lab.network) as control:
        control.inject("hang", delay=0.05)
        assert os.WIFSTOPPED(os.waitpid(program.process.pid, os.WUNTRACED)[1])
        program.process.send_signal(signal.SIGCONT)
        assert [one.kind for one in control.active()] == ["hang"]
        control.inject("crash", delay=0.05)
        assert program.process.wait(_LIMIT) == -signal.SIGKILL


def test_there_is_one_robot_of_a_name(lab: Lab):
    """The second program names the port that exists, and the first one goes on."""
    first = lab.ready()
    second = lab.start()
    assert second.end() == 1
    assert "there is a port /icubSim/simulator/rpc:i already" in second.said
    with SimulatorControl(network=lab.network) as control:
        assert control.status().name == "icubSim"
    assert first.end(signal.SIGTERM) == 0


def test_one_that_was_killed_can_be_started_again(lab: Lab):
    """It takes the names that the killed one has left."""
    lab.ready().process.kill()
    lab.programs[0].process.wait()
    assert lab.ready().end(signal.SIGTERM) == 0
    assert lab.names == []


def test_without_a_name_server(lab: Lab):
    """The program ends with an error that names the missing server."""
    with NameServer() as gone:
        configuration.write_place(gone.contact)
    program = lab.start()
    assert program.end() == 1
    assert "FAILED: icubSim could not be started" in program.said


def test_it_can_be_the_name_server_itself(lab: Lab):
    """At the configured address, so that no other program is needed."""
    with NameServer() as gone:
        configuration.write_place(gone.contact)
    program = lab.ready("parts=('head',), nameserver=True")
    assert f"name server /root at 127.0.0.1:{gone.contact.port}" in program.said
    assert f"'yarp conf 127.0.0.1 {gone.contact.port}'" in program.said
    with SimulatorControl(network=lab.network) as control:
        assert control.status().parts == ("head",)
    assert program.end(signal.SIGINT) == 0


def test_two_name_servers_at_a_place(lab: Lab):
    """The error says which option to leave out."""
    program = lab.start("nameserver=True")
    assert program.end() == 1
    assert "leave out --nameserver" in program.said


def test_the_file_that_says_it_is_ready(lab: Lab):
    """The file has the READY line, and is removed at the end."""
    program = lab.ready("parts=('head',), ready_file=Path('ready.txt')")
    assert (lab.folder / "ready.txt").read_text(encoding="utf-8").startswith("READY icubSim in ")
    assert program.end(signal.SIGTERM) == 0
    assert not (lab.folder / "ready.txt").exists()


def test_a_file_that_cannot_be_written(lab: Lab):
    """The error is reported, and the program ends."""
    program = lab.start("parts=('head',), ready_file=Path('nowhere/ready.txt')")
    assert program.end() == 1
    assert "nowhere/ready.txt" in program.said
    assert lab.names == []


def test_cameras_where_no_picture_can_be_made(lab: Lab):
    """The error names the packages to install; with ``auto`` the robot has no cameras."""
    program = lab.start("cameras='yes'", BLIND)
    assert program.end() == 1
    assert "install the Debian packages" in program.said
    program = lab.ready("cameras='auto', parts=('head',)", BLIND)
    assert "no cameras: no picture can be made" in program.said
    assert "0 cameras" in program.said
    assert program.end(signal.SIGTERM) == 0


def test_time_that_ends_with_an_error_ends_the_program(lab: Lab):
    """An error in the loop is reported, and the exit code is that of a failure."""
    breaks = "import rtf.simulator.boards as boards\n"
    breaks += (
        "def step(self):\n    if self.tick > 50: raise ArithmeticError('the physics exploded')\n    self.tick += 1\n"
    )
    program = lab.start(before=f"{breaks}boards.Boards.step = step")
    assert program.end() == 1
    assert "the physics exploded" in program.said
    assert lab.names == []


def test_another_dialect_and_another_clock(lab: Lab):
    """The options set the dialect and the name of the clock."""
    program = lab.ready("parts=('head',), dialect=Dialect.YARP4, clock='/sim/clock', factor=float('inf')")
    assert "/sim/clock" in lab.names
    assert "clock /sim/clock (factor inf)" in program.said
    network = lab.network
    network.dialect = Dialect.YARP4
    with SimulatorControl(network=network) as control:
        assert control.status().clock == "/sim/clock"
    heard: list[Bottle] = []
    with Port("/hears", lambda delivery: heard.append(delivery.read()), network=network) as port:
        RpcClient("", "/sim/clock", network=network).close()
        with Port("/pulls", network=network):
            from rtf.middleware.ports import remote
            from rtf.middleware.wire.contact import Contact

            remote.connect(network, Contact("/sim/clock"), Contact(port.name))
        eventually(lambda: len(heard) > 2, "the time is not reported")
    assert program.end(signal.SIGTERM) == 0
