"""The multicast groups of a port: one for each interface that it sends on."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from rtf.middleware.carriers.base import Group
from rtf.middleware.errors import PortClosedError

if TYPE_CHECKING:
    from rtf.middleware.ports.names import Names
    from rtf.middleware.wire.contact import Contact

#: The port number of groups where the name server assigns none.
_PORT = 10_001


class MulticastGroups:
    """Registers the groups of a port. Any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._groups: dict[str, Group] = {}
        self._closed = False

    def on(self, interface: str, port: str, names: Names) -> Group:
        """Return the group on an interface. The first call registers it. Raises MiddlewareError."""
        with self._lock:
            if self._closed:
                raise PortClosedError(f"{port} is closed")
            group = self._groups.get(interface)
            if group is None:
                group = self._groups[interface] = Group(_register(f"{port}/net={interface}", port, names))
            return group

    def close(self) -> list[str]:
        """Register no more groups. Return the names of those that are registered."""
        with self._lock:
            self._closed = True
            return [group.contact.name for group in self._groups.values()]


def _register(name: str, port: str, names: Names) -> Contact:
    contact = names.register(name, carrier="mcast")
    if not contact.port:  # the name server has no pool of port numbers
        contact = names.register(name, carrier="mcast", host=contact.host, port=_PORT)
    names.set_property(port, "owns", [contact.name])
    return contact
