"""On which node a module runs that leaves the choice: the least-loaded one that has what the module needs.

A module whose file names no node may run on every machine that ``resources/*.xml`` describe; one with several names in
its ``<node>`` on each of these. What a node has is measured when the application is started, as is its load. Modules
of the same application count as one running thread each, since a load average does not know them yet.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, TypeAlias

from rtf.applications.run.sysinfo import SystemInfo
from rtf.applications.xml.model import Text
from rtf.errors import RtfError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from rtf.applications.deployer import Deployer
    from rtf.applications.xml.model import Computer, Module

#: Figures that a machine has to have, as a description has them.
Needs: TypeAlias = "Sequence[Mapping[str, str]]"

_MOST_AT_ONCE = 16
_KIB, _GIB = 1024, 1 << 20  # files have KiB, as those of yarpmanager, and nodes say MiB
_SPACES = ("total_space", "free_space")


@dataclass(frozen=True, slots=True)
class Placed:
    """A module with its node, and why it is that one. Without a node, ``module`` is None and ``why`` says the reason.

    ``found``: it runs there already.
    """

    module: Module | None
    why: str
    found: bool = False


@dataclass(slots=True)
class _Node:
    """What is known of a node: its figures, the tags that run there, or why it cannot be asked."""

    figures: SystemInfo = field(default_factory=SystemInfo)
    running: frozenset[str] = frozenset()
    reason: str = ""
    placed: int = 0

    @property
    def load(self) -> float:
        """Running threads for each processor; high where that is not known."""
        if self.figures.siblings <= 0:
            return float("inf")
        return (self.figures.load_1 + self.placed) / self.figures.siblings

    def __str__(self) -> str:
        """Return the figures for people."""
        figures = self.figures
        if figures.siblings <= 0:
            return "load not known"
        more = f" and {self.placed} of these modules" if self.placed else ""
        return (
            f"load {figures.load_1:.1f}{more} on {figures.siblings} processors,"
            f" {figures.memory_free * _KIB / _GIB:.1f} GB free"
        )


def allowed_nodes(module: Module, computers: Sequence[Computer]) -> tuple[Text, ...]:
    """Return the nodes among which one is to be chosen for a module; none if its file says where it runs."""
    if module.anywhere:
        return tuple(one.name for one in computers if not one.disabled)
    names = module.node.replace(",", " ").split()
    return tuple(Text(name, module.node.location) for name in names) if len(names) > 1 else ()


def shown_node(module: Module, computers: Sequence[Computer]) -> str:
    """Return where a module runs, for people: its node, or those among which one is chosen."""
    return " or ".join(allowed_nodes(module, computers)) or module.node


def lacking(figures: Mapping[str, str], needs: Needs) -> list[str]:
    """Return what a machine with these figures lacks, as ``memory.free_space of 2.0 GB is needed, 0.4 GB is there``."""
    found = []
    for name, wanted in (item for need in needs for item in need.items()):
        has = figures.get(name)
        if not _suffices(has, wanted):
            there = "it is not known" if has is None else f"{_shown(name, has)} is there"
            found.append(f"{name} of {_shown(name, wanted)} is needed, {there}")
    return found


def _suffices(has: str | None, wanted: str) -> bool:
    """Return whether a figure of a machine is enough: at least the number, or the same word."""
    try:
        return has is not None and float(has) >= float(wanted)
    except ValueError:
        return has is not None and has.lower() == wanted.lower()


def _shown(name: str, value: str) -> str:
    if not name.endswith(_SPACES):
        return value
    try:
        return f"{float(value) / _GIB:.1f} GB"
    except ValueError:
        return value


def measured(figures: SystemInfo) -> dict[str, str]:
    """Return what a node says of itself by the names of resource files. What it does not say is left out."""
    spaces = {
        "memory.total_space": figures.memory_total,
        "memory.free_space": figures.memory_free,
        "storage.total_space": figures.storage_total,
        "storage.free_space": figures.storage_free,
    }
    others = {
        "processor.architecture": figures.architecture,
        "processor.model": figures.model,
        "processor.cores": figures.cores,
        "processor.siblings": figures.siblings,
        "processor.frequency": figures.frequency,
        "platform.name": figures.name,
        "platform.distribution": figures.distribution,
        "platform.release": figures.release,
    }
    found = {name: str(value * _KIB) for name, value in spaces.items() if value}
    return found | {name: str(value) for name, value in others.items() if value}


class Placement:
    """Chooses the nodes of an application's modules. Nodes are asked once, at construction, all at the same time.

    ``deployer`` returns what runs a module at its node; ``find``: modules that run already are looked for.
    """

    def __init__(
        self,
        modules: Sequence[Module],
        computers: Sequence[Computer],
        deployer: Callable[[Module], Deployer],
        *,
        find: bool = True,
    ) -> None:
        self._computers = {one.name.lstrip("/"): one for one in computers}
        self._deployer = deployer
        self._find = find
        self._allowed = {module: allowed_nodes(module, computers) for module in modules}
        places: dict[tuple[str, str], Module] = {}
        for module, nodes in self._allowed.items():
            places |= {(module.deployer, node): replace(module, node=node, anywhere=False) for node in nodes}
        with ThreadPoolExecutor(max(1, min(len(places), _MOST_AT_ONCE)), "rtf-app-nodes") as pool:
            self._asked = dict(zip(places, pool.map(self._ask, places.values()), strict=True))

    def _ask(self, module: Module) -> _Node:
        try:
            deployer = self._deployer(module)
            figures = deployer.figures() or SystemInfo()
            running = frozenset(deployer.running()) if self._find else frozenset()
        except RtfError as error:
            return _Node(reason=str(error))
        return _Node(figures, running)

    def place(self, module: Module, needs: Needs = ()) -> Placed:
        """Return a module with its node; as it is, without a word, if there is nothing to choose.

        ``needs`` are those of its description, besides its own.
        """
        allowed = self._allowed.get(module, ())
        if not allowed:
            return Placed(module, "")
        needs = [*needs, dict(module.needs)]
        made = {node: replace(module, node=node, anywhere=False) for node in allowed}
        nodes = {node: self._asked[module.deployer, node] for node in allowed}
        for node, one in made.items():
            if one.tag in nodes[node].running:
                return Placed(one, "", found=True)
        refused = {node: reason for node, one in nodes.items() if (reason := self._refusal(node, one, needs))}
        free = {node: one for node, one in nodes.items() if node not in refused}
        others = [f"{node}: {free[node]}" for node in free]
        others += [f"{node} refused: {reason}" for node, reason in refused.items()]
        if not free:
            return Placed(None, f"no node is left for it: {'; '.join(others)}")
        best = min(free, key=lambda node: free[node].load)
        why = f"{module.command} is placed on {best}: {'; '.join(others)}"
        free[best].placed += 1
        return Placed(made[best], why)

    def _refusal(self, node: str, one: _Node, needs: Needs) -> str:
        computer = self._computers.get(node.lstrip("/"))
        if computer is not None and computer.disabled:
            return f"it is disabled by {computer.name.location}"
        if one.reason:
            return one.reason
        described = computer.figures if computer is not None else {}
        return ", ".join(lacking({**described, **measured(one.figures)}, needs))
