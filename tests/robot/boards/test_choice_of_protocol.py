"""The client of a board is chosen by the ports that the board has registered."""

from __future__ import annotations

from contextlib import ExitStack, closing
from typing import TYPE_CHECKING, Protocol

import pytest

from rtf.bottle import Dialect, Property
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.robot.boards.client import connect, version_of
from rtf.robot.boards.remapper import RemoteControlBoardRemapper
from rtf.robot.boards.server import ControlBoardServer
from rtf.robot.devices.fake_board import FakeBoard
from rtf.robot.errors import DeviceError
from rtf.robot.yarp3.client import RemoteControlBoard
from rtf.robot.yarp4.client import ControlBoardServiceClient
from rtf.robot_testing.guard.read_only_board import UndeclaredMotionError, connect_read_only

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.robot.boards.client import RemoteBoard


class Serve(Protocol):
    """The type of the fixture."""

    def __call__(self, name: str, *protocols: Dialect) -> None:
        """Serve a board by these protocols."""
        ...


@pytest.fixture
def network() -> Network:
    """A network with the default dialect."""
    return Network(LocalNames(), report=lambda _sentence: None)


@pytest.fixture
def serve(network: Network) -> Iterator[Serve]:
    """Return a function that serves a board of two joints: ``serve(name, Dialect.YARP4)``."""
    with ExitStack() as stack:

        def served(name: str, *protocols: Dialect) -> None:
            board, axis = FakeBoard(name), name.strip("/")
            board.open(Property.parse(f"(GENERAL (Joints 2) (AxisName ({axis}_a {axis}_b)))"))
            stack.callback(board.close)
            stack.callback(ControlBoardServer(board, name, network=network, protocols=protocols).close)

        yield served


@pytest.mark.parametrize(
    ("dialect", "kind"), [(Dialect.YARP3, RemoteControlBoard), (Dialect.YARP4, ControlBoardServiceClient)]
)
def test_the_registered_port_chooses(network: Network, serve: Serve, dialect: Dialect, kind: type[RemoteBoard]):
    """A board of either version is opened and moved without any setting, and its numbers arrive unchanged."""
    serve("/bot", dialect)
    with connect("/bot", carrier="tcp", network=network, timeout=0.01) as board:
        assert type(board) is kind
        assert board.axes() == 2
        board.set_reference_speeds([11.5, 12.25])
        assert board.reference_speeds().tolist() == [11.5, 12.25]


@pytest.mark.parametrize("dialect", Dialect)
def test_a_board_with_both_protocols_is_used_in_the_dialect_of_the_network(
    network: Network, serve: Serve, dialect: Dialect
):
    """A run with ``--dialect 4`` tests the service of the board."""
    serve("/bot", *Dialect)
    network.dialect = dialect
    assert version_of("/bot", network) is dialect


def test_an_absent_board_is_reported_with_both_names(network: Network):
    """The error names both ports that were looked for."""
    with pytest.raises(DeviceError, match=r"neither /bot/rpc:i \(YARP 3\) nor /bot/nws/rpc:i \(YARP 4\)"):
        connect("/bot", network=network)


def test_boards_of_both_versions_are_one_remapped_board(network: Network, serve: Serve):
    """Each board has the client of its own protocol."""
    serve("/three", Dialect.YARP3)
    serve("/four", Dialect.YARP4)
    with closing(RemoteControlBoardRemapper("both", network=network)) as board:
        board.open(
            Property.parse(
                "(axesNames (four_b three_a)) (remoteControlBoards (/three /four)) (localPortPrefix /both) "
                "(REMOTE_CONTROLBOARD_OPTIONS (carrier tcp) (timeout 0.01))"
            )
        )
        board.set_reference_speeds([3.5, 4.5])
        assert board.reference_speeds().tolist() == [3.5, 4.5]


@pytest.mark.parametrize("dialect", Dialect)
def test_a_test_that_declares_no_motion_commands_no_board(network: Network, serve: Serve, dialect: Dialect):
    """The client reads values but sends no commands, until a guard watches."""
    serve("/bot", dialect)
    with connect_read_only("/bot", carrier="tcp", network=network) as board:
        before = board.reference_speeds().tolist()
        for command in (
            lambda: board.set_reference_speeds([1.0, 2.0]),
            lambda: board.position_move(1.0, 0),
            lambda: board.velocity_move(1.0, 0),  # streamed
            board.park_part,
        ):
            with pytest.raises(UndeclaredMotionError):
                command()
        assert board.calibration_done(0) in (True, False)
        assert board.reference_speeds().tolist() == before
        board.allow_commands()
        board.set_reference_speeds([1.0, 2.0])
        assert board.reference_speeds().tolist() == [1.0, 2.0]


@pytest.mark.parametrize("dialect", [*Dialect])
def test_a_name_that_a_killed_server_left(network: Network, serve: Serve, dialect: Dialect) -> None:
    """If both ports for requests are registered, the port that answers chooses the client."""
    serve("/bot/arm", dialect)
    left = {Dialect.YARP3: "/bot/arm/nws/rpc:i", Dialect.YARP4: "/bot/arm/rpc:i"}[dialect]
    network.names.register(left, carrier="tcp", host="127.0.0.1", port=1)
    assert version_of("/bot/arm", network) is dialect
