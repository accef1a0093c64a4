"""The buffered port: a queue between the network and its readers, and a sender thread for each output."""

from __future__ import annotations

import contextlib
import threading
from collections import deque
from typing import TYPE_CHECKING, Generic, NamedTuple, TypeVar

from rtf import clock
from rtf.middleware.carriers.uncaught import report_uncaught
from rtf.middleware.errors import PortClosedError, WaitTimeoutError
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.sender import Sender
from rtf.middleware.types.codecs import BOTTLE

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.ports.network import Network
    from rtf.middleware.ports.outputs import Output
    from rtf.middleware.types.codecs import Codec
    from rtf.middleware.wire.incoming_message import IncomingMessage

T = TypeVar("T")
_CLOSING = 5.0
#: Seconds that the message in transit has at the end of its connection.
_LAST = 1.0


class Received(NamedTuple, Generic[T]):
    """A received object, the name of the port that sent it, and the envelope of its message."""

    value: T
    sender: str
    envelope: str


class BufferedPort(Port, Generic[T]):
    """A port of objects of one type that blocks neither the sender nor the writer.

    A received object is stored until it is read: only the newest, or, if ``strict``, all of them in order. With a
    ``callback``, each object is passed to it in a separate thread instead. ``replier`` answers messages that want a
    reply. A message that the codec cannot decode closes the sender's connection. A reader that takes more than
    ``patience`` s for a message is removed; with None, those who wait for it wait without limit.
    """

    def __init__(
        self,
        name: str,
        codec: Codec[T] = BOTTLE,  # type: ignore[assignment]  # T is Bottle then
        *,
        strict: bool = False,
        callback: Callable[[Received[T]], None] | None = None,
        replier: Callable[[IncomingMessage], None] | None = None,
        network: Network | None = None,
        inputs: bool = True,
        outputs: bool = True,
        patience: float | None = None,
    ) -> None:
        self.codec = codec
        self.strict = strict
        self._patience = patience
        self.dropped = 0
        self._queue: deque[Received[T]] = deque()
        self._arrived = threading.Condition()
        self._replier = replier
        self._senders: dict[Output, Sender] = {}
        self._callback = callback
        self._caller: threading.Thread | None = None
        self._ended = False
        super().__init__(name, network=network, inputs=inputs, outputs=outputs, promise=codec.promise)
        if callback is not None:
            self._caller = threading.Thread(target=self._call_back, name=f"rtf-callback {self.name}", daemon=True)
            self._caller.start()

    # Reading -----------------------------------------------------------------------------------------------------

    @property
    def pending(self) -> int:
        """The number of objects that wait to be read."""
        return len(self._queue)

    def read(self, timeout: float | None = None) -> T:  # type: ignore[override]  # its objects are of one type
        """Return the next object. Raises WaitTimeoutError, and PortClosedError if the port is interrupted or closed."""
        return self.receive(timeout).value

    def poll(self) -> T | None:
        """Return the next object, or None if there is none. Does not wait."""
        with contextlib.suppress(IndexError):
            return self._queue.popleft().value
        return None

    def receive(self, timeout: float | None = None) -> Received[T]:
        """Return the next object with its sender and envelope. Raises the same errors as ``read``."""
        deadline = clock.Deadline.after(timeout)
        before = self.interruptions
        with self._arrived:
            while not self._queue:
                if self.interrupted or self.interruptions > before:
                    raise PortClosedError(f"{self.name} was interrupted while it was read")
                if deadline.expired:  # checked after the queue: another reader may have taken the object
                    raise WaitTimeoutError(f"no message arrived at {self.name} within {timeout:g} s")
                self._arrived.wait(None if timeout is None else deadline.remaining())
            return self._queue.popleft()

    def deliver(self, delivery: IncomingMessage) -> None:
        """Store the received object. The sender does not wait until it is read. Runs in the thread of the input."""
        if self.interrupted:
            return
        if delivery.wants_reply and self._replier is not None:
            self._replier(delivery)
            return
        received = Received(delivery.read(self.codec), delivery.sender, delivery.envelope)
        with self._arrived:
            if self._queue and not self.strict:
                self._queue.clear()
                self.dropped += 1
            self._queue.append(received)
            self._arrived.notify()

    def _call_back(self) -> None:
        assert self._callback is not None
        while not self._ended:
            with contextlib.suppress(PortClosedError):
                received = self.receive()
                try:
                    self._callback(received)
                except Exception as error:  # noqa: BLE001 - reported like that of any thread; the next object is passed on
                    report_uncaught(error)
            with self._arrived:
                self._arrived.wait_for(lambda: self._ended or not self.interrupted)

    def interrupt(self) -> None:
        super().interrupt()
        with self._arrived:
            self._arrived.notify_all()

    def resume(self) -> None:
        super().resume()
        with self._arrived:
            self._arrived.notify_all()

    # Writing -----------------------------------------------------------------------------------------------------

    def write(  # type: ignore[override]  # the type of its objects is settled
        self, value: T, *, envelope: str | None = None, strict: bool = False
    ) -> int:
        """Send an object in the background. Returns the number of outputs that accepted it.

        An output that is still sending the previous message is skipped; if ``strict``, the call waits for all of them
        first. The object may be changed after the call, except while a ``local`` reader in this process uses it.
        """
        message = self._message(value, self.codec, envelope)
        if message is None:
            return 0
        message.freeze()
        with self._lock:
            senders = [*self._senders.values()]
        if strict:
            for sender in senders:
                sender.wait()
        return sum([sender.offer(message, patiently=strict) for sender in senders])

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until all written messages are sent. Return False if ``timeout`` seconds pass first."""
        deadline = clock.Deadline.after(timeout)
        with self._lock:
            senders = [*self._senders.values()]
        return all(sender.wait(None if timeout is None else deadline.remaining()) for sender in senders)

    def connected(self, output: Output) -> None:
        """Start a sender thread for the output."""
        if self._patience is not None:
            output.link.limit_waiting(self._patience)
        with self._lock:
            if output in self._outputs:  # it may have been removed in the meantime
                self._senders[output] = Sender(output, self._lost)

    def disconnected(self, output: Output) -> None:
        with self._lock:
            sender = self._senders.pop(output, None)
        if sender is not None:
            sender.close()
            sender.join(_LAST)  # it sends the message in transit

    def close(self) -> None:
        with self._lock:
            senders, self._senders = [*self._senders.values()], {}
        last = clock.Deadline.after(_LAST)
        for sender in senders:
            sender.close()
        for sender in senders:
            sender.join(last.remaining())
        self._ended = True
        super().close()
        for sender in senders:
            sender.join(_CLOSING)
        if self._caller is not None and self._caller is not threading.current_thread():
            self._caller.join(_CLOSING)
