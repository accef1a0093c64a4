"""The choice between the two servers of a control board: that of YARP 3, or the service of YARP 4."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

from rtf.bottle import Dialect
from rtf.robot.server.control_board import ControlBoardServer
from rtf.robot.server.control_board_service import ControlBoardServiceServer

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network
    from rtf.robot.server.outlets import Outlets

BoardServer: TypeAlias = "ControlBoardServer | ControlBoardServiceServer"


def serve_board(
    device: object,
    name: str,
    *,
    network: Network,
    period: float,
    outlets: Outlets | None = None,
    service: bool | None = None,
) -> BoardServer:
    """Open the server of a board. ``service``: that of YARP 4; None: by the dialect of the network.

    Raises the errors of the servers.
    """
    if service is None:
        service = network.dialect is Dialect.YARP4
    server = ControlBoardServiceServer if service else ControlBoardServer
    return server(device, name, network=network, period=period, outlets=outlets)
