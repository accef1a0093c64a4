"""What a deployer is: it starts, watches and ends modules at a place."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from rtf.applications.run.protocol import Ending, Start
    from rtf.applications.run.record import NodeRecord
    from rtf.applications.run.sysinfo import SystemInfo
    from rtf.middleware.ports.network import Network


@dataclass(frozen=True, slots=True)
class DeployerContext:
    """What all deployers of an application share.

    ``local`` is the network for the own node ``own_name``, ``record`` opens what an earlier one has left. With ``hold``
    modules run on when the manager has ended. ``log`` is the port of the logger for their output, None without.
    ``attached``: another process has the own node, and it is asked by the network. ``report`` gets what is done with
    programs that an earlier manager has left.
    """

    network: Network
    local: Network
    own_name: str
    record: Callable[[], NodeRecord | None] = lambda: None
    hold: bool = False
    log: str | None = None
    attached: bool = False
    report: Callable[[str], None] = lambda _: None


class Deployer(ABC):
    """Runs modules at one place: a machine, or whatever its plug-in knows. Methods may be called from any thread.

    All raise RtfError with the place and the reason.
    """

    def __init__(self, place: str, context: DeployerContext) -> None:
        self.place = place
        self.context = context

    @abstractmethod
    def start(self, request: Start) -> int:
        """Start a program. Return its process id, 0 if that is not known."""

    @abstractmethod
    def running(self) -> Mapping[str, int]:
        """Return the process ids of all programs that run at the place, by tag."""

    @abstractmethod
    def signal(self, tag: str, signum: int) -> bool:
        """Send SIGTERM or SIGKILL to a program and all that it has started. False if there is none."""

    def ending(self, tag: str) -> Ending | None:  # noqa: ARG002 - for those that know
        """Return how the last program of a tag has ended; None where that is not known."""
        return None

    def output(self, tag: str) -> Sequence[str]:  # noqa: ARG002 - for those that know
        """Return the last lines of a program; none where they are not known."""
        return ()

    def which(self, program: str, directory: str = "") -> str | None:  # noqa: ARG002 - for those that know
        """Return the file of a program, empty if it is not there; None where that is not known.

        ``directory`` is the folder in which it would be started.
        """
        return None

    def figures(self) -> SystemInfo | None:
        """Return the figures of the machine; None where they are not known."""
        return None

    def close(self) -> None:  # noqa: B027 - most hold nothing
        """Release what the deployer holds. Programs that are not held end."""
