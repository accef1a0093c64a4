"""The latest message of a stream: it is decoded when it is read, and invalid messages are dropped."""

from __future__ import annotations

from contextlib import closing
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from rtf import clock
from rtf.bottle import Bottle
from rtf.middleware.ports.port import Port
from rtf.middleware.types import VECTOR
from rtf.middleware.types.vector import VectorCodec
from rtf.robot.errors import StaleStateError
from rtf.robot.network.latest_message import LatestMessage

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.middleware.ports.network import Network


class Counting(VectorCodec):
    """A codec of vectors of doubles that counts the decoded messages."""

    def __init__(self) -> None:
        super().__init__("f8")
        self.read = 0

    def decode(self, data: Any, dialect: Any) -> Any:
        """See Codec."""
        self.read += 1
        return super().decode(data, dialect)


@pytest.fixture
def codec() -> Counting:
    """The codec of the stream."""
    return Counting()


@pytest.fixture
def newest(network: Network, codec: Counting) -> Iterator[LatestMessage[Any]]:
    """A port that decodes its latest message when it is read."""
    with closing(LatestMessage("/newest", codec, timeout=10.0, network=network, lazily=True)) as made:
        yield made


@pytest.fixture
def source(network: Network, newest: LatestMessage[Any]) -> Iterator[Port]:
    """A port that is connected to ``newest`` by tcp, so that a written message has arrived."""
    with Port("/source", network=network) as made:
        made.add_output(newest.name, "tcp")
        yield made


def send(source: Port, *values: float, envelope: str = "") -> None:
    """Send a vector."""
    source.write(np.array(values), VECTOR, envelope=envelope)


def test_messages_that_are_not_requested_are_not_decoded(newest: LatestMessage[Any], source: Port, codec: Counting):
    """Only the first message, which gives the usual length, and requested ones are decoded, each once."""
    for number in range(20):
        send(source, number, 2.0)
    assert codec.read == 1
    for _ in range(3):
        latest = newest.fresh()
        assert latest.value.tolist() == [19.0, 2.0]
    assert codec.read == 2


def test_each_message_has_its_own_values(newest: LatestMessage[Any], source: Port):
    """Each message has its own stamp and values, also after one of another length."""
    for number, values in enumerate(([1.0], [2.0], [3.0, 4.0], [5.0, 6.0], [7.0], [8.0])):
        send(source, *values, envelope=f"{number} 0.5")
        latest = newest.latest
        assert latest is not None
        assert latest.stamp is not None
        assert (latest.value.tolist(), latest.stamp.count) == (values, number)


def test_it_is_as_old_as_its_arrival(newest: LatestMessage[Any], source: Port):
    """The age of a message counts from its arrival, not from its reading."""
    send(source, 1.0)
    send(source, 2.0)
    delivered = clock.now()
    latest = newest.latest
    assert latest is not None
    assert latest.value.tolist() == [2.0]
    assert latest.at <= delivered


def test_nonsense_of_the_usual_length_is_found_out_when_it_is_read(
    newest: LatestMessage[Any], source: Port, said: list[str]
):
    """Reading an invalid message of the usual length closes its connection, with one report; the last one stays."""
    send(source, 1.0, 2.0)
    assert newest.fresh().value.tolist() == [1.0, 2.0]
    size = len(b"".join(VECTOR.encode(np.zeros(2), source.network.dialect)))
    source.write(b"\xff" * size, _AS_IT_IS)
    assert [newest.fresh().value.tolist() for _ in range(2)] == [[1.0, 2.0]] * 2
    assert len([sentence for sentence in said if "/source was cut off" in sentence]) == 1


def test_other_nonsense_is_found_out_at_once(newest: LatestMessage[Any], source: Port, said: list[str]):
    """An invalid message of another length closes its connection on arrival."""
    send(source, 1.0, 2.0)
    source.write(Bottle.parse("[pos] x y"))
    assert any("/source was cut off" in sentence for sentence in said)
    assert newest.fresh().value.tolist() == [1.0, 2.0]


def test_text_is_read_as_text(newest: LatestMessage[Any], network: Network):
    """Messages of the text carrier are decoded, also if their length is the usual one."""
    with Port("/typed", network=network) as typed:
        typed.add_output(newest.name, "text_ack")
        for number in range(3):
            typed.write(Bottle([float(number), 2.5]))
            assert newest.fresh().value.tolist() == [number, 2.5]


def test_before_the_first_there_is_none(newest: LatestMessage[Any]):
    """Reading before the first message raises StaleStateError."""
    assert newest.latest is None
    assert newest.age() is None
    with pytest.raises(StaleStateError, match="no message has arrived at /newest yet"):
        newest.fresh()


class _AsItIs:
    """A codec that writes bytes unchanged."""

    promise = ""

    def encode(self, value: bytes, _dialect: Any) -> tuple[bytes]:
        """See Codec."""
        return (value,)


_AS_IT_IS: Any = _AsItIs()
