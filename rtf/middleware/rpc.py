"""Questions and answers: the port that asks, and the one that is asked."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar, overload

from rtf.middleware.codecs import BOTTLE, codec_of
from rtf.middleware.errors import ConnectError, MiddlewareError
from rtf.middleware.outgoing import Outgoing
from rtf.middleware.port import Port

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.bottle import Bottle
    from rtf.middleware.codecs import Codec
    from rtf.middleware.delivery import Delivery
    from rtf.middleware.names import Contact
    from rtf.middleware.network import Network

T = TypeVar("T")


class RpcServer(Port):
    """Answers questions. ``handle`` gets each and returns the answer; questions of one client come one after the other.

    Different clients are served at the same time, each in its own thread. An error in ``handle`` ends that client's
    connection.
    """

    def __init__(self, name: str, handle: Callable[[Bottle], object], *, network: Network | None = None) -> None:
        self._handle = handle
        super().__init__(name, self._answer, network=network, outputs=False, rpc=True)

    def _answer(self, delivery: Delivery) -> None:
        delivery.reply(self._handle(delivery.read()))


class RpcClient(Port):
    """Asks one server. With ``target`` it is connected at once."""

    def __init__(self, name: str, target: str | Contact | None = None, *, network: Network | None = None) -> None:
        super().__init__(name, network=network, inputs=False, rpc=True)
        if target is not None:
            try:
                self.add_output(target)
            except MiddlewareError:
                self.close()
                raise

    def add_output(self, target: str | Contact, carrier: str = "") -> Contact:
        """See Port; there may be one."""
        if self.outputs:
            raise ConnectError("RPC output already connected")
        return super().add_output(target, carrier)

    @overload
    def call(
        self, question: object, *, codec: Codec[Any] | None = None, timeout: float | None = None
    ) -> Bottle | None: ...
    @overload
    def call(
        self, question: object, *, codec: Codec[Any] | None = None, answer: Codec[T], timeout: float | None = None
    ) -> T | None: ...
    def call(
        self,
        question: object,
        *,
        codec: Codec[Any] | None = None,
        answer: Codec[Any] = BOTTLE,
        timeout: float | None = None,
    ) -> Any:
        """Ask, and wait for the answer, which is read as ``answer`` says; None when the server has none to give.

        After an error (WaitTimeoutError, a connection that broke) the connection is closed, and so it is when the call
        is broken off, as by a test that is told to stop: an answer that comes late must not be taken for that to the
        next question.
        """
        if self._closed:
            self._check_open()
        outputs = self._outputs
        if not outputs:
            raise ConnectError(f"{self.name} is not connected to a server")
        output = outputs[0]
        dialect = output.dialect or self.network.dialect
        message = Outgoing("d", question, codec or codec_of(question), dialect, self.envelope)
        try:
            return output.call(message, answer, timeout)
        except BaseException as error:
            self._lost(output, error)
            raise
