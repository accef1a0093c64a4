"""Names of ports as written in requests to the name server: with a carrier, or with a network prefix."""

from __future__ import annotations

from typing import NamedTuple

_CHOICES = ("/net=", "/NET=")


class PortQuery(NamedTuple):
    """The parts of a written name: ``fast_tcp://net=192.168/name`` is ``/name``, in that network, by that carrier."""

    name: str
    carrier: str = ""
    #: The beginning of the requested address, if the port has several.
    network: str = ""

    @classmethod
    def parse(cls, text: str) -> PortQuery:
        """Split a written name into its parts. Every text is accepted as some name."""
        carrier, separator, rest = text.partition(":/")
        if not separator or not carrier or "/" in carrier:
            carrier, rest = "", text
        elif not rest.startswith("/"):
            rest = f"/{rest}"
        network = ""
        if rest.startswith(_CHOICES):
            network, slash, name = rest[len(_CHOICES[0]) :].partition("/")
            rest = slash + name
        return cls(rest, carrier, network)
