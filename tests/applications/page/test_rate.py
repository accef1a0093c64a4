"""The rates of connections: counted by the kernel, or measured by reading a port for a moment."""

from __future__ import annotations

import threading
from contextlib import ExitStack

import pytest

from rtf import clock
from rtf.applications.page.rate import LiveRate, LiveRates, measure
from rtf.applications.xml.model import Connection, End, Text
from rtf.bottle import Bottle
from rtf.bottle.binary import encode
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port

MESSAGE = Bottle(["a", "text"])


def test_rate_is_that_of_the_messages_that_came():
    """Whatever time passes before the first; the reader is gone afterwards."""
    network = Network(LocalNames())
    done = threading.Event()
    written: list[float] = []

    def write(port: BufferedPort) -> None:
        while not done.wait(0.02):
            if port.outputs:
                written.append(clock.monotonic())
                port.write(MESSAGE)

    with BufferedPort("/source", network=network) as port:
        thread = threading.Thread(target=write, args=[port])
        thread.start()
        rate = measure(network, "/source")
        done.set()
        thread.join()
        assert rate.messages == pytest.approx((len(written) - 1) / (written[-1] - written[0]), rel=0.3)
        assert rate.bytes == pytest.approx(len(encode(MESSAGE, network.dialect)) * rate.messages)
        assert [one.name for one in network.names.list()] == ["/source"]


def test_port_that_is_not_open_is_reported():
    """By its name."""
    with pytest.raises(MiddlewareError, match="/nowhere"):
        measure(Network(LocalNames()), "/nowhere")


def connection(source: str, target: str) -> Connection:
    """Make a connection of an application."""
    return Connection(End(Text(source)), End(Text(target)))


def test_rates_are_those_of_the_kernel():
    """Bytes and messages between two calls, without a further reader; connections to one port are counted together."""
    network = Network(LocalNames())
    with ExitStack() as stack:
        a, b = (stack.enter_context(Port(name, network=network)) for name in ("/a", "/b"))
        for name in ("/one", "/both"):
            stack.enter_context(BufferedPort(name, strict=True, network=network))
        a.add_output("/one", "tcp")
        a.add_output("/both", "tcp")
        b.add_output("/both", "tcp")
        wanted = [connection("/a", "/one"), connection("/a", "/both"), connection("/b", "/both")]
        rates = LiveRates(network)
        assert rates.rates(wanted) == {}
        for port in (a, a, a, b):
            port.write(MESSAGE)
        found = rates.rates(wanted)
        assert [*found] == ["/a /one", "/a /both", "/b /both"]
        alone, together = found["/a /one"], found["/a /both"]
        assert alone.messages is not None
        assert together.messages == pytest.approx(alone.messages * 4 / 3, rel=0.01)
        assert together.bytes == pytest.approx(alone.bytes * 4 / 3, rel=0.01)
        assert alone.bytes > alone.messages * len(encode(MESSAGE, network.dialect)) > 0
        assert found["/a /both"] == found["/b /both"]
        assert (alone.shared, together.shared) == (1, 2)
        assert rates.rates(wanted)["/a /one"] == LiveRate(0.0, 0.0, 1)
        assert rates.rates([connection("/a", "/nowhere")]) == {}
