"""Outgoing connections of a port."""

from __future__ import annotations

import errno
import threading
from functools import partial
from typing import TYPE_CHECKING

from rtf.middleware.carriers import registry
from rtf.middleware.errors import ConnectError, MiddlewareError
from rtf.middleware.ports import monitoring
from rtf.middleware.ports.dialect_probe import dialect_of_reader
from rtf.middleware.ports.qos import Connection
from rtf.middleware.types.codecs import other_dialect
from rtf.middleware.wire import modifiers

if TYPE_CHECKING:
    import socket as sockets
    from collections.abc import Callable, Iterable, Sequence

    from rtf.bottle import Dialect
    from rtf.middleware.carriers.base import CarrierPort, OutputLink
    from rtf.middleware.monitors.attached import Attached
    from rtf.middleware.ports.network import Network
    from rtf.middleware.types.codecs import Codec
    from rtf.middleware.wire.contact import Contact
    from rtf.middleware.wire.outgoing_message import OutgoingMessage

#: The local port number of the handshake is used for datagrams too, and may be taken; a retry gets another one.
_ATTEMPTS = 5


class Output(Connection):
    """One outgoing connection. Several threads may send.

    ``ask`` finds out the dialect of the other end, see :mod:`rtf.middleware.ports.dialect_probe`; it is called at once,
    and again where it is unknown and a message would differ. A lock keeps each message together with its
    reply and acknowledgement.
    """

    def __init__(self, link: OutputLink, target: Contact, ask: Callable[[], Dialect | None]) -> None:
        self.link = link
        self.target = target
        #: The name of the port that sends.
        self.source = ""
        self.lock = threading.Lock()
        self._timeout: float | None = None
        self._ask = ask
        #: The dialect of the other end; None: unknown.
        self.dialect = ask()
        #: The monitor of all outputs of the port, and what returns those of its other outputs.
        self.port_monitor: Attached | None = None
        self.others: Callable[[], Iterable[Attached]] = tuple

    @property
    def peer(self) -> str:
        return self.target.name

    @property
    def carrier(self) -> str:
        name = self.link.carrier.name
        return self.target.carrier if modifiers.split(self.target.carrier)[0] == name else name

    @property
    def connectionless(self) -> bool:
        return self.link.carrier.connectionless

    @property
    def socket(self) -> sockets.socket | None:
        return self.link.endpoint

    def monitored(self, message: OutgoingMessage) -> OutgoingMessage | None:
        """Return the message that is sent, as :meth:`encoded`; None if a monitor drops it."""
        if self.monitor is None and self.port_monitor is None:
            return self.encoded(message)
        passed = monitoring.outgoing(message, self.source, self.monitors, self.others)
        return None if passed is None else self.encoded(passed)

    @property
    def monitors(self) -> list[Attached]:
        """The monitors that look at its messages."""
        return [one for one in (self.port_monitor, self.monitor) if one is not None]

    def encoded(self, message: OutgoingMessage) -> OutgoingMessage:
        """Return the message in the dialect of this reader.

        Raises ConnectError if the reader's is not known and the bytes would not be the same in both.
        """
        dialect = self.dialect
        if dialect is message.dialect:
            return message
        if dialect is not None:
            return message.in_dialect(dialect)
        other = message.in_dialect(other_dialect(message.dialect))
        if b"".join(other.blocks) == b"".join(message.blocks):
            return message
        self.dialect = self._ask()  # it may only have been busy
        if self.dialect is None:
            raise ConnectError(
                f"{self.peer} does not tell whether it speaks YARP 3 or 4, in which this message differs;"
                " set RTF_DIALECT to 3 or 4"
            )
        return message.in_dialect(self.dialect)

    def call(self, message: OutgoingMessage, codec: Codec[object], timeout: float | None = None) -> object | None:
        """Send a message and return its reply, decoded with ``codec``. Raises WaitTimeoutError."""
        with self.lock:
            if timeout != self._timeout:  # saves a system call
                self.link.limit_waiting(timeout)
                self._timeout = timeout
            sent = self.monitored(message)
            if sent is None:
                return None
            self.link.send(sent)
            reply, spoken = self.link.receive_reply_in_any(codec, message.dialect)
            if spoken is not message.dialect:
                self.dialect = spoken
            self.link.finish()
            if reply is not None and (self.monitor is not None or self.port_monitor is not None):
                reply = monitoring.received_reply(reply, codec, message, self.peer, self.monitors)
            return reply

    def close(self, *, politely: bool = True) -> None:
        """End the connection; ``politely`` notifies the peer first, if no other thread is waiting in it."""
        try:
            if not politely or not self.lock.acquire(timeout=1.0):
                self.link.close(politely=False)  # another thread is waiting in it: that wait ends now
                return
            try:
                self.link.close()
            finally:
                self.lock.release()
        finally:
            if self.monitor is not None:
                self.monitor.end()  # last: it looks at a message that is sent meanwhile


def connect(network: Network, port: CarrierPort, target: Contact) -> Output:
    """Open a connection from ``port`` to a port whose address and carrier are known. Raises ConnectError."""
    carrier = registry.by_name(target.carrier)
    for left in reversed(range(_ATTEMPTS)):
        stream = network.reach(target)
        try:
            link = carrier.connect(stream, port, target)
            stream.limit_waiting(None)
            break
        except (MiddlewareError, OSError) as error:
            stream.close()
            taken = isinstance(error, OSError) and error.errno == errno.EADDRINUSE
            if not (taken and left):
                raise ConnectError(f"Cannot connect to {target.name}: {error}") from None
    try:
        return Output(link, target, partial(dialect_of_reader, network, carrier, target))
    except BaseException:  # such as a stop of the test that waits for the reader's answer
        link.close(politely=False)
        raise


def send_to_all(
    outputs: Sequence[Output], message: OutgoingMessage, failed: Callable[[Output, MiddlewareError], None]
) -> int:
    """Send one message to every output, then wait until all have acknowledged it. Return how many have.

    The readers work in parallel: the slowest one determines the duration, not their sum.
    """
    if len(outputs) == 1:
        return _send_to_one(outputs[0], message, failed)
    waiting: list[Output] = []
    done = 0
    try:
        for output in outputs:
            output.lock.acquire()
            waiting.append(output)
            try:
                sent = output.monitored(message)
                if sent is None:
                    waiting.pop()
                    output.lock.release()
                    continue
                output.link.send(sent)
            except MiddlewareError as error:
                waiting.pop()
                output.lock.release()
                failed(output, error)
        while waiting:
            output = waiting[0]
            try:
                output.link.finish()
                done += 1
            except MiddlewareError as error:
                failed(output, error)
            finally:
                waiting.pop(0)
                output.lock.release()
    finally:
        for output in waiting:
            output.lock.release()
    return done


def _send_to_one(output: Output, message: OutgoingMessage, failed: Callable[[Output, MiddlewareError], None]) -> int:
    """Send to a single output, the usual case, without the bookkeeping for several."""
    link = output.link
    with output.lock:
        try:
            sent = output.monitored(message)
            if sent is None:
                return 0
            link.send(sent)
            link.finish()
        except MiddlewareError as error:
            broken = error
        else:
            return 1
    failed(output, broken)
    return 0
