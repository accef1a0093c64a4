"""A robot counts as simulated, and may move without permission, only if a simulator answers for its own ports."""

from __future__ import annotations

import os
from contextlib import ExitStack
from importlib.util import find_spec
from typing import TYPE_CHECKING

import pytest

from harness import MARK, Outcome, run_suite
from icub import ICUB
from rtf.bottle import Bottle, Property, Vocab
from rtf.middleware.errors import NameServerError
from rtf.middleware.naming import configuration
from rtf.middleware.naming.client import RemoteNames
from rtf.middleware.naming.configuration import find_network
from rtf.middleware.naming.server import NameServer
from rtf.middleware.ports.network import Network, listen
from rtf.middleware.ports.rpc import RpcServer
from rtf.robot.boards.server import ControlBoardDevice
from rtf.robot.devices.fake_board import FakeBoard
from rtf.robot_testing.guard import simulated
from rtf.robot_testing.guard.simulated import is_simulated
from rtf.simulator.control_client import BOARD_ENDS, SimulatorControl, control_port
from rtf.testing.events import Message, SubResultEnded, TestEnded
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

needs_physics = pytest.mark.skipif(
    not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"
)
MOVES = '''
from rtf.robot_testing import RobotTest, Safety
class Moves(RobotTest):
    """Moves what it finds."""
    safety = Safety.MOTION
    part = "head"
    def run(self):
        part = self.open_part(self.part)
        part.move([5.0], [1], speed=50.0)
class Insists(Moves):
    """Tries again where only a sub-result was skipped."""
    def run(self):
        for attempt in ("first", "second"):
            with self.subresult(attempt):
                super().run()
class MovesTheTorso(Moves):
    """Moves another part."""
    part = "torso"
'''


class Lab:
    """A name server of its own, the head ``/bot/head`` of a real robot, and further registrations."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        self.folder = folder
        self.stack = stack
        self.network: Network = find_network()
        self.board = FakeBoard("head", network=self.network)
        self.board.open(Property.parse("(GENERAL (Joints 3))"))
        stack.callback(self.board.close)
        server = ControlBoardDevice("server", network=self.network)
        server.open(Property({"name": "/bot/head", "period": 0.02}))
        server.attach({"head": self.board})
        stack.callback(server.close)

    def register_dead(self, *names: str) -> None:
        """Register names at an address where no program listens."""
        with listen("127.0.0.1", 0) as listening:
            number = listening.getsockname()[1]
        for name in names:
            self.network.names.register(name, carrier="tcp", host="127.0.0.1", port=number)

    def simulator(self, *parts: str) -> SimulatorControl:
        """Open a simulator of the same robot's name, with these parts."""
        from rtf.simulator.control_service import SimulatorService
        from rtf.simulator.robot import SimulatedRobot

        robot = self.stack.enter_context(SimulatedRobot(ICUB, "bot", network=self.network, parts=parts))
        service = SimulatorService(robot, network=self.network, end=os.abort)
        self.stack.callback(service.close)
        return self.stack.enter_context(SimulatorControl("bot", network=self.network))

    def answer(self, *groups: Bottle) -> None:
        """Answer all requests at the simulator's port with these groups."""
        server = RpcServer(control_port("bot"), lambda _: Bottle([Vocab("ok"), *groups]), network=self.network)
        self.stack.callback(server.close)

    def run(self, test: str) -> Outcome:
        """Run a test without permission."""
        return run_suite(self.folder, f"<test param='--robot bot'>{test}</test>", moves__py=MOVES)

    def moved(self) -> bool:
        """Return whether the head has left its position."""
        return bool(self.board.encoders().any())


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Lab]:
    """Name server and robot, in an environment that names neither."""
    monkeypatch.setenv(MARK, f"{os.getpid()}-{tmp_path.name}")
    monkeypatch.setenv("YARP_CONFIG_HOME", str(tmp_path / "user"))
    for name in ("YARP_NAMESPACE", "YARP_PORT_PREFIX", "RTF_CLOCK", "YARP_CLOCK", "YARP_ROBOT_NAME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.delenv("RTF_ALLOW_MOTION", raising=False)
    with NameServer() as names, ExitStack() as stack:
        configuration.write_place(names.contact)
        yield Lab(tmp_path, stack)


def refused(outcome: Outcome) -> str:
    """Return why the only test was skipped."""
    (ended,) = outcome.of(TestEnded)
    assert isinstance(ended, TestEnded)
    assert ended.verdict is Verdict.SKIPPED, [event.detail for event in outcome.of(Message)]
    return ended.detail


# Whole tests -----------------------------------------------------------------------------------------------------


def test_a_stale_registration_of_a_simulator_gives_no_permission(lab: Lab):
    """The robot behind the other names is real."""
    lab.register_dead(control_port("bot"))
    assert "--allow-motion" in refused(lab.run("Moves"))
    assert not lab.moved()


@needs_physics
def test_a_simulator_of_other_parts_gives_no_permission(lab: Lab):
    """A torso is simulated under the robot's name, but the head is real."""
    lab.simulator("torso")
    assert "--allow-motion" in refused(lab.run("Moves"))
    assert not lab.moved()


@needs_physics
def test_a_refusal_holds_for_the_whole_test(lab: Lab):
    """Also if it only ended a sub-result."""
    lab.simulator("torso")
    assert [event.verdict for event in lab.run("Insists").of(SubResultEnded)] == [Verdict.SKIPPED] * 2
    assert not lab.moved()


@needs_physics
def test_a_simulated_part_moves_without_permission(lab: Lab):
    """The simulator answers, and has the part."""
    lab.simulator("torso")
    outcome = lab.run("MovesTheTorso")
    assert [event.verdict for event in outcome.of(TestEnded)] == [Verdict.PASSED]


# The question itself ---------------------------------------------------------------------------------------------


@needs_physics
def test_ports_at_other_addresses_are_not_simulated(lab: Lab):
    """The simulator has such a part, but a robot has registered one of its names."""
    lab.simulator("torso", "left_arm")
    assert is_simulated(lab.network, "bot")
    assert is_simulated(lab.network, "bot", "torso")
    lab.register_dead("/bot/torso/command:i")
    assert not is_simulated(lab.network, "bot", "torso")
    assert is_simulated(lab.network, "bot", "left_arm")
    lab.register_dead("/bot/left_arm/rpc:i")
    assert not is_simulated(lab.network, "bot", "left_arm")


@needs_physics
def test_the_simulator_reports_its_addresses(lab: Lab):
    """They agree with those of the name server."""
    control = lab.simulator("torso")
    names = {control_port("bot"), *(f"/bot/torso/{end}" for end in BOARD_ENDS)}
    assert {contact.name: (contact.host, contact.port) for contact in control.serves("torso")} == {
        name: (found.host, found.port) for name in names if (found := lab.network.names.query(name)) is not None
    }
    assert [contact.name for contact in control.serves()] == [control_port("bot")]


def test_without_the_name_server_it_is_unknown():
    """A simulated robot is not taken for a real one, which would need permission to move."""
    with NameServer() as gone:
        network = Network(RemoteNames(gone.contact))
    with pytest.raises(NameServerError, match="does not answer"):
        is_simulated(network, "bot")


def test_without_a_simulator_no_part_is_simulated(lab: Lab):
    """It is a real robot."""
    assert not is_simulated(lab.network, "bot")
    assert not is_simulated(lab.network, "bot", "head")


def test_another_program_with_the_name_is_no_simulator(lab: Lab):
    """A program that answers yes to all requests, or only names the parts."""
    lab.answer()
    assert not is_simulated(lab.network, "bot")
    assert not is_simulated(lab.network, "bot", "head")


def test_a_simulator_on_another_host_is_none(lab: Lab):
    """The reported addresses have to agree with the host that answers."""
    own = lab.network.names.register("/bot/hand/rpc:i", carrier="tcp", host="192.0.2.1", port=10_400)
    lab.network.names.register("/bot/hand/command:i", carrier="tcp", host="192.0.2.1", port=10_401)
    groups = [Bottle(["/bot/hand/rpc:i", own.host, 10_400]), Bottle(["/bot/hand/command:i", own.host, 10_401])]
    here = Bottle([control_port("bot"), "127.0.0.1", 0])
    answer = [here, *groups]
    server = RpcServer(control_port("bot"), lambda _: Bottle([Vocab("ok"), *answer]), network=lab.network)
    lab.stack.callback(server.close)
    answer[0] = Bottle([control_port("bot"), server.contact.host, server.contact.port])
    assert is_simulated(lab.network, "bot")
    assert not is_simulated(lab.network, "bot", "hand")


def test_a_simulator_without_answers_is_none(lab: Lab, monkeypatch: pytest.MonkeyPatch):
    """The request has a short time-out."""
    monkeypatch.setattr(simulated, "PATIENCE", 0.2)
    lab.network.patience = 0.2
    with listen("127.0.0.1", 0) as silent:
        number = silent.getsockname()[1]
        lab.network.names.register(control_port("bot"), carrier="tcp", host="127.0.0.1", port=number)
        assert not is_simulated(lab.network, "bot")
