"""The runner's side of the fork server: it starts the fork server and takes children from it.

Tests of a file that has several come from a *plug-in server*, a child that has the file loaded; see ``fork_server``.
"""

from __future__ import annotations

import contextlib
import signal
import socket
from collections import Counter, deque
from typing import TYPE_CHECKING

from rtf import clock
from rtf.testing.isolation import messages, processes
from rtf.testing.isolation.child import Child, End
from rtf.testing.isolation.launch import Launched, launch
from rtf.testing.isolation.messages import Exited, Forked, Frames, Job, Loaded, Preload
from rtf.testing.isolation.reactor import Reactor
from rtf.testing.verdict import TestingError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    import msgspec

    from rtf.testing.plugins import PluginRef

_CHUNK = 1 << 18
_START_LIMIT = 60.0
_VANISH = 5.0
#: Plug-in servers that are kept at the same time.
_PLUGIN_SERVERS = 4


class ForkServerLostError(TestingError, ConnectionError):
    """The fork server died or does not answer. A new one is started for the next test."""


class LoadTimeoutError(TestingError, TimeoutError):
    """The file that several tests share was not loaded within the first test's time; ``stacks`` are from then."""

    def __init__(self, text: str, stacks: str) -> None:
        super().__init__(text)
        self.stacks = stacks


class WorkerPool:
    """The children of one process that forks, from the runner's side. One child is always requested in advance."""

    def __init__(self, client: ForkServerClient, control: socket.socket) -> None:
        self.connected = True
        self.reactor = client.reactor
        self._client = client
        self._control = control
        self._frames = Frames()
        self._asked_for: deque[Child] = deque()
        self._living: dict[int, Child] = {}
        self._spare: Child | None = None
        self.reactor.watch(control.fileno(), self._receive)

    def loaded(self, problems: tuple[str, ...]) -> None:
        """Record what could not be loaded."""
        self._client.problems.extend(problems)

    def lost(self) -> None:
        """Record that the process has closed its socket."""
        self.abandon()

    def rouse(self) -> None:
        """Continue the fork server, in case it was stopped by a signal."""
        self._client.rouse()

    def abandon(self) -> None:
        """End the fork server with all its children."""
        self._client.abandon()

    def request(self, message: msgspec.Struct, *descriptors: int) -> None:
        """Send the process a request; if it is gone, a later wait notices the loss."""
        if self.connected:
            with contextlib.suppress(OSError):
                data = messages.pack(message)
                if descriptors:
                    socket.send_fds(self._control, [data], descriptors)
                else:
                    self._control.sendall(data)

    def ask_ahead(self) -> None:
        """Request a child that will be taken later."""
        self._spare = self._fork()

    def take(self) -> Child:
        """Return a fresh child, which waits for its job. Raises ForkServerLostError if there is none."""
        child = self._spare if self._spare is not None and self._spare.end is None else self._fork()
        self._spare = None
        deadline = clock.Deadline.after(_START_LIMIT)
        while not child.pid:
            if not self.connected or deadline.expired:
                raise ForkServerLostError("the process from which tests are forked died or does not answer")
            self.reactor.run_once(deadline)
        self.ask_ahead()
        return child

    def _fork(self) -> Child:
        child = Child(self)
        self._asked_for.append(child)
        return child

    def _receive(self) -> bool:
        """Read what the process has sent; returns whether there may be more."""
        if not self.connected:
            return False
        try:
            data = self._control.recv(_CHUNK, socket.MSG_DONTWAIT)
        except BlockingIOError:
            return False
        except OSError:
            data = b""
        try:
            for frame in self._frames.feed(data):
                self._take_in(messages.to_runner(frame))
        except ValueError:  # another process has written to it
            data = b""
        if not data:
            self.disconnect()
            self.lost()
        return bool(data)

    def _take_in(self, message: Forked | Exited | Loaded) -> None:
        if isinstance(message, Forked):
            child = self._asked_for.popleft()
            child.pid = message.pid
            self._living[message.pid] = child
        elif isinstance(message, Exited):
            self._living.pop(message.pid).ended(End(message.status, message.cpu_time, message.max_rss))
        else:
            self.loaded(message.problems)

    def disconnect(self) -> None:
        """Close the socket, at which the process ends."""
        if self.connected:
            self.connected = False
            self.reactor.unwatch(self._control.fileno())
            self._control.close()

    def gone(self) -> None:
        """Record that the process has ended, and with it everything that it forked."""
        while self._receive():
            pass
        self.disconnect()
        children = [*self._asked_for, *self._living.values()]
        self._asked_for.clear()
        self._living.clear()
        self._spare = None
        for child in children:
            child.ended(End(None))


class PluginServer(WorkerPool):
    """A child of the fork server that has loaded one file and forks the tests of that file.

    ``fixtures`` are the generations that were up when the file was loaded: what it learnt from them holds as long.
    """

    def __init__(self, client: ForkServerClient, child: Child, plugin: PluginRef, fixtures: Mapping[str, int]) -> None:
        self.fixtures = dict(fixtures)
        self.process = child
        self._fit: bool | None = None
        job = Job(kind="plugin server", id="", name="", plugin=plugin, folder="", run_folder="")
        super().__init__(client, child.serve_plugin(job, self._printed))
        child.on_end = self.gone

    @property
    def loading(self) -> bool:
        """Whether the file is still being loaded."""
        return self._fit is None and self.connected

    @property
    def usable(self) -> bool:
        """Whether tests can be forked from the server."""
        return bool(self._fit) and self.connected

    def loaded(self, problems: tuple[str, ...]) -> None:
        self.process.drain()
        if self._fit is None:
            self._fit = not problems

    def lost(self) -> None:
        pass  # the next test notices

    def dismiss(self) -> None:
        """End the server, and wait until nothing of it is left."""
        self.process.dismiss()
        self.gone()

    def _printed(self, _stream: str, _data: bytes) -> None:
        self._fit = False  # what the file prints when it is loaded belongs to each test


class ForkServerClient:
    """Starts the fork server process, takes children from it, and starts another one when it is lost.

    ``uses`` says how many tests are planned for a plug-in file: one with several is loaded once, in a plug-in server.
    ``launched`` is a process that was started before there was anything to say to it.
    """

    def __init__(
        self,
        *,
        preload: Iterable[str] = (),
        uses: Mapping[str, int] | None = None,
        launched: Launched | None = None,
        stop_now: Callable[[], bool] = lambda: False,
    ) -> None:
        self.reactor = Reactor()
        self.problems: list[str] = []
        self.loading_took = 0.0
        self._preload = tuple(preload)
        self._uses = Counter(uses or {})
        self._launched = launched
        self._stop_now = stop_now
        self._servers: dict[str, PluginServer] = {}
        self._process: Launched | None = None
        self._pool: WorkerPool | None = None

    def start(self) -> WorkerPool:
        """Start the fork server process without waiting for it."""
        self._process, self._launched = self._launched or launch(), None
        pool = WorkerPool(self, self._process.control)
        if self._preload:
            pool.request(Preload(self._preload))
        pool.ask_ahead()
        self._pool = pool
        return pool

    def take(
        self,
        plugin: PluginRef | None = None,
        fixtures: Mapping[str, int] | None = None,
        limit: float | None = None,
    ) -> Child:
        """Return a fresh child, which waits for its job. Raises ForkServerLostError if there is none.

        ``plugin`` is what a test will load and ``fixtures`` are the generations that it will use: where several tests
        share the file, the child comes from a plug-in server. Raises LoadTimeoutError when that has not loaded the file
        within ``limit`` seconds; after that, each test loads it for itself. ``loading_took`` is the time of loading.
        """
        self.loading_took = 0.0
        pool = self._pool or self.start()
        try:
            if plugin is not None and plugin.language == "python":
                server = self._server_for(pool, plugin, fixtures or {}, limit)
                if server is not None:
                    with contextlib.suppress(ForkServerLostError):  # the test loads it, then
                        return server.take()
            return pool.take()
        except ForkServerLostError:
            self.abandon()
            raise

    def _server_for(
        self, pool: WorkerPool, plugin: PluginRef, fixtures: Mapping[str, int], limit: float | None
    ) -> PluginServer | None:
        path = plugin.path
        server = self._servers.get(path)
        planned = self._uses[path]
        self._uses[path] = planned - 1
        if server is not None and (not server.usable or server.fixtures != fixtures):
            if not server.usable:
                self._uses[path] = planned = 0  # it has died during a test; that may happen once
            self._servers.pop(path).dismiss()
            server = None
        if server is None and planned > 1:
            server = self._make_server(pool, plugin, fixtures, limit)
        return server

    def _make_server(
        self, pool: WorkerPool, plugin: PluginRef, fixtures: Mapping[str, int], limit: float | None
    ) -> PluginServer | None:
        for path in [path for path in self._servers if self._uses[path] <= 0]:
            self._servers.pop(path).dismiss()
        if len(self._servers) >= _PLUGIN_SERVERS:
            return None
        server = PluginServer(self, pool.take(), plugin, fixtures)
        began, until = clock.monotonic(), clock.Deadline.after(limit)
        while server.loading and not until.expired and not self._stop_now():
            self.reactor.run_once(until)
        self.loading_took = clock.monotonic() - began
        if server.usable:
            self._servers[plugin.path] = server
            return server
        self._uses[plugin.path] = 0
        overdue = server.loading and until.expired
        if overdue:
            server.process.dump_stacks()
        server.dismiss()
        if overdue:
            raise LoadTimeoutError(f"loading did not end within {until.limit:g} s", server.process.new_stacks())
        return None

    def rouse(self) -> None:
        """Continue the fork server and the plug-in servers, in case they were stopped by a signal."""
        if self._process is not None:
            self._process.resume()
            for server in self._servers.values():
                processes.signal_process(server.process.pid, signal.SIGCONT)

    def close(self, timeout: float = 30.0) -> None:
        """End the fork server with all that it still has; kill it if it does not end within ``timeout`` seconds.

        Nothing may be taken, or waited for, after that.
        """
        self._process, self._launched = self._process or self._launched, None
        self.rouse()
        if self._pool is not None:
            self._pool.disconnect()
        if self._process is not None:
            self._process.control.close()
            if processes.await_exit(self._process.keeper, timeout):
                self._process = None
        self.abandon()  # also closes the descriptors of the spare: every suite worker has a fork server
        self.reactor.close()

    def abandon(self) -> None:
        """Make the keeper end all that is left of a fork server that is lost or does not work, and forget it."""
        process, self._process = self._process, None
        pool, self._pool = self._pool, None
        if pool is not None:
            pool.disconnect()
        if process is not None:
            process.kill()
            if not processes.await_exit(process.keeper, _VANISH):
                processes.signal_process(process.keeper, signal.SIGKILL)  # something of it cannot be killed
                processes.await_exit(process.keeper, None)
        if pool is not None:
            pool.gone()  # and with it the plug-in servers
        self._servers.clear()
