"""The rate of a port is measured by reading it for a moment."""

from __future__ import annotations

import threading

import pytest

from rtf import clock
from rtf.applications.page.rate import measure
from rtf.bottle import Bottle
from rtf.bottle.binary import encode
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.network import Network

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


def test_port_that_is_not_open_is_told():
    """By its name."""
    with pytest.raises(MiddlewareError, match="/nowhere"):
        measure(Network(LocalNames()), "/nowhere")
