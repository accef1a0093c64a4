"""Several messages on their way at once, by every carrier with acknowledgements."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import pytest

from rtf.bottle import Bottle
from rtf.middleware.ports.pipelined_port import MOST, PipelinedPort
from rtf.middleware.ports.port import Port
from rtf.middleware.types.plain import BYTES

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network
    from rtf.middleware.wire.incoming_message import IncomingMessage

COUNT = 3 * MOST


@pytest.mark.parametrize("together", [1, 5])
@pytest.mark.parametrize("carrier", ["tcp", "text_ack", "unix_stream+ack", "local"])
def test_when_it_has_settled_every_reader_has_every_message(network: Network, carrier: str, together: int):
    """After ``settle`` all messages have arrived, in order and with envelopes, singly or in batches."""
    came: list[tuple[str, Bottle]] = []

    def take(delivery: IncomingMessage) -> None:
        came.append((delivery.envelope, delivery.read()))

    with Port("/reader", take, network=network), PipelinedPort("/writer", network=network, together=together) as writer:
        writer.add_output("/reader", carrier)
        for number in range(COUNT):
            assert writer.write(Bottle([number]), envelope=f"{number} 0.5") == 1
        writer.settle()
        assert came == [(f"{number} 0.5", Bottle([number])) for number in range(COUNT)]


@pytest.mark.parametrize("carrier", ["tcp", "text_ack", "local"])
def test_kept_output_is_unchanged(network: Network, carrier: str):
    """A waiting message is sent as it was written; by ``local`` the object itself arrives."""
    came: list[Bottle] = []

    def take(delivery: IncomingMessage) -> None:
        came.append(Bottle([*delivery.read()]))

    with Port("/reader", take, network=network), PipelinedPort("/writer", network=network, together=3) as writer:
        writer.add_output("/reader", carrier)
        message = Bottle([0])
        for number in range(3):
            message[0] = number
            writer.write(message)
        writer.settle()
    assert came == [Bottle([2 if carrier == "local" else number]) for number in range(3)]


@pytest.mark.parametrize("size", [10, 50_000, 300_000])
def test_messages_of_any_size_are_sent_together(network: Network, size: int):
    """Batches of small and of large messages arrive whole."""
    came: list[bytes] = []

    def take(delivery: IncomingMessage) -> None:
        came.append(delivery.read(BYTES))

    sent = [bytes([number]) * size for number in range(4)]
    with Port("/reader", take, network=network), PipelinedPort("/writer", network=network, together=4) as writer:
        writer.add_output("/reader", "tcp")
        for one in sent:
            writer.write(one)
        writer.settle()
    assert came == sent


def test_it_does_not_wait_for_a_reader_that_works(network: Network):
    """``write`` does not wait for the reader, and ``settle`` does."""
    may_go, came = threading.Event(), []

    def take(delivery: IncomingMessage) -> None:
        assert may_go.wait(10)
        came.append(delivery.read())

    with Port("/reader", take, network=network), PipelinedPort("/writer", network=network) as writer:
        writer.add_output("/reader", "tcp")
        for number in range(MOST):
            writer.write(Bottle([number]))
        assert came == []
        may_go.set()
        writer.settle()
        assert len(came) == MOST
