"""The pipelined port: it sends without waiting for acknowledgements and awaits them all in ``settle``.

A simulator publishes many messages at one moment of its time. They travel and are processed while it computes the next
step; ``settle`` waits for them before any participant acts on that moment.

Waking a reader costs more than encoding a message. A port may therefore collect a batch of messages, which is sent in
one piece when it is full or when the port settles.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

from rtf.middleware.errors import MiddlewareError
from rtf.middleware.ports.port import Port

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.ports.network import Network
    from rtf.middleware.ports.outputs import Output
    from rtf.middleware.types.codecs import Codec
    from rtf.middleware.wire.outgoing_message import OutgoingMessage

T = TypeVar("T")
#: Seconds that a reader may take for a message before it is disconnected.
PATIENCE = 5.0
#: Messages that may be unacknowledged before the port waits for the reader.
MOST = 16


class PipelinedPort(Port):
    """A port for one writing thread at a time. A reader that takes more than ``patience`` s for a message is removed.

    If the carrier allows it, up to :data:`MOST` messages are unacknowledged at a time. ``together`` is the size of a
    batch; ``settle`` sends an incomplete one.
    """

    def __init__(
        self,
        name: str,
        codec: Codec[Any] | None = None,
        *,
        network: Network | None = None,
        patience: float = PATIENCE,
        together: int = 1,
    ) -> None:
        self._codec = codec
        self._patience = patience
        self._together = together
        self._kept: list[OutgoingMessage] = []
        self._posted = 0  # since the last settle
        super().__init__(name, network=network, inputs=False, promise=codec.promise if codec else "")

    def write(self, value: object, codec: Codec[Any] | None = None, *, envelope: str | None = None) -> int:
        """Send an object to every output and return their number. They may not have received it yet.

        The object must not change until the port has settled. In a batch only ``local`` readers, which share the
        object, would notice a change.
        """
        message = self._message(value, codec or self._codec, envelope)
        if message is None:
            return 0
        if self._together == 1:
            return self._send((message,))
        message.freeze()
        self._kept.append(message)
        if len(self._kept) >= self._together:
            self._send_kept()
        return len(self._outputs)

    def _send_kept(self) -> None:
        messages, self._kept = self._kept, []
        self._send(messages)

    def _send(self, messages: Sequence[OutgoingMessage]) -> int:
        """Send messages to every output. Return the number of outputs that got all of them."""
        if self._posted + len(messages) > MOST:
            self._wait_for_all()
        self._posted += len(messages)
        sent = 0
        for output in self._outputs:
            try:
                with output.lock:
                    output.link.send_all(
                        [passed for message in messages if (passed := output.monitored(message)) is not None]
                    )
            except MiddlewareError as error:
                self._lost(output, error)
            else:
                sent += 1
        return sent

    def settle(self, timeout: float | None = None) -> bool:
        """Send the batch and wait for all acknowledgements. The wait is limited by ``patience``, not by ``timeout``."""
        del timeout
        self.flush()
        if self._posted:
            self._wait_for_all()
        return True

    def flush(self) -> None:
        """Send an incomplete batch, without waiting for acknowledgements."""
        if self._kept:
            self._send_kept()

    def _wait_for_all(self) -> None:
        self._posted = 0
        for output in self._outputs:
            try:
                with output.lock:
                    output.link.finish()
            except MiddlewareError as error:
                self._lost(output, error)

    def connected(self, output: Output) -> None:
        """Limit every wait for the output to ``patience``."""
        output.link.limit_waiting(self._patience)
