"""The settings of a server, from the runner over their channel, or from the command that shows a finished run."""

from __future__ import annotations

import json
import platform
from dataclasses import asdict, dataclass

#: The addresses on which every network interface listens.
WILDCARDS = frozenset({"0.0.0.0", "::", ""})  # noqa: S104 - recognised, not used
#: Where errors of the server are written, inside the run's folder.
LOG_NAME = "web-server.log"


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """The settings of a run's page.

    ``host`` and ``port`` are the address of the server. Without ``token`` the run cannot be controlled. ``keep``: the
    server keeps running after the run. ``compare`` is the folder of an earlier run; ``history`` the file of all runs,
    empty for the default, None for no history.
    """

    run_folder: str
    host: str
    port: int
    token: str = ""
    keep: bool = False
    compare: str | None = None
    history: str | None = None

    def to_line(self) -> bytes:
        """Encode the settings for the channel."""
        return json.dumps(asdict(self)).encode() + b"\n"

    @classmethod
    def from_line(cls, line: bytes) -> Settings:
        """Decode settings from the channel."""
        return cls(**json.loads(line))

    @property
    def address(self) -> str:
        """The address of the page, without the token."""
        return address_of(self.host, self.port)


def address_of(host: str, port: int) -> str:
    """Return the address of a page; one on every interface has the name of this machine."""
    return f"http://{bracketed(platform.node() if host in WILDCARDS else host)}:{port}/"


def bracketed(host: str) -> str:
    """Return a host for a URL: IPv6 in brackets."""
    return f"[{host}]" if ":" in host else host
