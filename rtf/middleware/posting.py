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


class PostingPort(Port):
    """A port that one thread writes to. A reader that takes longer than ``patience`` for a message is cut off."""

    def __init__(
        self, name: str, codec: Codec[Any] | None = None, *, network: Network | None = None, patience: float = PATIENCE
    ) -> None:
        self._codec = codec
        self._patience = patience
        self._owing: list[Output] = []
        super().__init__(name, network=network, inputs=False, promise=codec.promise if codec else "")

    def write(self, value: object, codec: Codec[Any] | None = None, *, envelope: str | None = None) -> int:
        """Send an object to every output; returns to how many. They may be still at work upon it.

        A reader gets the next message only when it has dealt with the one before.
        """
        self._check_open()
        if envelope is not None:
            self.envelope = envelope
        outputs = self.outputs
        if not outputs:
            return 0
        message = Outgoing("D", value, codec or self._codec or codec_of(value), self.network.dialect, self.envelope)
        if self._owing:
            self.settle()
        return sum([self._post(output, message) for output in outputs])

    def _post(self, output: Output, message: Outgoing) -> bool:
        try:
            with output.lock:
                output.link.send(message)
        except MiddlewareError as error:
            self._lost(output, error)
            return False
        if output.link.carrier.acknowledged:
            self._owing.append(output)
        return True

    def settle(self, timeout: float | None = None) -> bool:
        """Wait until all that was sent has been dealt with; its own patience bounds that, whatever ``timeout`` says."""
        del timeout
        owing, self._owing = self._owing, []
        for output in owing:
            try:
                with output.lock:
                    output.link.finish()
            except MiddlewareError as error:
                self._lost(output, error)
        return True

    def connected(self, output: Output) -> None:
        """See Port: a wait for it is bounded."""
        output.link.limit_waiting(self._patience)
