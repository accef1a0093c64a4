"""A connection that a port receives from, from the first byte of the handshake to the end.

It has a thread of its own, which waits for messages, has the port deal with them, and answers. Where that takes no
time, because the port only keeps what comes (see :class:`~rtf.middleware.port.Port`), the thread ends after the first
message and the connection is *gathered*: one thread reads all of them. A dozen streams would else be a dozen threads
that get into each other's way. What is more than a small message of data gives a connection its own thread back.
"""

from __future__ import annotations

import contextlib
import threading
from typing import TYPE_CHECKING

from rtf.errors import RtfError
from rtf.middleware.carriers import registry
from rtf.middleware.carriers.base import GatheredLink
from rtf.middleware.errors import ProtocolError
from rtf.middleware.naming import authentication
from rtf.middleware.qos import Connection
from rtf.middleware.stream import CHUNK, Stream, StreamClosedError
from rtf.middleware.watching import Watcher

if TYPE_CHECKING:
    import socket as sockets
    from collections.abc import Callable

    from rtf.middleware.carriers.base import InputLink, Message
    from rtf.middleware.port import Port

#: Seconds that a caller may take to say what it wants. People type handshakes by hand, so it is long.
_PATIENCE = 60.0
_HEADER = 8
#: Commands after which nothing more is received.
_LAST = frozenset("qr")
#: Reads all connections that are gathered.
_GATHERER = Watcher("rtf-gatherer")


class Input(Connection):
    """One caller of a port. Until its handshake is done it has no ``link``."""

    instead = "one thread reads all streams that are only kept"

    def __init__(self, port: Port, connection: sockets.socket) -> None:
        self.port = port
        self.link: InputLink | None = None
        self.official = False  # the port has been told of it
        self._closing = False
        #: What the caller is taken to speak; found out as soon as it says something that is only possible in one.
        self.dialect = port.network.dialect
        self._turned = False  # the stream is an output's now
        self._gathered = False
        self._changing = threading.Lock()  # between being gathered and not
        self._ended = threading.Event()
        self._stream = Stream(connection)
        self._thread = self._new_thread(self._serve)

    @property
    def sender(self) -> str:
        """The name of the caller, or an empty text while it has not said."""
        return "" if self.link is None else self.link.sender

    @property
    def peer(self) -> str:
        return self.sender

    @property
    def carrier(self) -> str:
        return "" if self.link is None else self.link.carrier.name

    @property
    def connectionless(self) -> bool:
        return self.link is not None and self.link.carrier.connectionless

    @property
    def socket(self) -> sockets.socket | None:
        return self._stream.socket if self.link is None else self.link.endpoint

    @property
    def is_here(self) -> bool:
        """Whether this is the thread that deals with it."""
        return _GATHERER.is_here if self._gathered else self._thread is threading.current_thread()

    def start(self) -> None:
        """Begin to listen to the caller."""
        self._thread.start()

    def close(self) -> None:
        """Hang up. Its thread notices, which is at once unless it is in a callback, and ends it."""
        with self._changing:
            self._closing = True
            if not self._gathered and self.link is not None:
                self.link.close()
        self._stream.wake()

    def join(self, timeout: float) -> None:
        """Wait for its end; not in the thread that deals with it."""
        if not self.is_here and self._ended.wait(timeout) and self._thread is not threading.current_thread():
            self._thread.join(timeout)

    # In a thread of its own ------------------------------------------------------------------------------------------

    def _new_thread(self, work: Callable[[], bool]) -> threading.Thread:
        def run() -> None:
            self.thread = threading.get_native_id()
            self._do(work)

        return threading.Thread(target=run, name=f"rtf-input {self.port.name}", daemon=True)

    def _do(self, work: Callable[[], bool]) -> None:
        """Do some of its work, and end it unless that says that it goes on."""
        goes_on = False
        try:
            with contextlib.suppress(StreamClosedError):
                goes_on = work()
        except RtfError as error:
            self.port.complain(self, error)
        finally:
            if not goes_on:
                self._end()

    def _end(self) -> None:
        if self._gathered:
            _GATHERER.remove(self._stream.socket)
        if not self._turned:
            if self.link is not None:
                self.link.close()
                self.link.release()
            self._stream.close()
        self.port.left(self)
        self._ended.set()

    def _serve(self) -> bool:
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
            return False
        self.port.joined(self)
        link.welcome(stream, self.port)
        stream.limit_waiting(None)
        return self._receive_all(link, link.receive())

    def _receive_all(self, link: InputLink, message: Message) -> bool:
        """Deal with messages, this one first; returns whether the connection goes on elsewhere."""
        receive, answer, dispatch = link.receive, link.answer, self.port.dispatch
        gathers = self.port.keeps and isinstance(link, GatheredLink)
        # What one that was hung up on has sent before is older than what comes from whoever took its place.
        while not self._closing:
            key, text, data = message
            if key in _LAST and (key == "q" or text in ("", "r")):  # and not a word that happens to begin so
                answer()
                if key == "r":
                    self._turn_round(link)
                return False
            answer(*dispatch(self, key, text, data))
            del message, data  # whoever keeps it now makes it theirs
            if gathers and key == "D" and 0 < link.missing() <= CHUNK:  # type: ignore[attr-defined]  # see gathers
                return self._be_gathered()
            message = receive()
        return False

    def _turn_round(self, link: InputLink) -> None:
        from rtf.middleware.reversing import turned_round

        self.port.adopt(turned_round(link, self._stream))
        self._turned = True

    def _be_gathered(self) -> bool:
        """Leave this thread; False when the connection has been closed."""
        with self._changing:
            if self._closing:
                return False
            self._gathered = True
            self.thread = 0
            _GATHERER.add(self._stream.socket, self._ready)
            return True

    # In the thread that reads all that are gathered -----------------------------------------------------------------

    def _ready(self) -> None:
        """Something has come, or the end."""
        if self._gathered and not self._ended.is_set():
            self._do(self._gather)

    def _gather(self) -> bool:
        """Deal with all messages that are there as a whole."""
        link, dispatch = self.link, self.port.dispatch
        assert isinstance(link, GatheredLink)
        link.fill()
        dealt = 0
        while not (missing := link.missing()):
            if self._closing:  # see _receive_all
                return False
            message = link.receive()
            key, text, data = message
            if key != "D":
                link.acknowledge(dealt)
                return self._take_thread(message)
            dispatch(self, key, text, data)
            dealt += 1
        link.acknowledge(dealt)
        return missing <= CHUNK or self._take_thread(None)

    def _take_thread(self, message: Message | None) -> bool:
        """Have a thread of its own go on, with a message that has been received already, or with the next one."""
        link = self.link
        assert link is not None
        with self._changing:
            _GATHERER.remove(self._stream.socket)
            self._gathered = False
            self._thread = self._new_thread(lambda: self._receive_all(link, message or link.receive()))
            self._thread.start()
        return True


_UNKNOWN = (
    b"* Error. This is a port of a robot's network, and what you sent begins no carrier it knows.\r\n"
    b"* With telnet, type CONNECT and a name first, then d and a line of data, or ? for help.\r\n"
    b"* Goodbye.\r\n"
)
