"""Remote procedure calls: the server port and the client port."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar, overload

from rtf.middleware.errors import ConnectError, MiddlewareError
from rtf.middleware.ports.port import Port
from rtf.middleware.types.codecs import BOTTLE, codec_of
from rtf.middleware.wire.outgoing_message import OutgoingMessage

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.bottle import Bottle
    from rtf.middleware.ports.network import Network
    from rtf.middleware.types.codecs import Codec
    from rtf.middleware.wire.contact import Contact
    from rtf.middleware.wire.incoming_message import IncomingMessage

T = TypeVar("T")


class RpcServer(Port):
    """A port that answers requests. ``handle`` gets each request and returns the reply.

    The requests of one client are handled in order. Different clients are served in parallel, each in a thread of its
    own. An error in ``handle`` ends that client's connection.
    """

    def __init__(
        self,
        name: str,
        handle: Callable[[Bottle], object],
        *,
        network: Network | None = None,
        guarded: bool = False,
    ) -> None:
        self._handle = handle
        super().__init__(name, self._answer, network=network, outputs=False, rpc=True, guarded=guarded)

    def _answer(self, delivery: IncomingMessage) -> None:
        delivery.reply(self._handle(delivery.read()))


class RpcClient(Port):
    """A port that sends requests to one server. With ``target`` the constructor connects it."""

    def __init__(self, name: str, target: str | Contact | None = None, *, network: Network | None = None) -> None:
        super().__init__(name, network=network, inputs=False, rpc=True)
        if target is not None:
            try:
                self.add_output(target)
            except MiddlewareError:
                self.close()
                raise

    def add_output(self, target: str | Contact, carrier: str = "") -> Contact:
        """Connect to the server. Only one connection is allowed."""
        if self.outputs:
            raise ConnectError("RPC output already connected")
        return super().add_output(target, carrier)

    @overload
    def call(
        self, request: object, *, codec: Codec[Any] | None = None, timeout: float | None = None
    ) -> Bottle | None: ...
    @overload
    def call(
        self, request: object, *, codec: Codec[Any] | None = None, answer: Codec[T], timeout: float | None = None
    ) -> T | None: ...
    def call(
        self,
        request: object,
        *,
        codec: Codec[Any] | None = None,
        answer: Codec[Any] = BOTTLE,
        timeout: float | None = None,
    ) -> Any:
        """Send a request and return the reply, decoded with ``answer``; None if the server has no reply.

        After any exception (WaitTimeoutError, a lost connection, or one that interrupts the call, such as a stop of the
        test) the connection is closed: a late reply must not be taken for that to the next request.
        """
        if self._closed:
            self._check_open()
        outputs = self._outputs
        if not outputs:
            raise ConnectError(f"{self.name} is not connected to a server")
        output = outputs[0]
        dialect = output.dialect or self.network.dialect
        message = self._last.written = OutgoingMessage("d", request, codec or codec_of(request), dialect, self.envelope)
        try:
            return output.call(message, answer, timeout)
        except BaseException as error:
            self._lost(output, error)
            raise
