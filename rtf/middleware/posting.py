"""The posting port: it sends without waiting, and waits for all acknowledgements at once when told to.

A simulator publishes many messages at one moment of its time. They travel, and are dealt with, while it computes the
next step; before it lets anybody act upon that moment it settles.

To wake a reader costs more than to make its message. A port may therefore keep some messages together: they leave in
one piece when there are enough of them, or when it settles.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

from rtf.middleware.codecs import codec_of
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.outgoing import Outgoing
from rtf.middleware.port import Port

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.codecs import Codec
    from rtf.middleware.network import Network
    from rtf.middleware.outputs import Output

T = TypeVar("T")
#: Seconds that a reader may take for a message before it is cut off.
PATIENCE = 5.0
#: Messages that are on their way to a reader before it is waited for.
MOST = 16


class PostingPort(Port):
    """A port that one thread at a time writes to. A reader that takes more than ``patience`` for a message is cut off.

    Where the carrier allows it several messages are on their way to a reader, :data:`MOST` at the most. ``together`` of
    them are kept until they leave in one piece; ``settle`` sends all.
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
        self._kept: list[Outgoing] = []
        self._posted = 0  # since it was settled
        super().__init__(name, network=network, inputs=False, promise=codec.promise if codec else "")

    def write(self, value: object, codec: Codec[Any] | None = None, *, envelope: str | None = None) -> int:
        """Send an object to every output; returns to how many. They may be still at work upon it.

        It must not change until the port has settled; if messages are kept together, only readers of this process that
        share it would notice.
        """
        self._check_open()
        if envelope is not None:
            self.envelope = envelope
        outputs = self._outputs
        if not outputs:
            return 0
        message = Outgoing("D", value, codec or self._codec or codec_of(value), self.network.dialect, self.envelope)
        if self._together == 1:
            return self._send((message,))
        message.freeze()
        self._kept.append(message)
        if len(self._kept) >= self._together:
            self._send_kept()
        return len(outputs)

    def _send_kept(self) -> None:
        messages, self._kept = self._kept, []
        self._send(messages)

    def _send(self, messages: Sequence[Outgoing]) -> int:
        """Send messages to every output, all or none; returns to how many."""
        if self._posted + len(messages) > MOST:
            self._wait_for_all()
        self._posted += len(messages)
        sent = 0
        for output in self._outputs:
            try:
                with output.lock:
                    output.link.send_all(messages)
            except MiddlewareError as error:
                self._lost(output, error)
            else:
                sent += 1
        return sent

    def settle(self, timeout: float | None = None) -> bool:
        """Wait until all that was sent has been dealt with; its own patience bounds that, whatever ``timeout`` says."""
        del timeout
        self.flush()
        if self._posted:
            self._wait_for_all()
        return True

    def flush(self) -> None:
        """Send what is kept, without waiting for anybody."""
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
        """See Port: a wait for it is bounded."""
        output.link.limit_waiting(self._patience)
