"""The part of ``rtf demo`` that runs an application: five programs on two nodes, with their logs in one file."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

from rtf import clock
from rtf.applications.deployer import DeployerContext
from rtf.applications.errors import ApplicationError
from rtf.applications.events import Kind
from rtf.applications.manager import Manager
from rtf.applications.run.client import RunClient
from rtf.applications.xml.reader import read_application
from rtf.bottle import as_int
from rtf.cli.demo_network import await_port, demo_network
from rtf.logs.collector import Collector
from rtf.logs.store import LogReader, LogStore
from rtf.middleware.ports import remote
from rtf.middleware.ports.port import Port
from rtf.middleware.wire.contact import Contact
from rtf.testing.plugins import shipped_folder

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from rtf.applications.events import Event
    from rtf.middleware.ports.network import Network

_NODES = ("/pc1", "/pc2")
#: The program that is killed, as in chain.xml.
_KILLED = "relay.py first"
#: Seconds in which a killed program is back, and in which a number arrives.
_LIMIT = 20.0


def run_application(runs: Path) -> list[str]:
    """Run the application, kill one of its programs, and stop it; return what happened, a line each.

    Its logs stay in ``demo-logs.sqlite`` in the folder of the runs. Raises RtfError, or OSError, when something does
    not work.
    """
    log = runs / "demo-logs.sqlite"
    runs.mkdir(parents=True, exist_ok=True)
    log.unlink(missing_ok=True)
    with ExitStack() as opened:
        network, environment, _ = opened.enter_context(demo_network())
        opened.enter_context(Collector(opened.enter_context(LogStore(log)), network=network))
        for node in _NODES:
            opened.enter_context(_node(node, network, environment))
        lines = _watch_chain(network)
        left = [tag for node in _NODES for tag in (one.tag for one in RunClient(node, network=network).running())]
        if left:
            raise ApplicationError(f"these programs were stopped and still run: {', '.join(left)}")
    with LogReader(log) as reader:
        senders = {record.sender for _, _, record in reader.read()}
        lines.append(f"  {reader.newest()} records of {len(senders)} programs are in {log}: see rtf log --file {log}")
    return lines


@contextmanager
def _node(name: str, network: Network, environment: dict[str, str]) -> Iterator[None]:
    """Run a node in a process of its own."""
    words = [sys.executable, "-m", "rtf", "run", "--server", name, "--log"]
    with subprocess.Popen(words, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as node:
        try:
            await_port(network, name, node)
            yield
        finally:
            node.terminate()


def _watch_chain(network: Network) -> list[str]:
    """Start the application, kill a program, and stop; return what happened."""
    file = shipped_folder("suites") / "demo" / "chain" / "chain.xml"
    loaded = read_application(file, {"folder": str(file.parent)})
    events: list[Event] = []
    connected = threading.Event()

    def hear(event: Event) -> None:
        events.append(event)
        if event.kind is Kind.CONNECTED and any(one.kind is Kind.RESTARTED for one in events):
            connected.set()

    began = clock.monotonic()
    with Manager(loaded.application, DeployerContext(network, network, "/app/chain"), hear) as manager:
        if not manager.start():
            raise ApplicationError("; ".join(one.text for one in events if one.kind is Kind.FAILED))
        up = clock.monotonic() - began
        watching = threading.Thread(target=manager.watch, name="rtf-demo-application")
        watching.start()
        try:
            with Port("/demo/watch", network=network, outputs=False) as watch:
                remote.connect(network, Contact(name="/chain/sink:o"), Contact(name="/demo/watch"), "tcp")
                before = _number(watch)
                killed = next(unit for unit in manager.units if _KILLED in unit.module.command)
                left = clock.monotonic()
                os.kill(killed.pid, signal.SIGKILL)
                if not connected.wait(_LIMIT):
                    last = "; ".join(one.text for one in events[-5:])
                    raise ApplicationError(
                        f"'{_KILLED}' was killed, and is not connected again after {_LIMIT:g} s; last events: {last}"
                    )
                while (after := _number(watch)) <= before:
                    pass
                away = clock.monotonic() - left
        finally:
            manager.interrupt()
            watching.join()
            manager.links.disconnect()
            stopped = manager.stop()
    if not stopped:
        raise ApplicationError("not all programs of the application could be stopped")
    return [
        f"An application of {len(manager.units)} programs on the nodes {' and '.join(_NODES)} is up after {up:.1f} s",
        *(f"  {one.text.splitlines()[0]}" for one in events if one.ending or one.kind is Kind.RESTARTED),
        f"  {away:.1f} s after its end numbers arrive as before: {before}, then {after}",
        "  all programs were stopped, and nothing is left on the nodes",
    ]


def _number(port: Port) -> int:
    return as_int(port.read(timeout=_LIMIT)[0])
