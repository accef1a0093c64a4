"""``human``: after the handshake two people carry each message from one terminal to the other.

Each end shows what is to be typed at the other one, and takes what is typed at its own: ``human says D``, a line of
data, and ``computers rule!`` as the acknowledgement. It is YARP's example of a carrier.
Only programs that have a person at their keyboard (``Network.keyboard``) take part: a peer must not be able to take the
keyboard of any other program.
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
import threading
from typing import TYPE_CHECKING

from rtf.middleware.carriers.base import Carrier, InputLink, OutputLink
from rtf.middleware.carriers.stream import Stream, StreamClosedError
from rtf.middleware.carriers.stream_carrier import StreamInput, StreamOutput, announce_end, introduction
from rtf.middleware.errors import ConnectError, MiddlewareError
from rtf.middleware.wire.lines import LineReceiver, LineSender, as_lines

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.carriers.base import CarrierNetwork, CarrierPort
    from rtf.middleware.types.codecs import Buffer
    from rtf.middleware.wire.contact import Contact
    from rtf.middleware.wire.inbox import Reading
    from rtf.middleware.wire.protocol import Caller

_PREFIX = "human says "
_ACK = b"computers rule!\r\n"
_TYPED = 4096
_CLOSED = "the connection was closed"


class _Terminal(Stream):
    """A stream whose bytes are shown to a person and typed by one. A socket pair of its own ends the wait for a key.

    A wait uses a duplicate of the socket: poll looks descriptors up again when it is woken, and by then the number of a
    closed one may be that of another connection.
    """

    def __init__(self, network: CarrierNetwork) -> None:
        if network.keyboard is None:
            raise ConnectError("nobody is at the keyboard of this program, as at that of rtf read and rtf write")
        own, self._other = socket.socketpair()
        super().__init__(own)
        self._closing = threading.Lock()  # so that no socket is duplicated while it is closed
        self._keyboard = network.keyboard
        self._show = network.report

    def more(self, size: int, flags: int = 0) -> None:  # noqa: ARG002 - lines are short, and always waited for
        """Wait for something to be typed."""
        try:
            with self._closing:
                own = self.socket.dup()
        except OSError:
            raise StreamClosedError(_CLOSED) from None
        with own:
            poll = select.poll()
            poll.register(own, select.POLLIN)
            poll.register(self._keyboard, select.POLLIN)
            ready = [descriptor for descriptor, _ in poll.poll()]
        if ready != [self._keyboard]:
            raise StreamClosedError(_CLOSED)
        if _in_background(self._keyboard):
            raise ConnectError("the program runs in the background: it may not read from the terminal; use fg")
        try:
            typed = os.read(self._keyboard, _TYPED)
        except OSError as error:
            raise StreamClosedError(f"cannot read what is typed: {error.strerror}") from None
        if not typed:
            raise StreamClosedError("the end of what is typed")
        self.feed(typed)

    def send(self, *blocks: Buffer) -> None:
        self.send_bytes(b"".join(blocks))

    def send_bytes(self, data: Buffer, flags: int = 0) -> None:  # noqa: ARG002 - a person is always waited for
        for line in bytes(data).decode("utf-8", "replace").splitlines():
            self._show(f"Type this at the other terminal: {line}")

    def close(self) -> None:
        with self._closing:
            super().close()
            self._other.close()


def _in_background(keyboard: int) -> bool:
    """Return whether the kernel would stop the process for reading from its terminal."""
    try:
        return os.isatty(keyboard) and os.tcgetpgrp(keyboard) != os.getpgrp()
    except OSError:  # not the terminal of this session, which the kernel does not guard
        return False


class HumanReceiver(LineReceiver):
    """The receiving end: lines that a person types. ``show`` is called with a hint for a line of another form."""

    acknowledgement = _ACK

    def __init__(self, terminal: _Terminal, show: Callable[[str], object]) -> None:
        super().__init__(terminal, acknowledged=True)
        self._show = show

    def _command(self) -> Reading[str]:
        while not (line := (yield from super()._command())).startswith(_PREFIX):
            self._show(f"Begin with {_PREFIX!r}")
        return line.removeprefix(_PREFIX)


class HumanSender(LineSender):
    """The sending end. It waits until the acknowledgement is typed."""

    acknowledgement = _ACK
    prefix = _PREFIX


class HumanInput(StreamInput):
    """The receiving end, with its terminal."""

    def __init__(self, carrier: Carrier, caller: Caller, network: CarrierNetwork) -> None:
        terminal = _Terminal(network)
        super().__init__(carrier, terminal, HumanReceiver(terminal, network.report), caller)
        self._show = network.report

    def welcome(self, stream: Stream, port: CarrierPort) -> None:  # noqa: ARG002 - a person is welcomed, not the peer
        self._show(f"{self.sender} sends to {port.name} by human: type here what its terminal shows")


class HumanOutput(StreamOutput):
    """The sending end, with its terminal."""

    def __init__(self, carrier: Carrier, port: CarrierPort, target: Contact) -> None:
        terminal = _Terminal(port.network)
        super().__init__(carrier, terminal, HumanSender(terminal, acknowledged=True))
        self._name, self._network, self._target = port.name, port.network, target

    def close(self, *, politely: bool = True) -> None:  # noqa: ARG002 - there is no other way in which the peer notices
        """End the connection and tell the other port over a separate connection."""
        self._stream.close()
        with contextlib.suppress(OSError, MiddlewareError):  # the other port is gone
            announce_end(self._network, self._target, self._name)


class Human(Carrier):
    """Only the name of the caller is sent; people do the rest, acknowledgements too."""

    name = "human"
    header = b"HUMANITY"
    acknowledged = True
    connectionless = True
    text = True
    has_dialects = False

    def accept(self, stream: Stream, port: CarrierPort) -> InputLink:
        """Read the caller's name from the rest of the line. There is no answer."""
        caller = stream.run(LineReceiver(stream, acknowledged=True).greeting())
        return HumanInput(self, caller, port.network)

    def connect(self, stream: Stream, port: CarrierPort, target: Contact) -> OutputLink:
        """Send the name of the caller. The connection over the network is needed no more."""
        output = HumanOutput(self, port, target)
        stream.send(self.header + as_lines(introduction(port, target)))
        stream.close()
        return output


HUMAN = Human()
