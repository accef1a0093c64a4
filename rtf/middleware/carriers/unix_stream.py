"""``unix_stream``: a Unix socket between two programs of one machine, the fastest carrier for images.

Messages have no index: a port command is followed by the data, which are a bottle byte for byte and so self-delimiting.
The receiver creates the socket in the user's runtime folder, and the sender connects to it.
"""

from __future__ import annotations

import os
import socket
from pathlib import Path
from typing import TYPE_CHECKING

from rtf import clock
from rtf.bottle.binary import TruncatedBottleError
from rtf.bottle.errors import BottleSyntaxError
from rtf.bottle.extent import Scanner
from rtf.middleware.carriers.base import (
    Carrier,
    InputLink,
    Message,
    OutputLink,
    StreamInput,
    StreamOutput,
    introduction,
    read_sender,
)
from rtf.middleware.carriers.stream import CHUNK, Stream
from rtf.middleware.errors import ConnectError, ProtocolError
from rtf.middleware.types.codecs import other_dialect
from rtf.middleware.wire import framing

if TYPE_CHECKING:
    from rtf.bottle import Dialect
    from rtf.middleware.carriers.base import CarrierPort
    from rtf.middleware.wire.contact import Contact
    from rtf.middleware.wire.outgoing_message import OutgoingMessage

_ACK = b"ACK\0"
#: Seconds that both ends have for the handshake, and the interval between two attempts to connect.
_MEETING = 5.0
_LOOK_AGAIN = 0.001


class UnixInput(StreamInput):
    """The receiving end."""

    reuses = CHUNK
    acknowledgement = _ACK

    def __init__(self, carrier: Carrier, stream: Stream, sender: str, modifiers: str, dialect: Dialect) -> None:
        super().__init__(carrier, stream, sender, modifiers)
        self._dialect = dialect

    def receive(self) -> Message:
        stream = self._stream
        head = stream.peek(framing.COMMAND_SIZE)
        size = framing.COMMAND_SIZE + framing.command_text_size(head)
        command = framing.read_command(bytes(stream.peek(size)))
        if command.key not in ("d", "D", "a"):
            stream.skip(size)
            return command.key, command.text, b""
        return command.key, command.text, stream.take(self._whole_bottle(size))[size:]

    def _whole_bottle(self, start: int) -> int:
        """Wait until the bottle at ``start`` of the window is complete. Return its end offset."""
        scanner = Scanner(self._dialect, start)
        other: Dialect | None = other_dialect(self._dialect)
        while True:
            try:
                return scanner.end(self._stream.window())
            except TruncatedBottleError as error:
                self._stream.more_towards(error.needed)
            except BottleSyntaxError:
                if other is None:
                    raise
                # The bottle may be in the other dialect; then the sender speaks that one.
                scanner, self._dialect, other = Scanner(other, start), other, None


class UnixOutput(StreamOutput):
    """The sending end."""

    def __init__(self, carrier: Carrier, stream: Stream) -> None:
        super().__init__(carrier, stream, _ACK if carrier.acknowledged else b"")

    def send(self, message: OutgoingMessage) -> None:
        self._due = self._acknowledged
        self._stream.send(framing.command(message.key, message.envelope), *message.blocks)

    def finish(self) -> None:
        if self._due:
            if self._stream.take(len(_ACK)) != _ACK:
                raise ProtocolError("the peer did not send an acknowledgement")
            self._due = False

    def _send_quit(self) -> None:
        self._stream.send(framing.command_text("q"))


class UnixStream(Carrier):
    """Messages are not acknowledged; those of :class:`UnixStreamAck` are."""

    name = "unix_stream"
    header = b"UNIX_STR"

    def accept(self, stream: Stream, port: CarrierPort) -> InputLink:
        """Create the socket where the caller expects it, and wait for the caller."""
        sender, modifiers = read_sender(stream)
        path = _socket_path(port.contact.port, stream.socket.getpeername()[1])
        with socket.socket(socket.AF_UNIX) as listening:
            path.unlink(missing_ok=True)
            listening.bind(str(path))
            try:
                listening.listen(1)
                listening.settimeout(_MEETING)
                connection, _ = listening.accept()
            except OSError as error:
                raise ConnectError(f"{sender} did not connect to {path}: {error.strerror or error}") from None
            finally:
                path.unlink(missing_ok=True)
        connection.settimeout(None)
        return UnixInput(self, Stream(connection), sender, modifiers, port.network.dialect)

    def connect(self, stream: Stream, port: CarrierPort, target: Contact) -> OutputLink:
        """Send the caller's name, and connect to the socket that the other end creates."""
        stream.send(self.header + framing.sender(introduction(port, target)))
        path = _socket_path(target.port, stream.socket.getsockname()[1])
        deadline = clock.Deadline.after(_MEETING)
        connection = socket.socket(socket.AF_UNIX)
        while True:
            try:
                connection.connect(str(path))
                break
            except (FileNotFoundError, ConnectionRefusedError):
                if deadline.expired:
                    connection.close()
                    raise ConnectError(f"{target.name} did not open {path}: is it on this machine?") from None
                clock.sleep(_LOOK_AGAIN)  # there is no notification for a new socket
        stream.close()
        return UnixOutput(self, Stream(connection))


class UnixStreamAck(UnixStream):
    """Messages are acknowledged. The carrier name is ``unix_stream+ack``."""

    name = "unix_stream+ack"
    header = b"UNIX_ACK"
    acknowledged = True


def _socket_path(acceptor: int, initiator: int) -> Path:
    """Return the path of the socket for a connection, in a folder that only this user can access."""
    runtime = os.environ.get("YARP_RUNTIME_DIR")
    if runtime is None:
        base = os.environ.get("XDG_RUNTIME_DIR") or f"/tmp/runtime-{os.environ.get('USER', os.getuid())}"  # noqa: S108
        runtime = f"{base}/yarp"
    folder = Path(runtime)
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if folder.stat().st_uid != os.getuid():
            raise ConnectError(f"{folder} belongs to another user; set YARP_RUNTIME_DIR to a folder of your own")
    except OSError as error:
        raise ConnectError(f"cannot use {folder}: {error.strerror}; set YARP_RUNTIME_DIR") from None
    return folder / f"{acceptor}_{initiator}.sock"
