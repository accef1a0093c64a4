"""An incoming connection of a port, from the first byte of the handshake to the end.

Each connection starts with a thread of its own, which waits for messages, passes them to the port and replies. If the
port's callback never blocks (``nonblocking``, see :class:`~rtf.middleware.ports.port.Port`), that thread ends after the
first message and one *shared reader* thread serves the connection: a dozen streams would otherwise be a dozen threads
that compete for the interpreter. A connection returns to a thread of its own as soon as it carries anything but small
messages of data.
"""

from __future__ import annotations

import contextlib
import select
import threading
from functools import partial
from typing import TYPE_CHECKING, Protocol

from rtf.errors import RtfError
from rtf.middleware.carriers import registry
from rtf.middleware.carriers.base import CarrierPort
from rtf.middleware.carriers.socket_watcher import SocketWatcher
from rtf.middleware.carriers.stream import Stream, StreamClosedError
from rtf.middleware.carriers.stream_carrier import StreamInput
from rtf.middleware.errors import ConnectError, ProtocolError
from rtf.middleware.ports.dialect_probe import dialect_of_reader
from rtf.middleware.ports.outputs import Output
from rtf.middleware.ports.qos import Connection
from rtf.middleware.wire import authentication, modifiers
from rtf.middleware.wire.contact import Contact
from rtf.middleware.wire.inbox import CHUNK
from rtf.middleware.wire.protocol import read_header

if TYPE_CHECKING:
    import socket as sockets
    from collections.abc import Callable, Sequence

    from rtf.middleware.carriers.base import InputLink
    from rtf.middleware.ports.network import Network
    from rtf.middleware.types.codecs import Buffer
    from rtf.middleware.wire.protocol import Message

#: Seconds that a caller may take for the handshake. People type handshakes by hand, so it is long.
_PATIENCE = 60.0
#: Commands after which no further message is received.
_LAST = frozenset("qr")
#: The shared reader: reads all connections of non-blocking ports.
_SHARED_READER = SocketWatcher("rtf-shared-reader")


class InputOwner(CarrierPort, Protocol):
    """What an input uses of its port."""

    @property
    def network(self) -> Network: ...
    @property
    def nonblocking(self) -> bool: ...

    def input_opened(self, caller: Input) -> None:
        """Add an input whose handshake is done and end an older one from the same port.

        Raises ProtocolError for modifiers that are not known.
        """

    def input_closed(self, caller: Input) -> None:
        """Remove an input that has ended."""

    def report_broken_input(self, caller: Input, error: RtfError) -> None:
        """Report a protocol error of a caller."""

    def dispatch(self, caller: Input, key: str, text: str, data: Buffer) -> Sequence[Buffer]:
        """Execute a message. Return the bytes of the reply."""

    def adopt(self, output: Output) -> None:
        """Use a connection that the peer has opened as an output."""

    def end_output(self, output: Output) -> None:
        """Remove an output whose reader is gone."""


class Input(Connection):
    """One incoming connection of a port. ``link`` is None until the handshake is done.

    A connection that this side has opened, to a port that sends to it then, is given with its ``link``.
    """

    instead = "one thread reads all streams of non-blocking ports"

    def __init__(self, port: InputOwner, stream: Stream, link: InputLink | None = None) -> None:
        self.port = port
        self.link = link
        self.announced = False  # the port has reported it as an input
        self._closing = False
        self._answering = False  # its own thread handles a message, or sends the reply
        #: The dialect that the caller is assumed to speak; corrected when it sends something that only the other one
        #: allows.
        self.dialect = port.network.dialect
        self._carrier = ""  # with modifiers, when they have been read
        self.turned = False  # the stream belongs to an output now
        self._shared = False
        self._changing = threading.Lock()  # guards the change between own thread and shared reader
        self._ended = threading.Event()
        self._stream = stream
        self._thread = self._new_thread(self._serve)

    @property
    def sender(self) -> str:
        """The name of the caller; empty before the handshake is done."""
        return "" if self.link is None else self.link.sender

    @property
    def peer(self) -> str:
        return self.sender

    @property
    def carrier(self) -> str:
        return self._carrier or ("" if self.link is None else self.link.carrier.name)

    @property
    def connectionless(self) -> bool:
        return self.link is not None and self.link.carrier.connectionless

    @property
    def socket(self) -> sockets.socket | None:
        return self._stream.socket if self.link is None else self.link.endpoint

    @property
    def is_here(self) -> bool:
        """Whether the current thread is the one that serves this connection."""
        return _SHARED_READER.is_here if self._shared else self._thread is threading.current_thread()

    @property
    def answering(self) -> bool:
        """Whether its thread handles a message, or sends the reply; the caller may wait for that."""
        return self._answering

    @property
    def idle(self) -> bool:
        """Whether all that has arrived, the end of the connection included, is being handled or has been."""
        arriving = select.poll()
        try:
            arriving.register(self._stream.socket, select.POLLIN)
            return not self._stream.unread and not arriving.poll(0)
        except (OSError, ValueError):  # it has ended
            return True

    def start(self) -> None:
        """Start the thread that serves the connection."""
        self._thread.start()

    def close(self) -> None:
        """Close the connection. Its thread ends at once; one that handles a message answers it before.

        Called in that thread, by the callback, it is at once, too.
        """
        self._closing = True
        if not self._answering or self.is_here:  # read after the line above, as its thread does the reverse
            self._break_off()

    def _closed(self) -> bool:
        """Whether ``close`` was called."""
        return self._closing

    def _break_off(self) -> None:
        with self._changing:
            if not self._shared and self.link is not None:
                self.link.close()
        self._stream.wake()

    def join(self, timeout: float) -> None:
        """Wait until the connection has ended; break it off then. Returns at once in the thread that serves it."""
        if self.is_here:
            return
        if not self._ended.wait(timeout):
            self._break_off()
        elif self._thread is not threading.current_thread():
            self._thread.join(timeout)

    # In a thread of its own ------------------------------------------------------------------------------------------

    def _new_thread(self, work: Callable[[], bool]) -> threading.Thread:
        def run() -> None:
            self.thread = threading.get_native_id()
            self._do(work)

        return threading.Thread(target=run, name=f"rtf-input {self.port.name}", daemon=True)

    def _do(self, work: Callable[[], bool]) -> None:
        """Run ``work`` and report its errors. End the connection unless ``work`` returns True."""
        goes_on = False
        try:
            with contextlib.suppress(StreamClosedError):
                goes_on = work()
        except RtfError as error:
            self.port.report_broken_input(self, error)
        finally:
            if not goes_on:
                self._end()

    def _end(self) -> None:
        if self._shared:
            _SHARED_READER.remove(self._stream.socket)
        if not self.turned:
            if self.link is not None:
                self.link.close()
                self.link.release()
            self._stream.close()
        self.port.input_closed(self)
        self._ended.set()

    def _serve(self) -> bool:
        stream = self._stream
        stream.limit_waiting(_PATIENCE)
        link = self.link or self._accept()
        self.link = link
        if self._closing:  # ``close`` was called before there was a link to close
            return False
        self._carrier = modifiers.join(link.carrier.name, modifiers.read(link.modifiers))
        self.port.input_opened(self)
        link.welcome(stream, self.port)
        stream.limit_waiting(None)
        return self._receive_all(link, link.receive())

    def _accept(self) -> InputLink:
        stream = self._stream
        if self.port.network.key:
            stream.run(authentication.accept(stream, self.port.network.key))
        header = stream.run(read_header(stream))
        carrier = registry.for_header(header)
        if carrier is None:
            stream.send(_UNKNOWN)
            raise ProtocolError(f"{header!r} is not the header of a known carrier")
        if not carrier.keeps_header:
            stream.pop(len(header))
        try:
            return carrier.accept(stream, self.port)
        except OSError as error:  # such as a caller that is gone
            raise ConnectError(f"the handshake by {carrier.name} failed: {error.strerror or error}") from None

    def _receive_all(self, link: InputLink, message: Message) -> bool:
        """Handle messages, starting with this one. Return whether the connection continues in another thread."""
        receive, answer, dispatch = link.receive, link.answer, self.port.dispatch
        pollable = link if self.port.nonblocking and isinstance(link, StreamInput) and link.pollable else None
        # A closed connection stops here: its unread messages are older than those of the one that replaced it.
        while not self._closed():
            key, text, data = message
            if key in _LAST and (key == "q" or text in ("", "r")):  # not a longer word with the same first letter
                answer()
                if key == "r":
                    self._turn_round(link)
                return False
            self._answering = True
            answer(*dispatch(self, key, text, data))
            self._answering = False
            if self._closed():
                return False
            del message, data  # a callback that stored the data now owns them
            if pollable is None or key != "D":
                message = receive()
            elif not isinstance(found := pollable.poll(), int):
                message = found
                del found  # as above
            elif found <= CHUNK:
                return self._move_to_shared_thread()
            else:
                message = receive()
        return False

    def _turn_round(self, link: InputLink) -> None:
        target = Contact(link.sender, carrier=link.carrier.name)
        ask = partial(dialect_of_reader, self.port.network, link.carrier, target)
        output = Output(link.reversed(self._stream), target, ask)
        self.turned = True  # first, so that the connection is never listed in both directions
        try:
            self.port.adopt(output)
        except BaseException:
            self.turned = False
            raise
        if link.carrier.pull:  # the reader says nothing more: all that can be read is its end
            with contextlib.suppress(StreamClosedError):
                self._stream.discard()
            self.port.end_output(output)

    def _move_to_shared_thread(self) -> bool:
        """Hand the connection over to the shared reader. Return False if it has been closed."""
        with self._changing:
            if self._closing:
                return False
            self._shared = True
            self.thread = 0
            _SHARED_READER.add(self._stream.socket, self._ready)
            return True

    # In the shared reader thread ------------------------------------------------------------------------------------

    def _ready(self) -> None:
        """Handle what has arrived, which may be the end of the connection."""
        if self._shared and not self._ended.is_set():
            self._do(self._receive_available)

    def _receive_available(self) -> bool:
        """Handle all messages that have arrived completely."""
        link, dispatch = self.link, self.port.dispatch
        assert isinstance(link, StreamInput)
        link.fill()
        dealt = 0
        while not isinstance(found := link.poll(), int):
            if self._closing:  # see _receive_all
                return False
            key, text, data = found
            if key != "D":
                link.acknowledge(dealt)
                return self._move_to_own_thread(found)
            dispatch(self, key, text, data)
            dealt += 1
        link.acknowledge(dealt)
        return found <= CHUNK or self._move_to_own_thread(None)

    def _move_to_own_thread(self, message: Message | None) -> bool:
        """Continue in a thread of its own, with a message that was already received, or with the next one."""
        link = self.link
        assert link is not None
        with self._changing:
            _SHARED_READER.remove(self._stream.socket)
            self._shared = False
            self._thread = self._new_thread(lambda: self._receive_all(link, message or link.receive()))
            self._thread.start()
        return True


_UNKNOWN = (
    b"* Error. This is a port of a robot's network; it knows no carrier with this header.\r\n"
    b"* With telnet, type CONNECT and a name first, then d and a line of data, or ? for help.\r\n"
    b"* Goodbye.\r\n"
)
