"""The manager of an application: starts its modules, connects their ports, watches both, and stops all in reverse."""

from __future__ import annotations

import signal
import threading
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Self

from rtf import clock
from rtf.applications import connections
from rtf.applications.deployers import LocalDeployer, find_deployer, program_of, request_of
from rtf.applications.errors import ApplicationError
from rtf.applications.events import Event, Kind, State, Unit
from rtf.applications.links import Links
from rtf.applications.placement import Placement, allowed_nodes
from rtf.applications.ports import Order, ports_of
from rtf.applications.run.output import printable
from rtf.applications.substitutions import Substituted, substitute, table_of
from rtf.applications.xml.descriptions import find_computers, find_description
from rtf.applications.xml.model import RestartPolicy
from rtf.errors import RtfError
from rtf.middleware.ports import remote
from rtf.middleware.wire.contact import Contact
from rtf.testing.suite.diagnostics import DiagnosticLog
from rtf.testing.verdict import Severity

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from types import TracebackType

    from rtf.applications.deployer import Deployer, DeployerContext
    from rtf.applications.events import Say
    from rtf.applications.run.protocol import Ending
    from rtf.applications.substitutions import Entry
    from rtf.applications.xml.model import Application, Computer, Connection, Module

#: Seconds between two looks at modules and at ports that are waited for, and between two looks at connections.
LOOK, _LOOK_AT_LINKS = 0.25, 2.0
#: Seconds between two looks at modules while others are started, and while modules end.
_LOOK_AT_STARTS, _LOOK_AT_ENDS = 0.05, 0.03
#: Seconds for which a port is waited for that has no timeout, and for both ports of a connection.
PATIENCE, _CONNECTING = 60.0, 10.0
#: Seconds from SIGTERM to SIGKILL, and from there to giving up. Yarpmanager has the same.
_STOP, _KILL = 15.0, 10.0
#: A module that ran for so many seconds has all its attempts at a restart again.
_STEADY = 60.0
_GONE = (State.FAILED, State.ENDED, State.MISSING)


class Manager:
    """Runs an application. ``said`` is called with what happens, in any thread.

    Modules that run already, as an earlier manager has started them, are found by their tags and not started again.
    ``close`` ends what runs on this machine, unless it is held. Raises ApplicationError for an application that cannot
    be run, and what its deployers raise.
    """

    def __init__(
        self,
        application: Application,
        context: DeployerContext,
        said: Say = lambda _: None,
        *,
        patience: float = PATIENCE,
    ) -> None:
        self.application = application
        self._context = context
        self._network = context.network
        self._said = said
        self._patience = patience
        self._ending = threading.Event()
        self._lost: set[str] = set()
        self._making = threading.Lock()
        self._deployers: dict[tuple[type[Deployer], str], Deployer] = {}
        self._looking: dict[Deployer, Future[None]] = {}
        self._starts: list[Future[None]] = []
        self._look_at_links = 0.0
        self._linking: Future[None] | None = None
        folder = Path(application.file).parent
        log = DiagnosticLog()
        descriptions = [find_description(one.name, folder, log) for one in application.modules]
        self._ports = [ports_of(*pair) for pair in zip(application.modules, descriptions, strict=True)]
        self._order = Order(application, self._ports)
        if self._order.circle:
            raise ApplicationError(
                f"{application.file}: modules wait for each other: {self._order.circle_text(application)}"
            )
        table = table_of(folder)
        self.links = Links(application.connections, self._network, said, self._ending)
        self._pool = self._make_pool()
        try:
            self._computers = self._find_computers(folder)
            self._needs = [() if one is None else one.needs for one in descriptions]
            self.units = [self._unit(index, one, table) for index, one in enumerate(application.modules)]
            self._place([unit for unit in self.units if unit.state is State.STOPPED])
        except BaseException:
            self.close()
            raise

    def _find_computers(self, folder: Path) -> Sequence[Computer]:
        """Return the described machines. Raises ApplicationError if a node depends on files that cannot be read."""
        log = DiagnosticLog()
        found = find_computers(folder, log)
        wrong = [one for one in log if one.severity is Severity.ERROR]
        if wrong and any(module.anywhere for module in self.application.modules):
            raise ApplicationError(f"a node is to be chosen among described machines, and {wrong[0]}")
        return found

    def _unit(self, index: int, module: Module, table: Mapping[str, Entry]) -> Unit:
        found = Substituted(module) if allowed_nodes(module, self._computers) else substitute(module, table)
        if found.message:
            self._say(Kind.SUBSTITUTED, found.message, module)
        state = State.MISSING if found.missing else State.STOPPED
        reason = found.message if found.missing else ""
        return Unit(index, found.module, None, module.tag, state, reason=reason, optional=found.optional)

    def _place(self, units: Sequence[Unit]) -> None:
        """Give modules their deployers, at nodes that are chosen where that is left open."""
        placement = Placement([unit.module for unit in units], self._computers, self._deployer_of)
        for unit in units:
            placed = placement.place(unit.module, self._needs[unit.index])
            if placed.module is None:
                unit.state, unit.reason = State.MISSING, f"{unit.module} is not there: {placed.why}"
            else:
                unit.state, unit.reason = State.STOPPED, ""
                unit.module, unit.placed = placed.module, placed.why
                unit.deployer = self._deployer_of(placed.module)

    def _deployer_of(self, module: Module) -> Deployer:
        """Return the deployer of a module at its node, the same for all modules there. From any thread."""
        kind = find_deployer(module, Path(self.application.file).parent)
        key = kind, "" if kind is LocalDeployer else module.node.lstrip("/")
        with self._making:
            if key not in self._deployers:
                self._deployers[key] = kind(module.node, self._context)
            return self._deployers[key]

    def _make_pool(self) -> ThreadPoolExecutor:
        """Return a pool in which all modules can wait at once, all nodes be asked, and connections be watched."""
        return ThreadPoolExecutor(2 * len(self.application.modules) + 2, "rtf-app")

    def _say(self, kind: Kind, text: str, module: Module | None = None, ending: Ending | None = None) -> None:
        self._said(Event(kind, printable(text), "" if module is None else module.tag, ending))

    def _fail(self, unit: Unit, reason: str, did: str = "is not up") -> None:
        unit.state, unit.reason = State.FAILED, reason
        self._say(Kind.FAILED, f"{unit.module} {did}: {reason}", unit.module)

    # Starting ----------------------------------------------------------------------------------------------------

    def start(self) -> bool:
        """Start all modules, in parallel as far as they do not wait for each other, and connect them.

        Returns whether all is up. What is up stays up otherwise.
        """
        for one in self.application.arbitrators:
            self._say(Kind.IGNORED, f"the rules of {one.port} are drawn, and not applied, by yarpmanager as well")
        if not self.is_fulfilled():
            return False
        self.look()
        waiting = []
        for unit in self.units:
            if unit.state is State.RUNNING:
                self._say(Kind.FOUND, f"{unit.module} runs already ({unit.pid})", unit.module)
            elif unit.state is State.UNKNOWN:
                self._fail(unit, unit.reason)
            elif unit.state is State.STOPPED:
                unit.state = State.WAITING
                waiting.append(unit)
            elif not unit.optional:
                self._say(Kind.FAILED, unit.reason, unit.module)
        for unit in waiting:
            self._begin(unit)
        while any(unit.state in (State.WAITING, State.STARTING) for unit in self.units):
            clock.sleep(_LOOK_AT_STARTS)
            self.watch_modules()
        return all(unit.up for unit in self.units) and not self._ending.is_set() and self._connect_all()

    def interrupt(self) -> None:
        """Have ``start`` and ``watch`` return soon. From any thread."""
        self._ending.set()

    def is_fulfilled(self) -> bool:
        """Wait for the ports that the application needs, as long as it says. Returns whether they are there."""
        for dependency in self.application.dependencies:
            deadline = clock.Deadline.after(dependency.timeout or 0.0)
            while what := connections.missing(self._network, dependency):
                if deadline.expired or self._ending.wait(LOOK):
                    self._say(Kind.FAILED, f"{self.application.name} needs a port: {what}")
                    return False
        return True

    def _connect_all(self) -> bool:
        """Connect all ports as soon as they are there; modules are watched meanwhile. Returns whether all are.

        Connections of optional modules that are not there are left out.
        """
        wanted = []
        for one in self.application.connections:
            if missing := next((unit for unit in self.units if self._lacks(unit, one)), None):
                self._say(Kind.IGNORED, f"{one} is not connected: {missing.reason}")
            else:
                wanted.append(one)
        deadline = clock.Deadline.after(_CONNECTING)
        while not (done := self.links.connect(wanted, last=deadline.expired)) and not deadline.expired:
            if self._ending.wait(LOOK):
                return False
            self.watch_modules()
        return done

    def _lacks(self, unit: Unit, connection: Connection) -> bool:
        """Return whether a connection needs an optional module that is not there, by the names of its ports."""
        if not (unit.state is State.MISSING and unit.optional):
            return False
        stem = f"/{program_of(unit.module)}/"
        ends = (connection.source.port, connection.target.port)
        return any(self._ports[unit.index].opens(port) or f"{port}/".startswith(stem) for port in ends)

    def begin(self, units: Sequence[Unit]) -> None:
        """Begin to start modules that do not run; ``watch_once`` goes on. Their connections are made, too."""
        self._place([one for one in units if one.deployer is None and allowed_nodes(one.module, self._computers)])
        for unit in units:
            if unit.deployer is None and not unit.optional:
                self._say(Kind.FAILED, unit.reason, unit.module)
            if unit.deployer is None or unit.active:
                continue
            unit.state, unit.reason, unit.attempts, unit.halted = State.WAITING, "", 0, False
            unit.unnoticed = False
            self._begin(unit)
        opened = [self._ports[unit.index] for unit in units]
        self.links.want(
            one
            for one in self.application.connections
            if any(ports.opens(one.source.port) or ports.opens(one.target.port) for ports in opened)
        )

    def _begin(self, unit: Unit) -> None:
        """Have a module brought up in a thread of its own."""
        self._starts.append(self._pool.submit(self._bring_up, unit))

    def _bring_up(self, unit: Unit) -> None:
        """Start a module, again if it is to be restarted, and wait until it counts as started."""
        while unit.state is State.WAITING:
            restart = unit.module.restart
            if self._is_over(unit, restart.backoff if unit.attempts else 0.0):
                unit.state = State.STOPPED
                return
            if unit.attempts:
                text = f"{unit.module} is restarted, attempt {unit.attempts} of {restart.attempts}"
                self._say(Kind.RESTARTED, text, unit.module)
            try:
                self._await_dependencies(unit)
                self._refuse_taken_ports(unit)
                unit.state, unit.since = State.STARTING, clock.monotonic()
                if unit.placed and not unit.attempts:
                    self._say(Kind.PLACED, unit.placed, unit.module)
                unit.pid = unit.place.start(request_of(unit.module, self._context))
                self._say(Kind.STARTED, f"{unit.module} is started ({unit.pid})", unit.module)
                if self._comes_up(unit):
                    unit.state = State.RUNNING
                else:
                    self._note_end(unit)
            except RtfError as error:
                if unit.halted:
                    unit.state = State.STOPPED
                else:
                    self._fail(unit, str(error))

    def _is_over(self, unit: Unit, seconds: float) -> bool:
        """Wait, and return whether the module or the application was asked to stop meanwhile."""
        deadline = clock.Deadline.after(seconds)
        while not unit.halted and not self._ending.wait(min(LOOK, deadline.remaining())):
            if deadline.expired:
                return False
        return True

    def _await_dependencies(self, unit: Unit) -> None:
        """Wait for the ports of a module. Raises ApplicationError after the longest of their timeouts."""
        openers = [self.units[index] for index in self._order.needs[unit.index]]
        began, announced = clock.monotonic(), False
        longest = max((one.timeout or self._patience for one in unit.module.dependencies), default=0.0)
        for dependency in unit.module.dependencies:
            while what := connections.missing(self._network, dependency):
                if failed := [other for other in openers if other.state in _GONE]:
                    raise ApplicationError(f"it waits for a port of {failed[0].module}, which is not up")
                if clock.monotonic() - began > longest:
                    raise ApplicationError(f"after {longest:g} s, {what}")
                if not announced:
                    announced = True
                    self._say(Kind.WAITING, f"{unit.module} waits: {what}", unit.module)
                if self._is_over(unit, LOOK):
                    raise ApplicationError("it was waiting when the application was stopped")

    def _refuse_taken_ports(self, unit: Unit) -> None:
        for port in self._ports[unit.index].described:
            found = self._network.names.query(port)
            if found is not None and remote.exists(self._network, found):
                where = f"{found.host}:{found.port}"
                raise ApplicationError(f"its port {port} is open already, by another program at {where}; end that one")

    def _comes_up(self, unit: Unit) -> bool:
        """Wait until a module counts as started. False if it ends meanwhile; ApplicationError if it is never ready."""
        ready = unit.module.ready
        deadline = clock.Deadline.after(max(unit.module.start_delay, self._patience if ready else 0.0))
        while not (ready and remote.exists(self._network, Contact(ready))):
            expired = deadline.expired
            if unit.module.tag not in unit.place.running():
                return False
            if expired and ready:
                raise ApplicationError(f"its port {ready} is not open after {deadline.limit:g} s")
            if expired or self._is_over(unit, min(LOOK, deadline.remaining())):
                break
        return True

    # Watching ----------------------------------------------------------------------------------------------------

    def watch(self) -> bool:
        """Watch until all modules have ended, or :meth:`interrupt` is called. Returns whether none failed.

        Without modules there are connections to watch.
        """
        while (not self.units or any(one.active or one.unnoticed for one in self.units)) and not self._ending.wait(
            LOOK
        ):
            self.watch_once()
        return all(unit.good for unit in self.units)

    def watch_once(self) -> None:
        """Look at modules and connections, report, and begin to restart what is to be restarted."""
        self.watch_modules()
        if self._linking is not None and self._linking.done():
            done, self._linking = self._linking, None
            done.result()
        if self._linking is None and clock.monotonic() >= self._look_at_links:
            self._look_at_links = clock.monotonic() + _LOOK_AT_LINKS
            self._linking = self._pool.submit(self.links.watch)

    def watch_modules(self) -> None:
        """Look at modules alone."""
        self.look(LOOK)
        for unit in self.units:  # also those that a slow node has reported since the last look
            if unit.unnoticed and unit.state is State.STOPPED:
                unit.unnoticed = False
                if not unit.halted and self._note_end(unit):
                    self._begin(unit)
        for done in [start for start in self._starts if start.done()]:
            self._starts.remove(done)
            done.result()

    def look(self, timeout: float | None = None) -> None:
        """Ask all nodes which modules run. Those that have not answered in time are asked no further until they do."""
        for deployer in {unit.deployer for unit in self.units if unit.deployer is not None}:
            if deployer not in self._looking or self._looking[deployer].done():
                self._looking[deployer] = self._pool.submit(self._look_at, deployer)
        for done in wait(self._looking.values(), timeout).done:
            done.result()

    def _look_at(self, deployer: Deployer) -> None:
        looked_at = (State.STOPPED, State.RUNNING, State.UNKNOWN)
        before = [(one, one.state) for one in self.units if one.deployer is deployer and one.state in looked_at]
        try:
            running: Mapping[str, int] | None = deployer.running()
            reason = ""
        except RtfError as error:
            running, reason = None, str(error)
        for unit, state in before:
            if unit.state is not state:  # it is being started, or was stopped, meanwhile
                continue
            unit.reason = reason
            if running is None:
                unit.state = State.UNKNOWN
            elif unit.module.tag in running:
                unit.state, unit.pid = State.RUNNING, running[unit.module.tag]
            else:
                unit.unnoticed = state is not State.STOPPED or unit.unnoticed
                unit.state = State.STOPPED
        self._report_lost(deployer, reason)

    def _report_lost(self, deployer: Deployer, reason: str) -> None:
        if reason and deployer.place not in self._lost:
            self._lost.add(deployer.place)
            self._say(Kind.LOST, f"{deployer.place} is not watched: {reason}")
        elif not reason and deployer.place in self._lost:
            self._lost.discard(deployer.place)
            self._say(Kind.BACK, f"{deployer.place} answers again")

    def _note_end(self, unit: Unit) -> bool:
        """Report the end of a module that nobody asked for. Returns whether it waits now to be restarted."""
        ending = unit.place.ending(unit.module.tag)
        good = ending is not None and ending.exit_status == 0
        unit.reason = ending.how if ending is not None else "its node does not say how"
        last = "".join(f"\n    {line}" for line in ending.lines) if ending is not None else ""
        self._say(Kind.ENDED if good else Kind.FAILED, f"{unit.module} ended: {unit.reason}{last}", unit.module, ending)
        restart = unit.module.restart
        if clock.monotonic() - unit.since > _STEADY:
            unit.attempts = 0
        unit.state = State.ENDED if good else State.FAILED
        if restart.policy is RestartPolicy.NEVER or (good and restart.policy is RestartPolicy.ON_FAILURE):
            return False
        if unit.attempts == restart.attempts:
            self._fail(unit, f"it ended {unit.attempts + 1} times", "is not restarted any more")
            return False
        unit.attempts += 1
        unit.state = State.WAITING
        return True

    # Stopping ----------------------------------------------------------------------------------------------------

    def stop(self, *, kill: bool = False) -> bool:
        """Stop all modules, those first that wait for others; with ``kill`` at once. Returns whether none is left."""
        self._ending.set()
        self._pool.shutdown(wait=True)  # what is being started is started, or not
        self._pool = self._make_pool()
        for unit in self.units:
            if unit.deployer is not None and (unit.pid or unit.since or unit.state is not State.FAILED):
                unit.state = State.STOPPED
        self.look()
        return self._bring_all_down(self.units, kill=kill)

    def halt(self, units: Sequence[Unit], *, kill: bool = False) -> bool:
        """Stop some modules while others run on, in the order of ``stop``. Returns whether none of them is left.

        Any thread may ask, also to kill what another one has begun to stop.
        """
        for unit in units:
            unit.halted = True
        while any(unit.state in (State.WAITING, State.STARTING) for unit in units):
            clock.sleep(_LOOK_AT_STARTS)
        for unit in units:
            if unit.state in (State.ENDED, State.FAILED):
                unit.state, unit.reason = State.STOPPED, ""
        return self._bring_all_down(units, kill=kill)

    def _bring_all_down(self, units: Sequence[Unit], *, kill: bool) -> bool:
        for level in reversed(self._order.levels()):
            there = [unit for unit in units if unit.index in level and unit.state in (State.RUNNING, State.UNKNOWN)]
            places = {unit.place: [one for one in there if one.place is unit.place] for unit in there}
            list(self._pool.map(partial(self._bring_down, kill=kill), places, places.values()))
        return not any(unit.state in (State.RUNNING, State.UNKNOWN) for unit in units)

    def _bring_down(self, deployer: Deployer, units: Sequence[Unit], *, kill: bool) -> None:
        """Stop the modules of a place: SIGTERM after their stop delays, SIGKILL for those that do not end in time."""
        waiting = {unit: clock.Deadline.after(0.0 if kill else unit.module.stop_delay) for unit in units}
        ending: dict[Unit, clock.Deadline] = {}
        killed: set[Unit] = set()

        def send(unit: Unit, signum: int) -> None:
            deployer.signal(unit.module.tag, signum)
            ending[unit] = clock.Deadline.after(_KILL if signum == signal.SIGKILL else _STOP)
            killed.update([unit] if signum == signal.SIGKILL else [])

        try:
            while waiting or ending:
                for unit in [one for one, deadline in waiting.items() if deadline.expired]:
                    send(unit, signal.SIGKILL if kill else signal.SIGTERM)
                    del waiting[unit]
                clock.sleep(_LOOK_AT_ENDS)
                running = deployer.running()
                for unit, deadline in [*ending.items()]:
                    if unit.module.tag not in running:
                        del ending[unit]
                        self._note_stop(unit, killed=unit in killed, asked=not kill)
                    elif deadline.expired and unit in killed:
                        del ending[unit]
                        reason = f"it runs {_KILL:g} s after SIGKILL"
                        self._say(Kind.FAILED, f"{unit.module} is not stopped: {reason}", unit.module)
                    elif deadline.expired:
                        send(unit, signal.SIGKILL)
        except RtfError as error:
            for unit in (*waiting, *ending):
                self._say(Kind.FAILED, f"{unit.module} is not stopped: {error}", unit.module)

    def _note_stop(self, unit: Unit, *, killed: bool, asked: bool) -> None:
        unit.state = State.STOPPED
        late = f", as it ran {_STOP:g} s after SIGTERM" if killed and asked else ""
        self._say(Kind.STOPPED, f"{unit.module} is {'killed' if killed else 'stopped'}{late}", unit.module)

    def close(self) -> None:
        """Release the deployers. What runs on this machine ends, unless it is held."""
        self._ending.set()
        self._pool.shutdown(wait=True)
        for deployer in self._deployers.values():
            deployer.close()
        self._deployers.clear()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
