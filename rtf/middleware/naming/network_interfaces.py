"""The addresses of this machine, and the choice of the one that other machines shall use."""

from __future__ import annotations

import socket
from typing import TYPE_CHECKING

from rtf.middleware.errors import AddressError

if TYPE_CHECKING:
    from collections.abc import Mapping


def own_addresses(*, inet6: bool = True) -> list[str]:
    """Return the addresses of all interfaces: IPv4 before IPv6, loopback first."""
    import psutil  # imported here: it takes as long as all the rest of a small tool

    families = (socket.AF_INET, socket.AF_INET6) if inet6 else (socket.AF_INET,)
    found = psutil.net_if_addrs().values()
    addresses = [
        address.address.partition("%")[0]
        for family in families
        for one in found
        for address in one
        if address.family == family
    ]
    return sorted(dict.fromkeys(addresses), key=lambda address: (":" in address, not address.startswith("127.")))


def chosen_address(environment: Mapping[str, str]) -> str:
    """Return the address that begins with ``YARP_IP``; empty if that is not set. Raises AddressError if none does."""
    wanted = environment.get("YARP_IP", "")
    if not wanted:
        return ""
    own = own_addresses()
    found = next((address for address in own if address.startswith(wanted)), "")
    if not found:
        raise AddressError(f"YARP_IP is {wanted}, but the addresses of this machine are {', '.join(own)}")
    return found
