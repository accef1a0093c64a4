"""The posting port: it sends without waiting, and waits for all acknowledgements at once when told to.

A simulator publishes many messages at one moment of its time. They travel, and are dealt with, while it computes the
next step; before it lets anybody act upon that moment it settles.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

from rtf.middleware.codecs import codec_of
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.outgoing import Outgoing
from rtf.middleware.port import Port

if TYPE_CHECKING:
    from rtf.middleware.codecs import Codec
    from rtf.middleware.network import Network
    from rtf.middleware.outputs import Output

T = TypeVar("T")
#: Seconds that a reader may take for a message before it is cut off.
PATIENCE = 5.0
#: Messages that are on their way to a reader before it is waited for.
MOST = 16


class PostingPort(Port):
    """A port that one thread writes to. A reader that takes longer than ``patience`` for a message is cut off.

    Where the carrier allows it several messages are on their way to a reader, :data:`MOST` at the most.
    """

    def __init__(
        self, name: str, codec: Codec[Any] | None = None, *, network: Network | None = None, patience: float = PATIENCE
    ) -> None:
        self._codec = codec
        self._patience = patience
        self._posted = 0  # since it was settled
        super().__init__(name, network=network, inputs=False, promise=codec.promise if codec else "")

    def write(self, value: object, codec: Codec[Any] | None = None, *, envelope: str | None = None) -> int:
        """Send an object to every output; returns to how many. They may be still at work upon it."""
        self._check_open()
        if envelope is not None:
            self.envelope = envelope
        outputs = self._outputs
        if not outputs:
            return 0
        message = Outgoing("D", value, codec or self._codec or codec_of(value), self.network.dialect, self.envelope)
        if self._posted >= MOST:
            self.settle()
        self._posted += 1
        sent = 0
        for output in outputs:
            link = output.link
            try:
                with output.lock:
                    if not link.queues:
                        link.finish()
                    link.send(message)
            except MiddlewareError as error:
                self._lost(output, error)
            else:
                sent += 1
        return sent

    def settle(self, timeout: float | None = None) -> bool:
        """Wait until all that was sent has been dealt with; its own patience bounds that, whatever ``timeout`` says."""
        del timeout
        if not self._posted:
            return True
        self._posted = 0
        for output in self._outputs:
            try:
                with output.lock:
                    output.link.finish()
            except MiddlewareError as error:
                self._lost(output, error)
        return True

    def connected(self, output: Output) -> None:
        """See Port: a wait for it is bounded."""
        output.link.limit_waiting(self._patience)
