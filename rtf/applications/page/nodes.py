"""The load of the machines on which the modules of an application run."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from operator import itemgetter
from typing import TYPE_CHECKING

from rtf import clock
from rtf.applications.deployers import is_local
from rtf.applications.run import sysinfo
from rtf.applications.run.client import RunClient
from rtf.errors import RtfError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from concurrent.futures import Future

    from rtf.applications.deployer import Deployer
    from rtf.middleware.ports.network import Network

#: Seconds between two questions to a node, and for its answer.
_EVERY, _ANSWER = 4.0, 2.0
_MOST_AT_ONCE = 8


class Nodes:
    """Asks nodes for their figures, without waiting for the answers. ``loads`` are the last ones, by node."""

    def __init__(self, network: Network) -> None:
        self.loads: Mapping[str, Mapping[str, object]] = {}
        self._network = network
        self._pool = ThreadPoolExecutor(_MOST_AT_ONCE, "rtf-app-page-nodes")
        self._asked: dict[str, tuple[float, Future[Mapping[str, object]]]] = {}

    def look(self, nodes: Mapping[str, Deployer | None]) -> None:
        """Ask nodes that were not asked for a while, by their deployers if they have one, and take what has come."""
        loads = {}
        for node, deployer in sorted(nodes.items(), key=itemgetter(0)):
            when, future = self._asked.get(node, (0.0, None))
            if future is not None and future.done():
                loads[node] = future.result()
            elif node in self.loads:
                loads[node] = self.loads[node]
            if future is None or (future.done() and clock.monotonic() - when > _EVERY):
                self._asked[node] = clock.monotonic(), self._pool.submit(self._ask, node, deployer)
        self.loads = loads

    def _ask(self, node: str, deployer: Deployer | None) -> Mapping[str, object]:
        try:
            figures = deployer.figures() if deployer is not None else None
            if figures is not None:
                found = figures
            elif is_local(node):
                found = sysinfo.measure()
            else:
                name = f"/{node.lstrip('/')}"
                found = RunClient(name, network=self._network, timeout=_ANSWER).system_info()
        except RtfError as error:
            return {"error": str(error)}
        return {
            "load": round(found.load_1, 2),
            "cores": found.siblings,
            "memory_free": found.memory_free,
            "memory_total": found.memory_total,
        }

    def close(self) -> None:
        """End the threads."""
        self._pool.shutdown(cancel_futures=True)
