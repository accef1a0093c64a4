"""Services: a client calls a server over real sockets, and their messages are those of YARP's programs."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from rtf import idl
from rtf.bottle import Bottle, BottleError
from rtf.middleware.errors import MiddlewareError, ProtocolError, WaitTimeoutError
from rtf.middleware.ports.rpc import RpcClient, RpcServer
from rtf.middleware.types import ProtocolVersion
from rtf.middleware.types.codecs import RAW

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.middleware.ports.network import Network

REFUSED = "09010000 01000000 6661696c"


@pytest.fixture
def heard() -> list[str]:
    """What was shouted at the server."""
    return []


@pytest.fixture
def server(shapes: Any, network: Network, heard: list[str]) -> Iterator[RpcServer]:
    """A server of all functions."""
    shouted = threading.Event()

    class Calculator(shapes.Calculator):  # type: ignore[name-defined,misc]
        def add(self, a: int, b: int = 3) -> int:
            return a + b

        def is_on(self) -> bool:
            return False

        def moved(self, shape: Any, by: Any) -> Any:
            shape.centre = shapes.Point(shape.centre.x + by.x, shape.centre.y + by.y)
            return shape

        def counts(self, names: list[str]) -> dict[str, int]:
            return {name: names.count(name) for name in names}

        def shout(self, text: str) -> None:
            heard.append(text)
            shouted.set()

        def rest(self) -> None:
            shouted.wait(5)

        def transposed(self, matrix: Any) -> Any:
            return matrix.T

        def next_color(self, color: Any) -> Any:
            return shapes.Color.RED if color is shapes.Color.GREEN else shapes.Color.BLUE

        def code(self, code: int) -> int:
            return code

        def line(self, count: int, step: float) -> list[Any]:
            return [shapes.Point(step * place, 0.0) for place in range(count)]

    with idl.serve("/calculator", Calculator(), network=network) as port:
        yield port


@pytest.fixture
def client(shapes: Any, network: Network, server: RpcServer) -> Iterator[Any]:
    """A client of it."""
    with shapes.CalculatorClient("/caller", server.name, network=network) as made:
        yield made


def test_functions_are_called_with_all_types(shapes: Any, client: Any, heard: list[str]):
    """Arguments and results are values of Python."""
    assert client.add(2, 40) == 42
    assert client.add(2) == 5
    assert client.is_on() is False
    assert client.moved(shapes.Shape("a"), shapes.Point(1.0, 2.0)) == shapes.Shape("a", centre=shapes.Point(3.0, 2.0))
    assert client.counts(["a", "b", "a"]) == {"a": 2, "b": 1}
    np.testing.assert_array_equal(client.transposed([[1, 2, 3]]), [[1.0], [2.0], [3.0]])
    assert client.next_color(shapes.Color.GREEN) is shapes.Color.RED
    assert client.code(25185) == 25185
    assert client.line(2, 0.5) == [shapes.Point(0.0, 0.0), shapes.Point(0.5, 0.0)]
    client.shout("ho")
    assert client.rest() is None
    assert heard == ["ho"]


@pytest.fixture
def ask(network: Network, server: RpcServer) -> Iterator[Any]:
    """Send a bottle, and return the bytes of the reply."""
    with RpcClient("/asker", server.name, network=network) as port:
        yield lambda text: port.call(Bottle.parse(text), answer=RAW).hex()  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("request_", "reply"),
    [
        ("add 2 40", "00010000 01000000 01000000 2a000000"),
        ("[add] 2", "00010000 01000000 01000000 05000000"),
        ("[is] [on]", "00010000 01000000 09000000 6661696c"),
        ("is_on", "00010000 01000000 09000000 6661696c"),
        ("shout ho", "00010000 01000000 09000000 646f6e65"),
        ("next color 2", "00010000 01000000 01000000 01000000"),
        ("add", REFUSED),
        ("add 1 2 3", REFUSED),
        ("add one", REFUSED),
        ("subtract 1", REFUSED),
    ],
)
def test_replies_are_those_of_servers_of_yarp(ask: Any, request_: str, reply: str):
    """Words or vocabs, defaults of last arguments; a false result is not a refusal."""
    assert ask(request_) == reply.replace(" ", "")


def test_the_version_of_the_protocol_is_asked_for(network: Network, server: RpcServer):
    """By clients of YARP before all else."""
    with RpcClient("/asker", server.name, network=network) as port:
        version = port.call(Bottle(["getRemoteProtocolVersion"]), answer=ProtocolVersion.codec)
    assert version == ProtocolVersion(0, 4, 0, 0)


def test_help_names_the_functions(network: Network, server: RpcServer):
    """And describes one."""
    with RpcClient("/asker", server.name, network=network) as port:
        assert port.call(Bottle(["help"]))[1].to_text().startswith('"*** Available commands:" add is_on moved')  # type: ignore[index,union-attr]
        described = port.call(Bottle(["help", "add"]))[1]  # type: ignore[index]
        assert [*described] == [  # type: ignore[misc]
            "std::int32_t add(std::int32_t a, std::int32_t b)",
            "Adds two numbers.",
            "@return the sum",
        ]


def test_a_client_says_what_is_wrong(shapes: Any, client: Any, network: Network):
    """Arguments, functions, answers, and the end of the server."""
    with pytest.raises(BottleError, match=r"'two' is not of the type std::int32_t"):
        client.add("two")
    with (
        RpcServer("/other", lambda _: Bottle(["x"]), network=network) as other,
        shapes.AdderClient("/confused", other.name, network=network) as confused,
        pytest.raises(ProtocolError, match=r"/other answered add\(1, 3\) with something else: 'x' is not of"),
    ):
        confused.add(1)
    with (
        idl.serve("/nothing", idl.Service(), network=network) as empty,
        shapes.AdderClient("/lost", empty.name, network=network) as lost,
    ):
        with pytest.raises(idl.CallError, match=r"/nothing does not know .*add\(.*, or does not accept add\(1, 3\)"):
            lost.add(1)
        assert lost.connection.remote == "/nothing"
        with pytest.raises(idl.CallError):  # not false
            lost.is_on()


def test_no_answer_is_reported_in_time_and_the_next_call_connects_again(shapes: Any, network: Network):
    """A server that hangs, and one that has gone."""
    hanging = threading.Event()
    with (
        RpcServer("/slow", lambda _: hanging.wait(10) and Bottle([7]), network=network),
        shapes.AdderClient("/waiting", "/slow", network=network, timeout=0.2) as client,
    ):
        with pytest.raises(WaitTimeoutError):
            client.add(1)
        hanging.set()
        client.connection.timeout = 10.0
        assert client.add(1) == 7
    with pytest.raises(MiddlewareError):
        client.add(1)


def test_what_is_not_implemented_is_reported_when_the_server_is_made(shapes: Any):
    """Not when it is called."""
    with pytest.raises(TypeError, match="abstract method"):
        shapes.Adder()
