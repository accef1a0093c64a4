"""A client whose node does not answer as nodes do."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import pytest

from rtf.applications.run.client import RunClient
from rtf.applications.run.errors import NodeError
from rtf.applications.run.protocol import Start
from rtf.bottle import Bottle
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.rpc import RpcServer
from rtf.middleware.wire.contact import Contact

if TYPE_CHECKING:
    from collections.abc import Callable

NETWORK = Network(LocalNames())


def test_node_that_is_not_there():
    """The error says how to find nodes; an address where nobody listens is reported, too."""
    with pytest.raises(NodeError, match="no node /node; 'rtf name runners'"):
        RunClient("/node", network=NETWORK).running()
    with pytest.raises(NodeError, match="/gone did not answer: Cannot connect"):
        RunClient(Contact("/gone", "127.0.0.1", 1, "tcp"), network=NETWORK).running()


def test_node_that_hangs():
    """The client waits as long as it was told."""
    free = threading.Event()
    with RpcServer("/node", lambda _: free.wait() and Bottle(["running"]), network=NETWORK):
        with pytest.raises(NodeError, match="/node did not answer"):
            RunClient("/node", network=NETWORK, timeout=0.1).is_running("t")
        free.set()


@pytest.mark.parametrize(
    ("ask", "reply"),
    [
        (lambda client: client.start(Start("t", "x")), ["running"]),
        (lambda client: client.start(Start("t", "x")), []),
        (lambda client: client.running(), ["not a list"]),
        (lambda client: client.system_info(), ["no figures"]),
    ],
)
def test_port_that_is_no_node(ask: Callable[[RunClient], object], reply: list[object]):
    """What it answers is not taken for an answer."""
    with RpcServer("/node", lambda _: Bottle(reply), network=NETWORK), pytest.raises(NodeError):
        ask(RunClient("/node", network=NETWORK, timeout=0.5))


def test_port_that_gives_no_answers():
    """A port that only listens is reported as such, or not at all as a node."""
    with BufferedPort("/node", network=NETWORK), pytest.raises(NodeError):
        RunClient("/node", network=NETWORK, timeout=0.5).start(Start("t", "x"))


def test_node_that_ends_in_the_middle():
    """Its connection is lost, which is reported at once."""
    port: list[RpcServer] = []

    def leave(_: Bottle) -> Bottle:
        for caller in port[0].inputs:
            caller.close()
        return Bottle(["running"])

    with RpcServer("/node", leave, network=NETWORK) as made:
        port.append(made)
        with pytest.raises(NodeError, match="/node did not answer"):
            RunClient("/node", network=NETWORK).is_running("t")
