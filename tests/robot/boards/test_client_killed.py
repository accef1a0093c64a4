"""A client whose board is killed and started again."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import closing
from typing import TYPE_CHECKING, NamedTuple

import pytest

from rtf.middleware.naming.client import RemoteNames
from rtf.middleware.naming.server import NameServer
from rtf.middleware.ports.network import Network
from rtf.robot.boards.client import connect
from rtf.robot.control_modes import ControlMode
from rtf.robot.errors import (
    NoAnswerError,
    StaleStateError,
)
from waiting import eventually

from ..scripted_board import raises

if TYPE_CHECKING:
    from collections.abc import Iterator


CARRIERS = ("tcp", "fast_tcp", "udp")
#: The program from which each board is forked.
SERVERS = """
import os, select, sys
from rtf import clock
from rtf.bottle import Property
from rtf.middleware.wire.contact import Contact
from rtf.middleware.naming.client import RemoteNames
from rtf.middleware.ports.network import Network
from rtf.robot.devices.fake_board import FakeBoard
from rtf.robot.boards.server import ControlBoardServer

def serve(root):
    network = Network(RemoteNames(Contact("/root", "127.0.0.1", root, "tcp")))
    board = FakeBoard("fake", network=network)
    board.open(Property.parse("(GENERAL (Joints 3))"))
    server = ControlBoardServer(board, "/fake", network=network)
    print(os.getpid(), flush=True)
    while not select.select([0], [], [], 0.01)[0]:  # until the test has died
        server.publish(clock.now())

for line in sys.stdin:
    child = os.fork()
    if not child:
        serve(int(line))
        os._exit(0)
    os.waitpid(child, 0)
    print("gone", flush=True)
"""


class BoardProcesses:
    """Starts boards in processes of their own, one after the other, which can be killed."""

    def __init__(self) -> None:
        self._forks = subprocess.Popen(
            [sys.executable, "-c", SERVERS], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self._board = 0

    def start(self, names: NameServer) -> None:
        """Start a board, and wait until it is served."""
        self._board = int(self._said(f"{names.contact.port}\n"))

    def kill(self) -> None:
        """Kill the board without a chance to disconnect, and wait until it is gone."""
        board, self._board = self._board, 0
        if board:
            os.kill(board, signal.SIGKILL)
            assert self._said() == "gone\n"

    def close(self) -> None:
        """End the last board."""
        self._forks.communicate()

    def _said(self, asked: str = "") -> str:
        assert self._forks.stdin is not None
        assert self._forks.stdout is not None
        self._forks.stdin.write(asked)
        self._forks.stdin.flush()
        return self._forks.stdout.readline()


@pytest.fixture(scope="module")
def processes() -> Iterator[BoardProcesses]:
    """Return the starter of boards; it ends them after the test."""
    with closing(BoardProcesses()) as made:
        yield made


class Killed(NamedTuple):
    """A network of several processes, and a board in it that can be killed and started again."""

    network: Network
    names: NameServer
    processes: BoardProcesses

    def kill(self) -> None:
        """Kill the board."""
        self.processes.kill()

    def start(self) -> None:
        """Start the board again."""
        self.processes.start(self.names)


@pytest.fixture
def board(network: Network, processes: BoardProcesses) -> Iterator[Killed]:
    """A board that is being served."""
    del network  # of which is taken that nothing is left
    with NameServer() as server, closing(RemoteNames(server.contact)) as client_names:
        processes.start(server)
        try:
            yield Killed(Network(client_names), server, processes)
        finally:
            processes.kill()


@pytest.mark.parametrize("carrier", CARRIERS)
def test_a_board_that_was_killed_is_found_again(board: Killed, carrier: str):
    """Requests fail while it is gone; the first one after its return reconnects all three connections."""
    with connect("/fake", carrier=carrier, network=board.network, timeout=0.2) as client:
        board.kill()
        for _ in range(2):
            with pytest.raises(NoAnswerError, match=r"^/fake "):
                client.target_positions()
        eventually(lambda: raises(StaleStateError, client.encoders), "the state does not get too old")
        board.start()
        client.set_control_modes(ControlMode.POSITION_DIRECT)
        eventually(lambda: not raises(StaleStateError, client.encoders), "no state comes")
        client.set_positions([1.0, 2.0, 3.0])
        eventually(lambda: client.reference_positions().tolist() == [1.0, 2.0, 3.0], "the command does not arrive")


@pytest.mark.parametrize("carrier", CARRIERS)
def test_a_client_that_only_reads_gets_the_state_again(board: Killed, carrier: str):
    """A client that only reads reconnects after a stale state."""
    with connect("/fake", carrier=carrier, network=board.network, timeout=0.2) as client:
        board.kill()
        eventually(lambda: raises(StaleStateError, client.encoders), "the state does not get too old")
        board.start()
        eventually(lambda: not raises(StaleStateError, client.encoders), "no state comes")


def test_a_client_that_only_streams_is_connected_again(board: Killed):
    """A command without a connection reconnects, or raises an error."""
    with connect("/fake", carrier="tcp", network=board.network) as client:
        board.kill()
        eventually(lambda: raises(NoAnswerError, lambda: client.set_positions(0.0, 0)), "nobody notices")
        board.start()
        client.set_positions(0.0, 0)
        assert client.axes() == 3
