"""An application on the page: what runs of it, and what is asked for.

The page runs an application by a manager of its own, which it makes when the first module is started and closes when
the last one has ended: in between others can run it. While another process does, the page shows its modules, and can
have it stopped as a whole.
"""

from __future__ import annotations

import os
import signal
import threading
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING, Protocol, TypeAlias

from rtf import clock
from rtf.applications.connections import Link
from rtf.applications.deployers import SSH
from rtf.applications.errors import ApplicationError
from rtf.applications.events import Event, Kind, State
from rtf.applications.links import Links
from rtf.applications.manager import LOOK
from rtf.applications.page.document import save
from rtf.applications.page.nodes import Nodes
from rtf.applications.page.rate import LiveRates, measure
from rtf.applications.page.view import key_of
from rtf.applications.placement import allowed_nodes
from rtf.applications.xml.descriptions import find_computers
from rtf.applications.xml.reader import read_application
from rtf.errors import RtfError
from rtf.testing.suite.diagnostics import DiagnosticLog

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping, Sequence
    from pathlib import Path

    from rtf.applications.deployer import Deployer
    from rtf.applications.events import Say, Unit
    from rtf.applications.manager import Manager
    from rtf.applications.page.document import Document
    from rtf.applications.page.rate import LiveRate, Rate
    from rtf.applications.session import Session
    from rtf.applications.xml.model import Application, Connection
    from rtf.middleware.ports.network import Network

#: What happened last is kept, in so many sentences.
_KEPT = 500
#: Seconds that a run waits for the end of requests that have stopped everything.
_ENDING = 5.0
#: Seconds between two looks at connections, at least; between two looks for another process that runs the application;
#: and after which nobody is looking any more.
_LOOK_AT_LINKS, _LOOK_FOR_OTHERS, _ATTENTION = 1.0, 1.0, 10.0
#: The share of the time in which connections may be looked at.
_SHARE = 0.1
#: Requests of one application that are worked on at the same time.
_WORKERS = 8
STOPPING = "stopping"
#: State, process id, reason and node of a module.
ModuleState: TypeAlias = tuple[str, int, str, str]


class Factory(Protocol):
    """Makes what applications need to run on a network, by the options of the command line."""

    network: Network

    def session(self, application: Application) -> Session:
        """Begin the session of an application. Raises TakenError."""

    def holder(self, application: Application) -> int:
        """Return the process that runs an application, 0 if there is none."""

    def manager(self, application: Application, said: Say, *, attached: bool = False) -> Manager:
        """Make the manager of an application. Raises RtfError."""


@dataclass(frozen=True, slots=True)
class NumberedEvent:
    """Something that happened, by its number and the seconds since 1970."""

    number: int
    time: float
    kind: str
    text: str


@dataclass(frozen=True, slots=True)
class Status:
    """How an application is now.

    ``modules`` has state, process id, reason and node by tag, ``connections`` the state by key, ``rates`` the rate of
    those that are counted. ``runner`` is another process that runs the application. ``outdated``: what runs is not what
    the file has.
    """

    runner: int
    outdated: bool
    modules: Mapping[str, ModuleState]
    connections: Mapping[str, str]
    rates: Mapping[str, LiveRate]
    nodes: Mapping[str, Mapping[str, object]]
    happened: Sequence[NumberedEvent]


class ControlledApplication:
    """An application on the page. Any thread may ask. ``close`` stops what the page has started."""

    def __init__(self, path: Path, variables: Mapping[str, str], factory: Factory) -> None:
        self.path = path
        self.variables = variables
        self._factory = factory
        self._lock = threading.RLock()  # of what is run
        self._released = threading.Condition(self._lock)
        self._events_lock = threading.Lock()  # of what happened
        self._manager: Manager | None = None
        self._session: Session | None = None
        self._runner = 0
        self._working = 0
        self._saved = False
        self._begun: set[str] = set()  # tags of the modules that the page has started
        self._count = 0
        self._happened: deque[NumberedEvent] = deque(maxlen=_KEPT)
        self._before: dict[str, ModuleState] = {}  # how modules ended, by tag
        self._linked: dict[str, str] = {}
        self._rates: Mapping[str, LiveRate] = {}
        self._counted = LiveRates(factory.network)
        self._asked = clock.monotonic()
        self._closing = threading.Event()
        self._application = self._read()
        self._links = Links(self._application.connections, factory.network, self._say)
        self._nodes = Nodes(factory.network)
        self._pool = ThreadPoolExecutor(_WORKERS, "rtf-app-page")
        self._threads = [threading.Thread(target=work, daemon=True) for work in (self._watch, self._watch_network)]
        for thread in self._threads:
            thread.start()

    def _read(self) -> Application:
        loaded = read_application(self.path, self.variables)
        self._has_errors = loaded.has_errors
        self._computers = find_computers(self.path.parent, DiagnosticLog())
        return loaded.application

    def _say(self, event: Event) -> None:
        with self._events_lock:
            self._count += 1
            self._happened.append(NumberedEvent(self._count, clock.now(), str(event.kind), event.text))

    def network(self) -> Network | None:
        """Return the network if its names can be asked, for a check."""
        try:
            self._factory.network.names.query("/root")
        except RtfError:
            return None
        return self._factory.network

    # Looking ---------------------------------------------------------------------------------------------------------

    def status(self, after: int = 0) -> Status:
        """Return how the application is, and what happened after the sentence with a number."""
        self._asked = clock.monotonic()
        modules = {**self._before, **{unit.key: _state(unit) for unit in self._units()}}
        with self._events_lock:
            happened = [one for one in self._happened if one.number > after]
        return Status(self._runner, self._saved, modules, self._linked, self._rates, self._nodes.loads, happened)

    def _units(self) -> Sequence[Unit]:
        manager = self._manager
        return manager.units if manager is not None else ()

    def output(self, tag: str) -> Sequence[str]:
        """Return the last lines of a module; none where they are not known."""
        units = [unit for unit in self._units() if unit.key == tag and unit.deployer is not None]
        return units[0].place.output(units[0].module.tag) if units else ()

    # Requests --------------------------------------------------------------------------------------------------------

    def run(self, tags: Collection[str] | None) -> None:
        """Begin to start modules, or all, and to connect them. Raises RtfError if that cannot be begun."""
        with self._lock:
            manager = self._take_over()
            units = _chosen(manager, tags)
            self._begun |= {unit.key for unit in units if not unit.active}

            def work() -> None:
                if tags is not None or manager.is_fulfilled():
                    manager.begin(units)

            self._do(work)

    def stop(self, tags: Collection[str] | None, *, kill: bool = False) -> None:
        """Begin to stop modules, or all. Another process that runs them can only be asked to stop all."""
        with self._lock:
            manager = self._manager
            if self._runner:
                if tags is not None:
                    raise ApplicationError(
                        f"process {self._runner} runs the application, and can be stopped only whole"
                    )
                with suppress(ProcessLookupError):  # it has ended since the last look
                    os.kill(self._runner, signal.SIGKILL if kill else signal.SIGTERM)
            elif manager is not None:
                units = _chosen(manager, tags)
                if tags is None:
                    self._do(manager.links.disconnect)
                self._do(lambda: manager.halt(units, kill=kill))

    def connect(self, keys: Collection[str] | None) -> None:
        """Begin to make connections, or all."""
        with self._lock:
            links, some = self._current_links(), self._connections(keys)
            self._do(lambda: links.connect(some))

    def disconnect(self, keys: Collection[str] | None) -> None:
        """Begin to end connections, or all."""
        with self._lock:
            links, some = self._current_links(), self._connections(keys)
            self._do(lambda: links.disconnect(some))

    def rate(self, key: str) -> Rate:
        """Measure the rate of a connection's source, which takes two seconds. Raises RtfError."""
        for connection in self._connections([key]):
            return measure(self._factory.network, connection.source.port)
        raise ApplicationError("the application has no such connection; reload the page")

    def save(self, document: Document) -> None:
        """Write the file. What runs is not changed. Raises RtfError."""
        try:
            save(self.path, document)
        except OSError as error:
            raise ApplicationError(f"{self.path} is not saved: {error.strerror}") from None
        with self._lock:
            if self._manager is None:
                self._use_file()
            else:
                self._saved = True

    def _use_file(self) -> None:
        self._application = self._read()
        self._links = Links(self._application.connections, self._factory.network, self._say)
        self._saved = False

    def _current_links(self) -> Links:
        with self._lock:
            return self._links if self._manager is None or self._runner else self._manager.links

    def _connections(self, keys: Collection[str] | None) -> list[Connection]:
        return [one for one in self._application.connections if keys is None or key_of(one) in keys]

    def _do(self, work: Callable[[], object]) -> None:
        """Work on a request in a thread of its own; its errors are reported."""

        def whole() -> None:
            try:
                work()
            except RtfError as error:
                self._say(Event(Kind.FAILED, str(error)))
            finally:
                with self._lock:
                    self._working -= 1

        with self._lock:
            self._working += 1
        self._pool.submit(whole)

    # The manager -----------------------------------------------------------------------------------------------------

    def _take_over(self) -> Manager:
        """Return the manager; one is made if there is none. Raises RtfError."""
        # what was saved is used as soon as nothing runs: the thread that watches looks at that, and ends the manager
        self._released.wait_for(self._is_settled, _ENDING)
        if self._runner:
            raise ApplicationError(f"process {self._runner} runs the application; stop it first")
        if self._saved:
            raise ApplicationError("the application still runs as it was before it was saved; stop it first")
        if self._manager is None:
            self._use_file()
            if self._has_errors:
                raise ApplicationError("the application has errors; its problems say which")
            session = self._factory.session(self._application)
            try:
                self._manager = self._factory.manager(self._application, self._say)
            except BaseException:
                session.close()
                raise
            self._session = session
            self._manager.look()
            self._before = {}
        return self._manager

    def _is_settled(self) -> bool:
        """Return whether the manager is not about to end for what was saved."""
        return bool(self._runner) or not self._saved or any(unit.active for unit in self._units())

    def _release(self) -> None:
        """Close the manager, so that others can run the application. By the thread that watches, and at the end."""
        with self._lock:
            if self._manager is None or self._working:
                return
            if not self._runner:
                self._before = {unit.key: _state(unit) for unit in self._manager.units}
            self._manager.close()
            self._manager, self._runner = None, 0
            self._begun.clear()
            if self._session is not None:
                self._session.close()
                self._session = None
            self._use_file()
            self._released.notify_all()

    def close(self) -> None:
        """Stop what the page has started, and end all threads."""
        self._closing.set()
        for thread in self._threads:
            thread.join()
        if self._manager is not None:
            self._manager.interrupt()
        self._pool.shutdown()
        if self._manager is not None and self._begun:
            self._manager.links.disconnect()
            self._manager.halt([unit for unit in self._manager.units if unit.key in self._begun])
        self._release()
        self._nodes.close()

    # Threads ---------------------------------------------------------------------------------------------------------

    def _watch(self) -> None:
        """Watch what runs."""
        with suppress(RtfError):  # whether something runs that was left, is known when the network can be asked
            self._find_left()
        due, problem = 0.0, ""
        while not self._closing.wait(LOOK):
            if self._manager is not None and not self._runner:
                problem = self._look(partial(self._watch_own, self._manager), problem)
            elif clock.monotonic() >= due:
                due = clock.monotonic() + _LOOK_FOR_OTHERS
                problem = self._look(self._watch_other, problem)

    def _look(self, look: Callable[[], None], before: str) -> str:
        """Look once. Return the problem, "" for none; it is reported unless it is the one of ``before``."""
        try:
            look()
        except RtfError as error:
            if str(error) != before:
                self._say(Event(Kind.FAILED, str(error)))
            return str(error)
        return ""

    def _find_left(self) -> None:
        """Take over modules that a manager has left running."""
        with self._lock:
            if not self._has_errors and not self._factory.holder(self._application):
                self._take_over()

    def _watch_own(self, manager: Manager) -> None:
        manager.watch_once()
        with self._lock:  # nothing is begun meanwhile
            if not any(unit.active for unit in manager.units):
                self._release()

    def _watch_other(self) -> None:
        """Look at what another process runs, if there is one."""
        with self._lock:
            runner = 0 if self._has_errors else self._factory.holder(self._application)
            if self._manager is not None and runner != self._runner:
                self._release()
            if self._manager is None and runner:
                self._manager = self._factory.manager(self._application, self._say, attached=True)
                self._runner = runner
                self._before = {}
        if self._manager is not None:
            self._manager.look(LOOK)

    def _watch_network(self) -> None:
        """Look at connections and nodes, while somebody is interested."""
        due, problem = 0.0, ""
        while not self._closing.wait(LOOK):
            begun = clock.monotonic()
            if begun - self._asked > _ATTENTION:
                continue
            self._nodes.look(self._places())  # which waits for nothing
            if begun < due:
                continue
            problem = self._look(self._look_at_links, problem)
            now = clock.monotonic()
            due = now + max(_LOOK_AT_LINKS, (now - begun) / _SHARE)

    def _look_at_links(self) -> None:
        states = self._current_links().states()
        self._linked = {key_of(connection): str(state) for connection, state in states}
        self._rates = self._counted.rates([one for one, state in states if state is Link.CONNECTED])

    def _places(self) -> dict[str, Deployer | None]:
        """Return the nodes of modules, with their deployers as long as there is a manager."""
        asked = [one for one in self._application.modules if one.deployer != SSH]
        nodes = [allowed_nodes(one, self._computers) or (one.node,) for one in asked]
        places: dict[str, Deployer | None] = dict.fromkeys(chain.from_iterable(nodes))
        return places | {unit.module.node: unit.deployer for unit in self._units() if unit.deployer is not None}


def _chosen(manager: Manager, tags: Collection[str] | None) -> list[Unit]:
    units = [unit for unit in manager.units if tags is None or unit.key in tags]
    if tags is not None and len(units) < len({*tags}):
        raise ApplicationError("the application has no such module; reload the page")
    return units


def _state(unit: Unit) -> ModuleState:
    state = STOPPING if unit.halted and unit.state is State.RUNNING else str(unit.state)
    return state, unit.pid if unit.state is State.RUNNING else 0, unit.reason, unit.module.node
