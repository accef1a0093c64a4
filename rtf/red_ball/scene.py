"""The ball of a simulated scene, moved through the port ``/NAME/world`` of the simulator."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import numpy as np

from rtf.bottle import Bottle, Vocab, as_float
from rtf.middleware.ports.remote import exists
from rtf.middleware.ports.rpc import RpcClient
from rtf.middleware.wire.contact import Contact
from rtf.robot.errors import NoAnswerError, RefusedError
from rtf.simulator.world import WORLD, from_world, to_world

if TYPE_CHECKING:
    from collections.abc import Sequence
    from contextlib import ExitStack

    from rtf.middleware.ports.network import Network
    from rtf.robot.interfaces import FloatArray

_OK = Vocab("ok")
_PATIENCE = 5.0  # s


class SceneBall:
    """The ball of a running simulator. Places are in the frame of the root (m). May be used in any thread.

    Methods raise RefusedError for what the simulator refuses, NoAnswerError without a valid reply, and MiddlewareError.
    """

    def __init__(self, client: RpcClient) -> None:
        self._client = client
        self._lock = threading.Lock()
        #: Where it was at first.
        self.start = self.place()

    @classmethod
    def find(cls, robot: str, network: Network, opened: ExitStack) -> SceneBall | None:
        """Return the ball of a robot's simulator, None for a real robot, or without a ball; ``opened`` closes it."""
        name = f"/{robot}{WORLD}"
        if not exists(network, Contact(name)):
            return None
        return cls(opened.enter_context(RpcClient("", name, network=network)))

    def place(self) -> FloatArray:
        """Return where its centre is."""
        reply = self._ask("world", "get", "ball")
        return from_world([as_float(one) for one in reply])

    def move(self, offset: Sequence[float]) -> None:
        """Put it at an offset from where it was at first."""
        place = to_world(self.start + np.asarray(offset, dtype=np.float64))
        self._ask("world", "set", "ball", *(float(one) for one in place))

    def _ask(self, *words: str | float) -> Bottle:
        with self._lock:
            reply = self._client.call(Bottle(list(words)), timeout=_PATIENCE)
        if reply is None or not len(reply):
            raise NoAnswerError(f"{self._client.name} did not answer {' '.join(map(str, words[:3]))}")
        if reply.get(0) == Vocab("fail"):
            raise RefusedError(str(reply.get(1)))
        return reply
