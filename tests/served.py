"""A board behind the ports of a part, as a robot's are in another process."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from rtf.bottle import Property
from rtf.robot.boards.server import ControlBoardDevice

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.middleware.ports.network import Network
    from rtf.robot.devices.fake_board import FakeBoard

#: What a program runs that reads the states of a board served here: on a busy machine they come late.
PATIENT = """
from functools import partial
from rtf.robot.boards import client
from rtf.robot.network import state_reader
client.connect = partial(client.connect, timeout=20.0)
state_reader._MOST_WAITING = 20.0
"""


@contextmanager
def served(board: FakeBoard, place: str, *, network: Network, period: float) -> Iterator[ControlBoardDevice]:
    """Serve a board of three joints at ``place``, with a state every ``period`` s; yield the server."""
    board.open(Property.parse("(GENERAL (Joints 3))"))
    try:
        server = ControlBoardDevice("server", network=network)
        server.open(Property({"name": place, "period": period}))
        try:
            server.attach({place.rpartition("/")[2]: board})
            yield server
        finally:
            server.close()
    finally:
        board.close()
