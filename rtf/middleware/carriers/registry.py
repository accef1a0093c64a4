"""The carriers of this process, by name and by the header of a connection."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING

from rtf.middleware.errors import ConnectError
from rtf.middleware.wire import modifiers

if TYPE_CHECKING:
    from rtf.middleware.carriers.base import Carrier

#: The module and name of each carrier, imported on first use. The order is that in which headers are matched: what
#: programs use comes before what browsers use, whose modules take longest to import.
_HOMES = {
    "tcp": "stream_carrier:TCP",
    "fast_tcp": "stream_carrier:FAST_TCP",
    "text": "stream_carrier:TEXT",
    "text_ack": "stream_carrier:TEXT_ACK",
    "name_ser": "name_ser:NAME_SER",
    "udp": "datagram:UDP",
    "mcast": "datagram:MCAST",
    "local": "local:LOCAL",
    "human": "human:HUMAN",
    "unix_stream": "unix_stream:UNIX_STREAM",
    "unix_stream+ack": "unix_stream:UNIX_STREAM_ACK",
    "http": "http:HTTP",
    "mjpeg": "mjpeg:MJPEG",
}


@cache
def by_name(name: str) -> Carrier:
    """Return the carrier of this name, which may have modifiers. Raises ConnectError if there is none."""
    plain = modifiers.split(name)[0]
    if plain != name:
        return by_name(plain)
    home = _HOMES.get(name)
    if home is None:
        raise ConnectError(f"there is no carrier {name!r}; the carriers are {', '.join(_HOMES)}")
    module, _, carrier = home.partition(":")
    return getattr(import_module(f"rtf.middleware.carriers.{module}"), carrier)  # type: ignore[no-any-return]


def for_header(header: bytes) -> Carrier | None:
    """Return the carrier of a connection with this header, or None."""
    return next((carrier for carrier in map(by_name, _HOMES) if carrier.matches(header)), None)


def pulls(name: str) -> bool:
    """Return whether connections by this carrier are opened by the port that receives."""
    plain = modifiers.split(name)[0]
    return plain in _HOMES and by_name(plain).pull


def names() -> list[str]:
    """Return the names of all carriers."""
    return [*_HOMES]
