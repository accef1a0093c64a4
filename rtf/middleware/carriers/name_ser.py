"""``name_ser``: commands to a name server, one per line, each with the prefix ``NAME_SERVER``.

All clients of a name server use it. The client side is in :mod:`rtf.middleware.naming.client`: no port sends through
this carrier.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.middleware.carriers.base import Carrier, InputLink
from rtf.middleware.carriers.stream_carrier import StreamInput
from rtf.middleware.wire.name_server_lines import CommandReceiver
from rtf.middleware.wire.protocol import Caller

if TYPE_CHECKING:
    from rtf.middleware.carriers.base import CarrierPort
    from rtf.middleware.carriers.stream import Stream
    from rtf.middleware.wire.protocol import Message

#: Seconds that a caller may keep a connection open without a command.
_PATIENCE = 30.0


class NameSerInput(StreamInput):
    """The receiving end."""

    def receive(self) -> Message:
        """Wait for the next command."""
        self._stream.limit_waiting(_PATIENCE)
        return super().receive()


class NameSer(Carrier):
    """Text without acknowledgements; every line gets a reply."""

    name = "name_ser"
    header = b"NAME_SER"
    text = True
    keeps_header = True

    def accept(self, stream: Stream, port: CarrierPort) -> InputLink:  # noqa: ARG002 - there is no greeting
        """Return the link: there is no handshake before the first command."""
        return NameSerInput(self, stream, CommandReceiver(stream, acknowledged=False), Caller("anon"))


NAME_SER = NameSer()
