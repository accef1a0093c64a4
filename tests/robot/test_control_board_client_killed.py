"""A client whose board is killed, and comes back."""

from __future__ import annotations

import subprocess
import sys
from contextlib import ExitStack
from typing import TYPE_CHECKING

import pytest

from rtf.middleware.naming.client import RemoteNames
from rtf.middleware.naming.server import NameServer
from rtf.middleware.network import Network
from rtf.robot.client.control_board import connect
from rtf.robot.control_modes import ControlMode
from rtf.robot.errors import (
    NoAnswerError,
    StaleStateError,
)
from waiting import eventually

from .scripted_board import raises

if TYPE_CHECKING:
    from collections.abc import Iterator


CARRIERS = ("tcp", "fast_tcp", "udp")
SERVER = """
import sys
from rtf import clock
from rtf.bottle import Property
from rtf.middleware.names import Contact
from rtf.middleware.naming.client import RemoteNames
from rtf.middleware.network import Network
from rtf.robot.devices.fake_board import FakeBoard
from rtf.robot.server.control_board import ControlBoardServer

network = Network(RemoteNames(Contact("/root", "127.0.0.1", int(sys.argv[1]), "tcp")))
board = FakeBoard("fake", network=network)
board.open(Property.parse("(GENERAL (Joints 3))"))
server = ControlBoardServer(board, "/fake", network=network)
print("ready", flush=True)
while True:
    server.publish(clock.now())
    clock.sleep(0.01)
"""


class BoardProcess:
    """A board in a process of its own, which can be killed and started again."""

    def __init__(self, names: NameServer) -> None:
        self._port = str(names.contact.port)
        self.start()

    def start(self) -> None:
        """Start it; returns when it serves."""
        self._process = subprocess.Popen([sys.executable, "-c", SERVER, self._port], stdout=subprocess.PIPE, text=True)
        assert self._process.stdout is not None
        assert self._process.stdout.readline() == "ready\n"

    def kill(self) -> None:
        """Kill it: it says good-bye to nobody."""
        self._process.kill()
        self._process.communicate()


@pytest.fixture
def killed(network: Network) -> Iterator[tuple[Network, BoardProcess]]:
    """A network of several processes, and a board in it."""
    del network  # of which is taken that nothing is left
    with NameServer() as server, ExitStack() as opened:
        process = BoardProcess(server)
        opened.callback(process.kill)
        client_names = RemoteNames(server.contact)
        opened.callback(client_names.close)
        yield Network(client_names), process


@pytest.mark.parametrize("carrier", CARRIERS)
def test_a_board_that_was_killed_is_found_again(killed: tuple[Network, BoardProcess], carrier: str):
    """Questions fail while it is gone; the next one after it came back makes all three connections work again."""
    network, process = killed
    with connect("/fake", carrier=carrier, network=network) as client:
        process.kill()
        for _ in range(2):
            with pytest.raises(NoAnswerError, match=r"^/fake "):
                client.target_positions()
        eventually(lambda: raises(StaleStateError, client.encoders), "the state does not get too old")
        process.start()
        client.set_control_modes(ControlMode.POSITION_DIRECT)
        eventually(lambda: not raises(StaleStateError, client.encoders), "no state comes")
        client.set_positions([1.0, 2.0, 3.0])
        eventually(lambda: client.reference_positions().tolist() == [1.0, 2.0, 3.0], "the command does not arrive")


@pytest.mark.parametrize("carrier", CARRIERS)
def test_who_only_reads_gets_the_state_again(killed: tuple[Network, BoardProcess], carrier: str):
    """A state that is missing for a while makes the client look for the board."""
    network, process = killed
    with connect("/fake", carrier=carrier, network=network) as client:
        process.kill()
        eventually(lambda: raises(StaleStateError, client.encoders), "the state does not get too old")
        process.start()
        eventually(lambda: not raises(StaleStateError, client.encoders), "no state comes")


def test_who_only_streams_is_connected_again(killed: tuple[Network, BoardProcess]):
    """A command for which there is no connection any more makes a new one, or says that there is none."""
    network, process = killed
    with connect("/fake", carrier="tcp", network=network) as client:
        process.kill()
        eventually(lambda: raises(NoAnswerError, lambda: client.set_positions(0.0, 0)), "nobody notices")
        process.start()
        client.set_positions(0.0, 0)
        assert client.axes() == 3
