"""Who may write to a port, and who may change its connections.

YARP lets every program that reaches a port do both. A robot on a shared network can name its writers instead: the names
of their ports and the addresses of their machines. A name is what the peer says of itself, so it guards against
mistakes; against malice use addresses, or the shared key of :mod:`rtf.middleware.wire.authentication`.
"""

from __future__ import annotations

import ipaddress
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, TypeAlias

from rtf.middleware.errors import AddressError

if TYPE_CHECKING:
    import socket as sockets
    from collections.abc import Iterable

_Network: TypeAlias = "ipaddress.IPv4Network | ipaddress.IPv6Network"


@dataclass(frozen=True, slots=True)
class Access:
    """A list of peers. ``names`` are patterns of port names, such as ``/tester/*``; empty lists: everyone."""

    names: tuple[str, ...] = ()
    networks: tuple[_Network, ...] = ()

    @classmethod
    def parse(cls, words: Iterable[str]) -> Access:
        """Read names such as ``/tester/*``, and addresses such as ``10.0.0.7`` or ``10.0.0.0/24``.

        Raises AddressError for anything else.
        """
        names: list[str] = []
        networks: list[_Network] = []
        for word in words:
            if word.startswith("/"):
                names.append(word)
                continue
            try:
                networks.append(ipaddress.ip_network(word))
            except ValueError:
                raise AddressError(
                    f"{word!r} is no peer: write the name of a port, such as /tester/*, or an address, such as 10.0.0.7"
                    " or 10.0.0.0/24"
                ) from None
        return cls(tuple(names), tuple(networks))

    def allows(self, name: str, connection: sockets.socket | None) -> bool:
        """Return whether a peer is listed, by name or by the address of its connection."""
        if not self.names and not self.networks:
            return True
        if any(fnmatchcase(name, pattern) for pattern in self.names):
            return True
        address = address_of(connection)
        return address is not None and any(address in network for network in self.networks)


def address_of(connection: sockets.socket | None) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    """Return the address of a peer; None if it is gone, or the connection has no addresses."""
    try:
        peer = connection.getpeername() if connection is not None else ""
        return ipaddress.ip_address(peer[0]) if isinstance(peer, tuple) else None
    except (OSError, ValueError):
        return None
