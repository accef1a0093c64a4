"""``text`` and ``text_ack``: commands and data as lines, typed by people or sent by tools for administration."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from rtf.bottle import Balance, Bottle
from rtf.bottle.binary import encode
from rtf.middleware.errors import ProtocolError
from rtf.middleware.wire import framing
from rtf.middleware.wire.inbox import MAX_LINE
from rtf.middleware.wire.protocol import Caller, Receiver, Sender, StreamProtocol

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.bottle import Dialect
    from rtf.middleware.types.codecs import Buffer, Codec
    from rtf.middleware.wire.inbox import Reading, Steps
    from rtf.middleware.wire.outgoing_message import OutgoingMessage
    from rtf.middleware.wire.protocol import Messages

_ACK = b"<ACK>\r\n"
_WITH_DATA = ("d", "D", "a")


class LineReceiver(Receiver):
    """The receiving end: a line with the command, and for some commands a line with data."""

    acknowledgement = _ACK

    def greeting(self) -> Reading[Caller]:
        """Read the caller's name from the rest of the line."""
        line = as_text((yield from self.inbox.line()))
        name, _, modifiers = line[: framing.MAX_NAME].strip().partition(" ")
        return Caller(name, modifiers)

    def welcome(self, caller: Caller, number: int) -> bytes:  # noqa: ARG002 - it has the name of the caller
        return as_lines(f"Welcome {caller.name}")

    def messages(self) -> Messages:
        while True:
            key, text, _ = framing.text_command((yield from self._command()))
            if key in _WITH_DATA:
                yield key, text if key != "a" else "", (yield from self._data())
            else:
                yield key, text, b""

    def _command(self) -> Reading[str]:
        """Read the line of a command."""
        return as_text((yield from self.inbox.line()))

    def _data(self) -> Reading[bytes]:
        """Read the data of a message. Lines are joined while a parenthesis or quote is open."""
        balance = Balance()
        lines = [(yield from self.inbox.line())]
        size = len(lines[0])
        # A backslash at the end joins lines, too: it escapes the end of the line.
        while not balance.feed(as_text(lines[-1]) + "\n") or lines[-1].endswith(b"\\"):
            lines.append((yield from self.inbox.line()))
            size += len(lines[-1])
            if size > MAX_LINE:
                raise ProtocolError(f"data of more than {MAX_LINE} bytes in text")
        return b"\n".join(lines)


class LineSender(Sender):
    """The sending end. ``acknowledgement`` is the line by which a peer acknowledges."""

    acknowledgement: ClassVar[bytes] = _ACK
    #: The prefix of each command.
    prefix: ClassVar[str] = ""
    _reading: Reading[None] | None = None  # a reply of which a part has arrived
    _lines: list[str]

    def greet(self, header: bytes, name: str) -> Steps[None]:
        """Send the name of the caller, a port or a label, and read the greeting."""
        yield header + as_lines(name)
        yield from self.inbox.line()

    def message(self, message: OutgoingMessage) -> Sequence[Buffer]:
        command = f"{message.key} {message.envelope}" if message.envelope else message.key
        return (self.command(command, message.text),)

    def command(self, *lines: str) -> bytes:
        """Return the bytes of a command line, and of a data line if there is one."""
        self.due += self.acknowledged
        return as_lines(self.prefix + lines[0], *lines[1:])

    def ask(self, *lines: str) -> Steps[list[str]]:
        """Send a command line, and a data line if there is one. Return the lines of the reply."""
        yield self.command(*lines)
        yield from self._read_reply()
        return self._lines

    def reply(self, codec: Codec[object], dialect: Dialect) -> int:
        """Read the reply. Without acknowledgements its end is unknown, so it is not awaited."""
        size = self.acknowledgements()
        if not size:
            text = " ".join(self._lines)
            self.answer = codec.decode(encode(Bottle.parse(text), dialect), dialect) if self._lines else None
        return size

    def acknowledgements(self) -> int:
        if self._reading is None:
            self._reading = self._read_reply()
        size = next(self._reading, 0)
        if not size:
            self._reading = None
        return size

    def _read_reply(self) -> Reading[None]:
        """Read the lines of a reply, up to the acknowledgement."""
        self._lines = []
        size = 0
        while self.due:
            line = yield from self.inbox.line()
            size += len(line)
            if line + b"\r\n" == self.acknowledgement:
                self.due -= 1
            elif size > MAX_LINE:
                raise ProtocolError(f"a reply of more than {MAX_LINE} bytes in text")
            else:
                self._lines.append(as_text(line))

    def end(self) -> bytes:
        return self.command("q")


def as_text(line: bytes) -> str:
    """Return a line as text; bytes that are no text are kept."""
    return line.decode("utf-8", "surrogateescape")


def as_lines(*lines: str) -> bytes:
    """Return the bytes of lines, each with its end."""
    return "".join(f"{line}\r\n" for line in lines).encode("utf-8", "surrogateescape")


#: Messages are not acknowledged. Replies are sent, but a sender does not wait for them.
TEXT = StreamProtocol("text", b"CONNECT ", LineReceiver, LineSender, text=True)
#: Every command is acknowledged.
TEXT_ACK = StreamProtocol("text_ack", b"CONNACK ", LineReceiver, LineSender, acknowledged=True, text=True)
