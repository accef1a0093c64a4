"""A request connection to a remote device. All of its failures are errors of robots."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any, TypeVar

from rtf.errors import RtfError
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.ports.rpc import RpcClient
from rtf.middleware.types.codecs import BOTTLE
from rtf.robot.errors import DeviceError, NoAnswerError

if TYPE_CHECKING:
    from rtf.bottle import Bottle
    from rtf.middleware.ports.network import Network
    from rtf.middleware.types.codecs import Codec

T = TypeVar("T")


class RpcConnection:
    """A client port of the RPC port ``server``, which reconnects after a lost connection.

    ``patience`` is the timeout of a reply in seconds of real time. Raises DeviceError if there is no server.
    """

    def __init__(self, name: str, server: str, *, patience: float, network: Network) -> None:
        self.server = server
        self._patience = patience
        self._lock = threading.Lock()
        try:
            self._client = RpcClient(name, server, network=network)
        except MiddlewareError as error:
            raise DeviceError(f"{name} cannot be connected to {server}: {error}; is its robot running?") from error

    def ask(self, request: object) -> Bottle:
        """Send a request and return the reply. Raises NoAnswerError if there is none, or an invalid one."""
        return self.ask_for(BOTTLE, request)

    def ask_for(self, codec: Codec[T], request: object) -> T:
        """Send a request and return the reply, decoded by a codec. Raises NoAnswerError likewise."""
        try:
            with self._lock:
                if not self._client.outputs:
                    self._client.add_output(self.server)
            found: Any = self._client.call(request, answer=codec, timeout=self._patience)
        except RtfError as error:
            raise NoAnswerError(f"{self.server} does not answer: {error}") from error
        if found is None:
            raise NoAnswerError(f"{self.server} gave no answer")
        answer: T = found
        return answer

    def close(self) -> None:
        """Close the port."""
        self._client.close()
