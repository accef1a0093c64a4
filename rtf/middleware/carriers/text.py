"""``text`` and ``text_ack``: commands and data as lines, typed by people or sent by tools for administration."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING, ClassVar

from rtf.bottle import Balance, Bottle
from rtf.bottle.binary import encode
from rtf.middleware.carriers.base import (
    Carrier,
    InputLink,
    Message,
    OutputLink,
    StreamInput,
    StreamOutput,
    introduction,
)
from rtf.middleware.carriers.stream import MAX_LINE
from rtf.middleware.errors import ProtocolError
from rtf.middleware.wire import framing

if TYPE_CHECKING:
    from rtf.bottle import Dialect
    from rtf.middleware.carriers.base import CarrierNetwork, CarrierPort
    from rtf.middleware.carriers.stream import Stream
    from rtf.middleware.types.codecs import Codec
    from rtf.middleware.wire.contact import Contact
    from rtf.middleware.wire.outgoing_message import OutgoingMessage

_ACK = b"<ACK>\r\n"
_WITH_DATA = ("d", "D", "a")


class TextInput(StreamInput):
    """The receiving end: a line with the command, and for some commands a line with data."""

    acknowledgement = _ACK

    def welcome(self, stream: Stream, port: CarrierPort) -> None:  # noqa: ARG002 - the reply has the name of the caller
        stream.send(f"Welcome {self.sender}\r\n".encode("utf-8", "surrogateescape"))

    def reversed(self, stream: Stream) -> OutputLink:
        return TextOutput(self.carrier, stream)

    def receive(self) -> Message:
        """Wait for the next command. Data lines are joined while a parenthesis or quote is open."""
        command = framing.text_command(self._command_line())
        if command.key not in _WITH_DATA:
            return command.key, command.text, b""
        return command.key, command.text if command.key != "a" else "", self._data()

    def _command_line(self) -> str:
        return _text(self._stream.take_line())

    def _data(self) -> bytes:
        balance = Balance()
        lines = [self._stream.take_line()]
        size = len(lines[0])
        # A backslash at the end joins lines, too: it escapes the end of the line.
        while not balance.feed(_text(lines[-1]) + "\n") or lines[-1].endswith(b"\\"):
            lines.append(self._stream.take_line())
            size += len(lines[-1])
            if size > MAX_LINE:
                raise ProtocolError(f"data of more than {MAX_LINE} bytes in text")
        return b"\n".join(lines)


class TextOutput(StreamOutput):
    """The sending end."""

    acknowledgement: ClassVar[bytes] = _ACK

    def send(self, message: OutgoingMessage) -> None:
        command = f"{message.key} {message.envelope}" if message.envelope else message.key
        self.send_lines(command, message.text)

    def send_lines(self, *lines: str) -> None:
        """Send a command line, and a data line if there is one, unchanged."""
        self._due = self._acknowledged
        self._stream.send("".join(f"{line}\r\n" for line in lines).encode("utf-8", "surrogateescape"))

    def receive_reply(self, codec: Codec[object], dialect: Dialect) -> object | None:
        """Return the reply. Without acknowledgements its end is unknown, so it is not awaited."""
        lines = self.receive_lines()
        return codec.decode(encode(Bottle.parse(" ".join(lines)), dialect), dialect) if lines else None

    def receive_lines(self) -> list[str]:
        """Return the lines of the reply, up to the acknowledgement."""
        lines: list[str] = []
        size = 0
        while self._due:
            line = self._stream.take_line()
            size += len(line)
            if line + b"\r\n" == self.acknowledgement:
                self._due = False
            elif size > MAX_LINE:
                raise ProtocolError(f"a reply of more than {MAX_LINE} bytes in text")
            else:
                lines.append(_text(line))
        return lines

    def finish(self) -> None:
        self.receive_lines()

    def _send_quit(self) -> None:
        self.send_lines("q")
        self.finish()


class Text(Carrier):
    """Messages are not acknowledged. Replies are sent, but a sender does not wait for them."""

    name = "text"
    header = b"CONNECT "
    text = True
    has_dialects = False

    def accept(self, stream: Stream, port: CarrierPort) -> InputLink:  # noqa: ARG002 - it answers with the caller's name
        """Read the caller's name from the rest of the line, and send the greeting."""
        name, _, modified = _text(stream.take_line())[: framing.MAX_NAME].strip().partition(" ")
        return TextInput(self, stream, name, modified)

    def connect(self, stream: Stream, port: CarrierPort, target: Contact) -> OutputLink:
        return self.call(stream, introduction(port, target))

    def call(self, stream: Stream, name: str) -> TextOutput:
        """Send the name of the caller, a port or a label, and read the greeting."""
        stream.send(self.header + f"{name}\r\n".encode("utf-8", "surrogateescape"))
        stream.take_line()
        return TextOutput(self, stream)


class TextAck(Text):
    """Every command is acknowledged."""

    name = "text_ack"
    header = b"CONNACK "
    acknowledged = True


def tell_end(network: CarrierNetwork, target: Contact, sender: str) -> None:
    """Tell a port, over a separate connection, that it receives nothing more from ``sender``. Raises ConnectError.

    For carriers whose receivers cannot notice the end.
    """
    with contextlib.closing(network.reach(target)) as stream:
        stream.send(f"CONNECT admin\r\n~{sender}\r\nq\r\n".encode("utf-8", "surrogateescape"))
        while True:  # until it closes: a later connection must not be affected by this command
            stream.take_line()


def _text(line: bytes) -> str:
    return line.decode("utf-8", "surrogateescape")
