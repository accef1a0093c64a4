"""Ports that speak YARP's wire protocol, the registration of their names, and the types of their messages.

The floors, each of which imports only from those before it (``tests/middleware/test_floors.py`` checks it):

- ``errors``; ``types``: objects and their bytes;
- ``wire``: the protocol, on bytes; ``carriers``: the protocol, on sockets;
- ``ports``; ``naming``; ``clocks`` and ``tools``.

This module joins them where a lower floor needs a higher one: a port that is given no network finds the one of the
user's configuration, which ``naming`` reads.
"""

from rtf.middleware.ports import network as _network


def _find_network() -> _network.Network:
    from rtf.middleware.naming.configuration import find_network

    return find_network()


_network.find_default_by(_find_network)
