"""The multicast groups of a port: one for each interface that it sends on."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.middleware.carriers.base import Group

if TYPE_CHECKING:
    from rtf.middleware.ports.names import Names
    from rtf.middleware.wire.contact import Contact

#: The port number of groups where the name server assigns none.
_PORT = 10_001


class MulticastGroups:
    """Registers the groups of a port. Calls are one after the other."""

    def __init__(self) -> None:
        self._groups: dict[str, Group] = {}

    def on(self, interface: str, port: str, names: Names) -> Group:
        """Return the group on an interface. The first call registers it. Raises MiddlewareError."""
        group = self._groups.get(interface)
        if group is None:
            group = self._groups[interface] = Group(_register(f"{port}/net={interface}", port, names))
        return group

    @property
    def names(self) -> list[str]:
        """Their registered names."""
        return [group.contact.name for group in self._groups.values()]


def _register(name: str, port: str, names: Names) -> Contact:
    contact = names.register(name, carrier="mcast")
    if not contact.port:  # the name server has no pool of port numbers
        contact = names.register(name, carrier="mcast", host=contact.host, port=_PORT)
    names.set_property(port, "owns", [contact.name])
    return contact
