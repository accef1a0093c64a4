"""Names of ports, and contacts: the address of a port and the carrier to use."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Self

from rtf.middleware.errors import AddressError

#: A carrier may have modifiers, whose values may be anything: ``tcp+recv.priority+(ex (/a -5))``.
_CONTACT = re.compile(r"(?:(?P<carrier>[^:/+]+(?:\+.*?)?):)?(?P<rest>/.*)", re.DOTALL)
_NUMERIC = re.compile(r"/(?P<host>\[[0-9A-Fa-f:.]+\]|[^:/\[\]]+):(?P<port>[0-9]{1,5})(?P<name>/.*)?", re.DOTALL)
_MOST = 65535
#: An address or a host name. Other texts are refused here, because the resolver raises odd errors for some.
_INET6 = r"(?=.*:.*:)(?!\.)[0-9A-Fa-f:.]{2,45}"
_HOST = re.compile(_INET6 + r"|(?=.{1,253}\Z)[0-9A-Za-z_-]{1,63}(?:\.[0-9A-Za-z_-]{1,63})*\.?")


def is_host(text: str) -> bool:
    """Return whether a text can be the address or the name of a machine."""
    return _HOST.fullmatch(text) is not None and ".." not in text


@dataclass(frozen=True, slots=True)
class Contact:
    """The contact of a port: its name, host, port number and carrier. Unknown fields are empty."""

    name: str = ""
    host: str = ""
    port: int = 0
    carrier: str = ""

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read ``/name``, ``carrier:/name``, ``carrier://name``, ``/host:port`` or ``carrier://host:port/name``.

        Raises AddressError.
        """
        match = _CONTACT.fullmatch(text)
        if match is None:
            raise AddressError(f"{text!r} is not a port name: it begins with '/', such as /robot/head/state:o")
        carrier = match["carrier"] or ""
        rest = "/" + match["rest"].lstrip("/") if carrier else match["rest"]
        numeric = _NUMERIC.fullmatch(rest)
        host = "" if numeric is None else numeric["host"].strip("[]")
        # A name may look like an address: /cam:100000 is a valid port name.
        if numeric is None or int(numeric["port"]) > _MOST or not is_host(host):
            return cls(name=rest, carrier=carrier)
        name = numeric["name"] or ""
        return cls("" if name == "/" else name, host, int(numeric["port"]), carrier)

    @property
    def valid(self) -> bool:
        """Whether the contact has a host and a port number."""
        return bool(self.host) and self.port > 0

    def by(self, carrier: str) -> Self:
        """Return the contact of the same port with another carrier."""
        return replace(self, carrier=carrier)

    def named(self) -> Self:
        """Return the contact with a name; a port of which only the address is known is called ``/host:port/``."""
        return self if self.name else replace(self, name=str(self.by("")))

    def __str__(self) -> str:
        """Return the contact as YARP writes it: ``tcp://127.0.0.1:10002/``, or ``tcp:/`` and the name."""
        carrier = f"{self.carrier}:/" if self.carrier else ""
        if not self.valid:
            return f"{carrier}{self.name}"
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{carrier}/{host}:{self.port}/"
