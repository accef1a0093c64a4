"""A connection that a port receives from: its thread, from the first byte of the handshake to the end."""

from __future__ import annotations

import contextlib
import threading
from typing import TYPE_CHECKING

from rtf.errors import RtfError
from rtf.middleware.carriers import registry
from rtf.middleware.errors import ProtocolError
from rtf.middleware.naming import authentication
from rtf.middleware.qos import Connection
from rtf.middleware.stream import Stream, StreamClosedError

if TYPE_CHECKING:
    import socket as sockets

    from rtf.middleware.carriers.base import InputLink
    from rtf.middleware.port import Port

#: Seconds that a caller may take to say what it wants. People type handshakes by hand, so it is long.
_PATIENCE = 60.0
_HEADER = 8
#: Commands after which nothing more is received.
_LAST = frozenset("qr")


class Input(Connection):
    """One caller of a port. Until its handshake is done it has no ``link``."""

    def __init__(self, port: Port, connection: sockets.socket) -> None:
        self.port = port
        self.link: InputLink | None = None
        self.official = False  # the port has been told of it
        self._closing = False
        #: What the caller is taken to speak; found out as soon as it says something that is only possible in one.
        self.dialect = port.network.dialect
        self._turned = False  # the stream is an output's now
        self._stream = Stream(connection)
        self._thread = threading.Thread(target=self._run, name=f"rtf-input {port.name}", daemon=True)

    @property
    def sender(self) -> str:
        """The name of the caller, or an empty text while it has not said."""
        return "" if self.link is None else self.link.sender

    @property
    def peer(self) -> str:
        """See Connection."""
        return self.sender

    @property
    def carrier(self) -> str:
        """See Connection."""
        return "" if self.link is None else self.link.carrier.name

    @property
    def connectionless(self) -> bool:
        """See Connection."""
        return self.link is not None and self.link.carrier.connectionless

    @property
    def socket(self) -> sockets.socket | None:
        """See Connection."""
        return self._stream.socket if self.link is None else self.link.endpoint

    @property
    def is_here(self) -> bool:
        """Whether this is its thread."""
        return self._thread is threading.current_thread()

    def start(self) -> None:
        """Begin to listen to the caller."""
        self._thread.start()

    def close(self) -> None:
        """Hang up. The thread ends when it notices, which is at once unless it is in a callback."""
        self._closing = True
        if self.link is not None:
            self.link.close()
        self._stream.wake()

    def join(self, timeout: float) -> None:
        """Wait for the thread to end; not when this is the thread."""
        if not self.is_here:
            self._thread.join(timeout)

    def _run(self) -> None:
        self.thread = threading.get_native_id()
        try:
            with contextlib.suppress(StreamClosedError):
                self._serve()
        except RtfError as error:
            self.port.complain(self, error)
        finally:
            if not self._turned:
                if self.link is not None:
                    self.link.close()
                    self.link.release()
                self._stream.close()
            self.port.left(self)

    def _serve(self) -> None:
        stream = self._stream
        stream.limit_waiting(_PATIENCE)
        if self.port.network.key:
            authentication.accept(stream, self.port.network.key)
        header = bytes(stream.take(_HEADER))
        carrier = registry.for_header(header)
        if carrier is None:
            stream.send(_UNKNOWN)
            raise ProtocolError(f"{header!r} begins no carrier that is known here")
        self.link = link = carrier.accept(stream, self.port)
        if self._closing:  # whoever said so found no link to close
            return
        stream.limit_waiting(None)
        self.port.joined(self)
        receive, answer, dispatch = link.receive, link.answer, self.port.dispatch
        while True:
            key, text, data = receive()
            if key in _LAST and (key == "q" or text in ("", "r")):  # and not a word that happens to begin so
                answer()
                if key == "r":
                    self._turn_round(link)
                return
            answer(*dispatch(self, key, text, data))
            del data  # whoever keeps it now makes it theirs

    def _turn_round(self, link: InputLink) -> None:
        from rtf.middleware.reversing import turned_round

        self.port.adopt(turned_round(link, self._stream))
        self._turned = True


_UNKNOWN = (
    b"* Error. This is a port of a robot's network, and what you sent begins no carrier it knows.\r\n"
    b"* With telnet, type CONNECT and a name first, then d and a line of data, or ? for help.\r\n"
    b"* Goodbye.\r\n"
)
