"""Several messages on their way at once: all arrive, by every carrier that acknowledges, and however they are cut."""

from __future__ import annotations

import socket
import threading
from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtf.bottle import Bottle
from rtf.middleware.carriers.stream import Stream
from rtf.middleware.carriers.tcp import Tcp, TcpInput
from rtf.middleware.errors import ProtocolError
from rtf.middleware.ports.pipelined_port import MOST, PipelinedPort
from rtf.middleware.ports.port import Port
from rtf.middleware.types.plain import BYTES
from rtf.middleware.wire import framing

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network
    from rtf.middleware.wire.incoming_message import IncomingMessage

COUNT = 3 * MOST
ENVELOPES = st.text(st.characters(min_codepoint=32, exclude_categories=["Cs"]), min_size=1, max_size=60)


@pytest.mark.parametrize("together", [1, 5])
@pytest.mark.parametrize("carrier", ["tcp", "text_ack", "unix_stream+ack", "local"])
def test_when_it_has_settled_everybody_has_got_everything(network: Network, carrier: str, together: int):
    """In order and with their envelopes, also when more are sent than may be on their way, or are kept together."""
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
def test_what_is_kept_is_told_as_it_was(network: Network, carrier: str):
    """Anyone who gets bytes or text; in this process it is the object itself."""
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
    """Small ones are joined, large ones are not copied."""
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
    """To settle means to wait for all that are on their way."""
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


@given(ENVELOPES, st.binary(), st.data())
@settings(deadline=None)  # a thread has to be woken
def test_an_envelope_arrives_however_the_message_is_cut(envelope: str, body: bytes, data: st.DataObject):
    """Whether all of it is there at once, or it comes in two pieces, or another message is behind it."""
    whole = 2 * (framing.front("D", envelope, len(body)) + body)
    cut = data.draw(st.integers(0, len(whole) - 1))
    near, far = socket.socketpair()
    with near, far:
        receiving = TcpInput(Tcp(), Stream(near), "/writer", "")
        sender = threading.Thread(target=lambda: (far.sendall(whole[:cut]), far.sendall(whole[cut:])))
        sender.start()
        for _ in range(2):
            key, text, arrived = receiving.receive()
            assert (key, text, bytes(arrived)) == ("D", envelope, body)
        sender.join()


@pytest.mark.parametrize("text_size", [-1, 0, 40, 1 << 20])
def test_an_envelope_that_does_not_fit_into_its_message_is_refused(text_size: int):
    """Its size is the peer's word, which may be anything."""
    front = framing.front("D", "1 2", 4)
    at = len(front) - len("D 1 2\0") - 8
    near, far = socket.socketpair()
    with near, far:
        far.sendall(front[:at] + text_size.to_bytes(4, "little", signed=True) + front[at + 4 :] + bytes(4))
        with pytest.raises(ProtocolError):
            TcpInput(Tcp(), Stream(near), "/writer", "").receive()
