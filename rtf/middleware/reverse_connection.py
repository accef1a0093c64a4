"""Reversal of a connection: a caller sends the command ``r`` so that the port sends to it instead."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.middleware.carriers.tcp import TcpInput, TcpOutput
from rtf.middleware.carriers.text import TextInput, TextOutput
from rtf.middleware.errors import ProtocolError
from rtf.middleware.names import Contact
from rtf.middleware.outputs import Output

if TYPE_CHECKING:
    from rtf.middleware.carriers.base import InputLink, OutputLink
    from rtf.middleware.stream import Stream


def output_from_input(link: InputLink, stream: Stream) -> Output:
    """Return an output that uses the connection of an input. Raises ProtocolError if its carrier is one-way."""
    made: OutputLink
    if isinstance(link, TcpInput):
        made = TcpOutput(link.carrier, stream)
    elif isinstance(link, TextInput):
        made = TextOutput(link.carrier, stream)
    else:
        raise ProtocolError(f"a connection by {link.carrier.name} cannot be reversed; tcp and text can")
    return Output(made, Contact(link.sender, carrier=link.carrier.name))
