"""``unix_stream``: a Unix socket between two programs of one machine, the fastest carrier for images.

The receiver creates the socket in the user's runtime folder, and the sender connects to it. Messages have no index, see
:mod:`rtf.middleware.wire.unframed`.
"""

from __future__ import annotations

import os
import socket
from pathlib import Path
from typing import TYPE_CHECKING

from rtf import clock
from rtf.middleware.carriers.base import Carrier, InputLink, OutputLink
from rtf.middleware.carriers.stream import Stream
from rtf.middleware.carriers.stream_carrier import StreamInput, StreamOutput, introduction
from rtf.middleware.errors import ConnectError
from rtf.middleware.wire import framing
from rtf.middleware.wire.protocol import read_caller
from rtf.middleware.wire.unframed import UnframedReceiver, UnframedSender

if TYPE_CHECKING:
    from rtf.middleware.carriers.base import CarrierPort
    from rtf.middleware.wire.contact import Contact

#: Seconds that both ends have for the handshake, and the interval between two attempts to connect.
_MEETING = 5.0
_LOOK_AGAIN = 0.001


class UnixStream(Carrier):
    """Messages are not acknowledged; those of :class:`UnixStreamAck` are."""

    name = "unix_stream"
    header = b"UNIX_STR"

    def accept(self, stream: Stream, port: CarrierPort) -> InputLink:
        """Create the socket where the caller expects it, and wait for the caller."""
        caller = stream.run(read_caller(stream))
        path = _socket_path(port.contact.port, stream.socket.getpeername()[1])
        with socket.socket(socket.AF_UNIX) as listening:
            path.unlink(missing_ok=True)
            listening.bind(str(path))
            try:
                listening.listen(1)
                listening.settimeout(_MEETING)
                connection, _ = listening.accept()
            except OSError as error:
                raise ConnectError(f"{caller.name} did not connect to {path}: {error.strerror or error}") from None
            finally:
                path.unlink(missing_ok=True)
        connection.settimeout(None)
        own = Stream(connection)
        receiver = UnframedReceiver(own, acknowledged=self.acknowledged)
        receiver.dialect = port.network.dialect
        return StreamInput(self, own, receiver, caller)

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
        own = Stream(connection)
        return StreamOutput(self, own, UnframedSender(own, acknowledged=self.acknowledged))


class UnixStreamAck(UnixStream):
    """Messages are acknowledged. The carrier name is ``unix_stream+ack``."""

    name = "unix_stream+ack"
    header = b"UNIX_ACK"
    acknowledged = True


UNIX_STREAM = UnixStream()
UNIX_STREAM_ACK = UnixStreamAck()


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
