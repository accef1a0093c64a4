"""How a port may be named in a question to the name server: with a carrier, with the network to reach it by."""

from __future__ import annotations

from typing import NamedTuple

_CHOICES = ("/net=", "/NET=")


class Asked(NamedTuple):
    """A name taken apart: ``fast_tcp://net=192.168/name`` asks for ``/name``, there, by that carrier."""

    name: str
    carrier: str = ""
    #: The beginning of the address that is wanted, when the port has several.
    network: str = ""

    @classmethod
    def parse(cls, text: str) -> Asked:
        """Take a name apart. Whatever it is, it is some name."""
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
