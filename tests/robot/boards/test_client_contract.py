"""The contract of control boards, held by a client and a served board together, over each carrier."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from rtf.middleware.ports.network import Network
from rtf.robot.boards.client import connect
from waiting import eventually

from ..contract import ControlBoardContract
from ..sensor_bench import ManualClock
from ..served_board import fake_board, publish

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.bottle import Value
    from rtf.robot.boards.server import ControlBoardServer
    from rtf.robot.device import Device
    from rtf.robot.interfaces import FloatArray
    from rtf.robot.yarp3.client import RemoteControlBoard

    from ..served_board import CountingBoard


CONFIGURATION = "(VARIABLES (kinematic_mj (1.0 0.0 0.0 1.0)))"


class Link:
    """A client, the board that it is connected with, and their time."""

    def __init__(
        self, time: ManualClock, board: CountingBoard, server: ControlBoardServer, client: RemoteControlBoard
    ) -> None:
        self.time, self.board, self.server, self.client = time, board, server, client
        self.sent = 0
        send = client._link.stream.send

        def counted(head: list[Value], values: FloatArray, *, strict: bool) -> None:
            send(head, values, strict=strict)
            self.sent += 1

        client._link.stream.send = counted  # type: ignore[method-assign]

    def advance(self, seconds: float) -> None:
        """Wait until the commands have arrived, let time pass, and wait until the state has arrived."""
        eventually(lambda: self.board.streamed == self.sent, "a command is missing")
        self.time.sleep(seconds)
        publish(self.server, self.time)
        eventually(self._is_up_to_date, "the state is missing")

    def _is_up_to_date(self) -> bool:
        age = self.client._link.state.age()
        return age is not None and age < 1e-6


@pytest.fixture(scope="class")
def link(request: pytest.FixtureRequest, shared_time: ManualClock, shared_network: Network) -> Iterator[Link]:
    """One client and board for all tests of a class."""
    with (
        fake_board(shared_network, CONFIGURATION) as (board, server),
        connect("/fake", carrier=request.cls.CARRIER, network=shared_network) as client,
    ):
        yield Link(shared_time, board, server, client)


class Contract(ControlBoardContract):
    """A board at the other end of the network keeps the contract. Commands and states are awaited on their way."""

    CARRIER = "tcp"

    @pytest.fixture
    def board(self, link: Link) -> Device:
        """The client of a board that is in its initial state."""
        self.link = link
        link.board.begin_anew()
        link.time.sleep(1.0)  # the state of the test before is old
        self.advance(0.0)
        return link.client

    def advance(self, seconds: float) -> None:
        """See ControlBoardContract."""
        self.link.advance(seconds)


class TestByTcp(Contract):
    """The contract over tcp, which acknowledges every message."""


class TestByFastTcp(Contract):
    """The contract over fast_tcp, which acknowledges nothing."""

    CARRIER = "fast_tcp"


class TestByUdp(Contract):
    """The contract over udp, in which each message fits into a datagram."""

    CARRIER = "udp"
