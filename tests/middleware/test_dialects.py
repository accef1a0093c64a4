"""Peers of the other dialect: their messages are decoded, and answered in their dialect."""

from __future__ import annotations

import pytest

from rtf.bottle import Bottle, Dialect
from rtf.errors import RtfError
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcClient, RpcServer

DIALECTS = [Dialect.YARP3, Dialect.YARP4]


@pytest.fixture
def other(network: Network) -> Network:
    """A network with the same names and the dialect of YARP 4."""
    return Network(network.names, dialect=Dialect.YARP4, report=network.report)


@pytest.mark.parametrize("carrier", ["tcp", "fast_tcp", "udp", "unix_stream"])
def test_messages_of_the_other_dialect_are_read(network: Network, other: Network, carrier: str):
    """Messages with doubles in the other dialect are decoded, wherever the doubles are."""
    with BufferedPort("/reader", strict=True, network=network) as reader, Port("/writer", network=other) as writer:
        writer.add_output("/reader", carrier)
        for text in ("1.5 2.5 3.5", "[set] [pos] 0 10.5", "(a (1.5 b)) 7", "no numbers", "0.25"):
            writer.write(Bottle.parse(text))
            assert reader.read(timeout=5) == Bottle.parse(text)


def test_questions_and_answers_across_dialects(network: Network, other: Network):
    """A server learns the dialect from a request, a client from a reply."""
    with RpcServer("/server", lambda question: Bottle([*question, 0.5]), network=network):
        with RpcClient("/four", "/server", network=other) as client:
            for _ in range(3):
                assert client.call(Bottle([1.5, "x"]), timeout=5) == Bottle([1.5, "x", 0.5])
        with RpcClient("/three", "/server", network=network) as client:
            assert client.call(Bottle([1.5, "x"]), timeout=5) == Bottle([1.5, "x", 0.5])
    with (
        RpcServer("/server", lambda question: Bottle([*question, 0.5]), network=other),
        RpcClient("/three", "/server", network=network) as client,
    ):
        assert client.call(Bottle(["get"]), timeout=5) == Bottle(["get", 0.5])
        assert client.outputs[0].dialect in (None, Dialect.YARP4)
        assert client.call(Bottle([2.5]), timeout=5) == Bottle([2.5, 0.5])


def test_what_is_none_in_either_is_an_error(network: Network):
    """A message that is invalid in both dialects is an error."""
    with BufferedPort("/reader", network=network) as reader, Port("/writer", network=network) as writer:
        from rtf.middleware.types.codecs import RAW

        writer.add_output("/reader")
        writer.write(b"\x00\x01\x00\x00\x01\x00\x00\x00\x63\x00\x00\x00", RAW)
        with pytest.raises(RtfError):
            reader.read(timeout=0.3)
