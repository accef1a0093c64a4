"""Turning a connection round: who called in order to send asks, by the command ``r``, to be sent to instead."""

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


def turned_round(link: InputLink, stream: Stream) -> Output:
    """The connection as an output. Raises ProtocolError where its carrier goes one way only."""
    made: OutputLink
    if isinstance(link, TcpInput):
        made = TcpOutput(link.carrier, stream)
    elif isinstance(link, TextInput):
        made = TextOutput(link.carrier, stream)
    else:
        raise ProtocolError(f"a connection by {link.carrier.name} cannot be turned round; tcp and text can")
    return Output(made, Contact(link.sender, carrier=link.carrier.name))
