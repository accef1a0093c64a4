"""What a server is told: by the runner over their channel, or by the command that shows a finished run."""

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
    """One page of one run.

    ``host`` and ``port`` are what is listened on. Without ``token`` nothing can be controlled. ``keep`` has the server
    stay when the run is over. ``compare`` is the folder of an earlier run; ``history`` the file of all runs, empty for
    the usual place, None for no history.
    """

    run_folder: str
    host: str
    port: int
    token: str = ""
    keep: bool = False
    compare: str | None = None
    history: str | None = None

    def to_line(self) -> bytes:
        """As it goes over the channel."""
        return json.dumps(asdict(self)).encode() + b"\n"

    @classmethod
    def from_line(cls, line: bytes) -> Settings:
        """What came over the channel."""
        return cls(**json.loads(line))

    @property
    def address(self) -> str:
        """The address of the page, without the token."""
        host = platform.node() if self.host in WILDCARDS else self.host
        return f"http://{bracketed(host)}:{self.port}/"


def bracketed(host: str) -> str:
    """A host as it stands in an address: IPv6 in brackets."""
    return f"[{host}]" if ":" in host else host
