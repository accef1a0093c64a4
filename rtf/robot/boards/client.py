"""Clients of boards whose version is found out: a board of YARP 3 and one of YARP 4 register different ports."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

from rtf.bottle import Dialect, Property
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.ports.network import default_network
from rtf.middleware.ports.remote import exists
from rtf.middleware.wire.contact import Contact
from rtf.robot.errors import DeviceError
from rtf.robot.network.client_settings import TIMEOUT, unique_local
from rtf.robot.yarp3.client import RemoteControlBoard
from rtf.robot.yarp4.client import ControlBoardServiceClient

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network
    from rtf.robot.network.board_stub import BoardStub

#: A client of either version.
RemoteBoard: TypeAlias = "BoardStub[Any]"
#: The ends of the names of the ports to which requests go: the words of YARP 3, and the service of YARP 4.
REQUESTS = {Dialect.YARP3: "/rpc:i", Dialect.YARP4: "/nws/rpc:i"}
_CLIENTS: dict[Dialect, type[RemoteBoard]] = {
    Dialect.YARP3: RemoteControlBoard,
    Dialect.YARP4: ControlBoardServiceClient,
}


def version_of(board: str, network: Network) -> Dialect:
    """Return the version of a board such as ``/icub/left_arm``, by the ports that are registered.

    One that serves both is used in the dialect of the network. Raises DeviceError if neither is registered.
    """
    try:
        there = [version for version, end in REQUESTS.items() if network.names.query(f"{board}{end}") is not None]
        if len(there) > 1:  # one of them may be the name of a server that was killed
            there = [one for one in there if exists(network, Contact(f"{board}{REQUESTS[one]}"))] or there
    except MiddlewareError as error:
        raise DeviceError(f"{board} cannot be opened: {error}") from error
    if not there:
        raise DeviceError(
            f"{board} cannot be opened: neither {board}{REQUESTS[Dialect.YARP3]} (YARP 3) nor "
            f"{board}{REQUESTS[Dialect.YARP4]} (YARP 4) is registered; 'rtf list' shows what is"
        )
    return network.dialect if network.dialect in there else there[0]


def make_client(board: str, network: Network, name: str = "") -> RemoteBoard:
    """Return the client of a board, not yet open. Raises DeviceError if the board is not registered."""
    return _CLIENTS[version_of(board, network)](name or board, network=network)


def connect(
    remote: str,
    *,
    local: str | None = None,
    carrier: str = "fast_tcp",
    network: Network | None = None,
    timeout: float = TIMEOUT,
    strict: bool = False,
) -> RemoteBoard:
    """Open a client of a board such as ``/icub/left_arm``. A ``with`` statement closes it.

    ``local`` is the prefix of its port names, by default a unique one. ``strict``: every streamed command is sent, for
    those who stream several kinds; else a command of several joints is left out while another one is on its way. Raises
    DeviceError.
    """
    board = make_client(remote, network or default_network())
    parameters = {"remote": remote, "local": local or unique_local(remote), "carrier": carrier, "timeout": timeout}
    if strict:
        parameters["writeStrict"] = "on"
    board.open(Property(parameters))
    return board
