"""A connection that a port sends through."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from rtf.middleware.errors import MiddlewareError
from rtf.middleware.qos import Connection

if TYPE_CHECKING:
    import socket as sockets
    from collections.abc import Callable, Sequence

    from rtf.bottle import Dialect
    from rtf.middleware.carriers.base import OutputLink
    from rtf.middleware.codecs import Codec
    from rtf.middleware.names import Contact
    from rtf.middleware.outgoing import Outgoing


class Output(Connection):
    """One reader of a port. Several threads may send; each message, its reply and acknowledgement stay together."""

    def __init__(self, link: OutputLink, target: Contact) -> None:
        self.link = link
        self.target = target
        self.lock = threading.Lock()
        self._timeout: float | None = None
        #: What the other end is taken to speak, since it replied.
        self.dialect: Dialect | None = None

    @property
    def peer(self) -> str:
        return self.target.name

    @property
    def carrier(self) -> str:
        return self.link.carrier.name

    @property
    def connectionless(self) -> bool:
        return self.link.carrier.connectionless

    @property
    def socket(self) -> sockets.socket | None:
        return self.link.endpoint

    def call(self, message: Outgoing, codec: Codec[object], timeout: float | None = None) -> object | None:
        """Send a message and wait for its reply, which ``codec`` reads. Raises WaitTimeoutError."""
        with self.lock:
            if timeout != self._timeout:  # a system call that is worth saving
                self.link.limit_waiting(timeout)
                self._timeout = timeout
            self.link.send(message)
            reply, self.dialect = self.link.receive_reply_in_any(codec, message.dialect)
            self.link.finish()
            return reply

    def close(self, *, politely: bool = True) -> None:
        """End the connection."""
        if not politely or not self.lock.acquire(timeout=1.0):
            self.link.close(politely=False)  # somebody is waiting in it: that wait ends now
            return
        try:
            self.link.close()
        finally:
            self.lock.release()


def send_to_all(outputs: Sequence[Output], message: Outgoing, failed: Callable[[Output, MiddlewareError], None]) -> int:
    """Send one message to every output, then wait until all have dealt with it; returns how many have.

    The readers work at the same time: the slowest one decides how long it takes, not their sum.
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
                output.link.send(message)
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


def _send_to_one(output: Output, message: Outgoing, failed: Callable[[Output, MiddlewareError], None]) -> int:
    """The same for one output, which is what most ports have, without keeping account of several."""
    link = output.link
    with output.lock:
        try:
            link.send(message)
            link.finish()
        except MiddlewareError as error:
            broken = error
        else:
            return 1
    failed(output, broken)
    return 0
