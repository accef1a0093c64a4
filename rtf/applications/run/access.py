"""Who may ask a node for what: peers by address, programs by name or folder, and variables by name.

A node starts programs for everyone who reaches it, as its original does. Therefore ours answers programs of its own
machine only, until addresses are named. Where the programs are restricted, so are the variables that a request may
set: one such as ``LD_PRELOAD`` would make any allowed program another one.
"""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Self

from rtf.applications.run.errors import RunError, StartError
from rtf.middleware.ports.access import Access

if TYPE_CHECKING:
    import ipaddress
    from collections.abc import Iterable, Mapping

_LOOPBACK = Access.parse(["127.0.0.0/8", "::1"])
#: What a request may set for restricted programs, besides what is named.
_HARMLESS = ("YARP_PORT_PREFIX", "YARP_RENAME*", "YARP_PORTNUMBER*", "YARP_FORWARD_*", "YARP_*_OUTPUT", "YARP_*_ENABLE")


@dataclass(frozen=True, slots=True)
class RunAccess:
    """What is allowed. No ``peers``: this machine; no ``programs`` and ``folders``: all programs, in any environment.

    A program is allowed by its name if it is the one of that name on the node's own PATH, whatever the request's PATH.
    ``variables`` are patterns of names.
    """

    peers: Access = _LOOPBACK
    programs: tuple[str, ...] = ()
    folders: tuple[Path, ...] = ()
    variables: tuple[str, ...] = ()

    @classmethod
    def parse(cls, peers: Iterable[str] = (), programs: Iterable[str] = (), variables: Iterable[str] = ()) -> Self:
        """Read addresses such as ``10.0.0.0/24``, programs such as ``yarpdev`` or ``/opt/robot/bin``, and names.

        Raises AddressError and RunError.
        """
        named = [*peers]
        for word in named:
            if word.startswith("/"):
                raise RunError(
                    f"{word!r} is no address: a port's name is what a program says of itself, so a node is guarded by"
                    " addresses, such as 10.0.0.7 or 10.0.0.0/24"
                )
        names, folders = [], []
        for word in programs:
            if "/" not in word:
                names.append(word)
            elif Path(word).is_dir():
                folders.append(Path(word).resolve())
            else:
                raise RunError(f"{word} is no folder; allow a folder with programs, or a program by its name alone")
        return cls(Access.parse(named) if named else _LOOPBACK, tuple(names), tuple(folders), tuple(variables))

    @property
    def loopback_only(self) -> bool:
        """Whether only programs of this machine may ask."""
        return self.peers is _LOOPBACK

    def admits(self, address: ipaddress.IPv4Address | ipaddress.IPv6Address | None) -> bool:
        """Return whether a peer with this address may ask."""
        return address is not None and any(address in network for network in self.peers.networks)

    def check_program(self, path: str, changed: Iterable[str], environment: Mapping[str, str]) -> None:
        """Raise StartError if the program at ``path`` may not be started, or not with these variables ``changed``.

        ``environment`` is that of the node.
        """
        if not self.programs and not self.folders:
            return
        real = Path(path).resolve()
        by_name = [shutil.which(name, path=environment.get("PATH")) for name in self.programs]
        if not (
            any(folder in real.parents for folder in self.folders)
            or any(found is not None and Path(found).resolve() == real for found in by_name)
        ):
            raise StartError(f"{path} is not among the allowed programs of this node")
        for name in changed:
            if not any(fnmatchcase(name, pattern) for pattern in (*_HARMLESS, *self.variables)):
                raise StartError(f"the variable {name} is not among the allowed ones of this node")
