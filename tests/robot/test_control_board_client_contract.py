"""The contract of control boards, held by a client and a served board together, over each carrier."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from rtf.middleware.network import Network
from rtf.robot.client.control_board import connect
from waiting import eventually

from .contract import ControlBoardContract
from .sensor_bench import ManualClock
from .served_board import fake_board, publish

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.bottle import Value
    from rtf.robot.device import Device
    from rtf.robot.interfaces import FloatArray


class Contract(ControlBoardContract):
    """A board at the other end of the network does what boards do. Commands and states are waited for on their way."""

    CARRIER = "tcp"

    @pytest.fixture
    def board(self, stepped: ManualClock, network: Network) -> Iterator[Device]:
        """See the contract."""
        variables = "(VARIABLES (kinematic_mj (1.0 0.0 0.0 1.0)))"
        with (
            fake_board(network, variables) as (self.served, self.server),
            connect("/fake", carrier=self.CARRIER, network=network) as self.client,
        ):
            self.time = stepped
            self.sent = 0
            send = self.client._link.stream.send

            def counted(head: list[Value], values: FloatArray, *, strict: bool) -> None:
                send(head, values, strict=strict)
                self.sent += 1

            self.client._link.stream.send = counted  # type: ignore[method-assign]
            self.advance(0.0)
            yield self.client

    def advance(self, seconds: float) -> None:
        """See the contract."""
        eventually(lambda: self.served.streamed == self.sent, "a command is missing")
        self.time.sleep(seconds)
        publish(self.server, self.time)
        eventually(self._is_up_to_date, "the state is missing")

    def _is_up_to_date(self) -> bool:
        age = self.client._link.state.age()
        return age is not None and age < 1e-6


class TestByTcp(Contract):
    """Every message is acknowledged."""


class TestByFastTcp(Contract):
    """Nothing is acknowledged."""

    CARRIER = "fast_tcp"


class TestByUdp(Contract):
    """Nothing is acknowledged, and all fits into datagrams."""

    CARRIER = "udp"
