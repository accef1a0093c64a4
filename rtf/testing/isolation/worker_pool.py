"""The runner's side of the fork server: it is started here, and each child it forks is fed, heard and ended here."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import socket
from collections import Counter, deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf import clock
from rtf.testing.isolation import messages, processes
from rtf.testing.isolation.capture import StackFile
from rtf.testing.isolation.launch import Launched, launch
from rtf.testing.isolation.messages import Exited, Fork, Forked, Frames, Job, Loaded, MarkHost, MessageError, Preload
from rtf.testing.isolation.messages import Signal as SendSignal
from rtf.testing.outcome import TestingError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    import msgspec

    from rtf.testing.isolation.reactor import Reactor
    from rtf.testing.plugins import PluginRef

_CHUNK = 1 << 18
#: More than any pipe holds; yet a stray that could not be killed must not write for ever.
_LAST_CHUNKS = 64
_QUOTED = 1000
_START_LIMIT = 60.0
_SEND_LIMIT = 5.0
_VANISH = 5.0

#: Seconds before a child is listened to. Most tests are over by then and are heard as a whole; to be woken for each
#: thing they say would take them the processor for longer than they need it.
_LISTEN_DELAY = 0.002
#: Plug-in servers that are kept at the same time.
_PLUGIN_SERVERS = 4


class ForkServerLostError(TestingError, ConnectionError):
    """The fork server died or does not answer. A new one is started for the next test."""


class LoadTimeoutError(TestingError, TimeoutError):
    """The file that several tests share was not loaded within the time of the first."""


@dataclass(frozen=True, slots=True)
class End:
    """How a child process ended. ``status`` as from ``wait``; None where the fork server was lost with the child."""

    status: int | None
    cpu_time: float = 0.0
    max_rss: int = 0

    @property
    def exit_status(self) -> int | None:
        """The exit status, or None for a signal."""
        return None if self.status is None else processes.split_status(self.status)[0]

    @property
    def signal(self) -> str:
        """The signal that ended it, or nothing."""
        return "" if self.status is None else processes.split_status(self.status)[1]


class Child:
    """A forked process of ours, from the moment it is asked for to the moment nothing of it is left."""

    def __init__(self, pool: WorkerPool, channel: int, out: int, err: int) -> None:
        self.pid = 0  # until it is forked
        self.end: End | None = None
        self.channel_closed = False
        #: Whether it has written what is no message; nothing can be understood after that.
        self.garbled = False
        #: The tests that it has done, where it does several.
        self.done: set[str] = set()
        self.on_end: Callable[[], None] | None = None
        self._on_message: Callable[[bytes], None] | None = None
        self._on_output: Callable[[str, bytes], None] | None = None
        self._pool = pool
        self._reactor = pool.reactor
        self._frames = Frames()
        self._channel = channel
        self._streams = {"stdout": out, "stderr": err}
        for descriptor in (channel, out, err):
            os.set_blocking(descriptor, False)

    def begin(self, job: Job, on_message: Callable[[bytes], None], on_output: Callable[[str, bytes], None]) -> None:
        """Give the child its job, and have its messages and its output handed over as they come."""
        first = self._on_message is None
        self._on_message = on_message
        self._on_output = on_output
        if first:
            self._reactor.call_later(_LISTEN_DELAY, self._listen)
        self.send(job)

    def _listen(self) -> None:
        if not self.channel_closed:
            self._reactor.watch(self._channel, self._read_channel)
        for name, descriptor in self._streams.items():
            self._reactor.watch(descriptor, lambda name=name: self._read_output(name))  # type: ignore[misc]

    def serve_plugin(self, job: Job, on_output: Callable[[str, bytes], None]) -> socket.socket:
        """Have the child be a plug-in server; returns the socket on which it takes requests."""
        self.send(job)
        self._on_output = on_output
        self.channel_closed = True  # it is the server's now
        self._listen()
        os.set_blocking(self._channel, True)
        return socket.socket(fileno=self._channel)

    def dismiss(self) -> None:
        """Kill a child, and wait until it is gone."""
        self.signal(signal.SIGKILL, group=True)
        deadline = clock.Deadline.after(_VANISH)
        while self.end is None and not deadline.expired:
            self._reactor.run_once(deadline)

    def drain(self) -> None:
        """Take in what has been written so far."""
        for name in [*self._streams]:
            self._read_output(name)

    def send(self, message: msgspec.Struct) -> None:
        """Send a message to the child; nothing happens when it is gone, which its end will tell."""
        view = memoryview(messages.pack(message))
        while view and not self.channel_closed:
            try:
                view = view[os.write(self._channel, view) :]
            except BlockingIOError:
                if not select.select([], [self._channel], [], _SEND_LIMIT)[1]:
                    return
            except OSError:
                return

    def signal(self, signum: int, *, group: bool = False) -> None:
        """Send a signal to the child, or to its whole process group."""
        self._pool.request(SendSignal(self.pid, signum, group))

    def mark_as_host(self) -> None:
        """Tell the fork server that this child tears something down, and is to be given time for it."""
        self._pool.request(MarkHost(self.pid))

    def ended(self, end: End) -> None:
        """Take note of the end and of all that was still under way. Called by the pool."""
        self._reactor.cancel(self._listen)
        self._read_channel()
        for name in [*self._streams]:
            self._read_output(name, chunks=_LAST_CHUNKS)
        self._close_channel()
        for name in [*self._streams]:
            self._close_stream(name)
        self.end = end
        if self.on_end is not None:
            self.on_end()

    def _read_channel(self) -> None:
        while not self.channel_closed:
            try:
                data = os.read(self._channel, _CHUNK)
            except BlockingIOError:
                return
            except OSError:
                data = b""
            if not data:
                self._close_channel()
                return
            try:
                for frame in self._frames.feed(data):
                    if self._on_message is not None:
                        self._on_message(frame)
            except MessageError as error:
                self.garbled = True
                if self._on_message is not None:
                    self._on_message(str(error).encode()[:_QUOTED])
                self._close_channel()
            if len(data) < _CHUNK:
                return

    def _read_output(self, name: str, chunks: int = 1) -> None:
        # One chunk a turn: a child that floods its output must not keep the runner from its deadlines.
        for _ in range(chunks):
            if name not in self._streams:
                return
            try:
                data = os.read(self._streams[name], _CHUNK)
            except BlockingIOError:
                return
            if not data:
                self._close_stream(name)
            elif self._on_output is not None:
                self._on_output(name, data)

    def _close_channel(self) -> None:
        if not self.channel_closed:
            self.channel_closed = True
            self._reactor.unwatch(self._channel)
            os.close(self._channel)

    def _close_stream(self, name: str) -> None:
        descriptor = self._streams.pop(name, None)
        if descriptor is not None:
            self._reactor.unwatch(descriptor)
            os.close(descriptor)


class WorkerPool:
    """The children of one forking process, as the runner sees them. One is always asked for ahead of its need."""

    def __init__(self, reactor: Reactor) -> None:
        self.reactor = reactor
        self._control: socket.socket | None = None
        self._frames = Frames()
        self._asked_for: deque[Child] = deque()
        self._living: dict[int, Child] = {}
        self._spare: Child | None = None

    def _attach(self, control: socket.socket) -> None:
        self._control = control
        self._frames = Frames()
        self.reactor.watch(control.fileno(), self._receive)

    def _detach(self) -> None:
        if self._control is not None:
            self.reactor.unwatch(self._control.fileno())
            self._control.close()
            self._control = None

    def request(self, message: msgspec.Struct, *descriptors: int) -> None:
        """Have the process do something; if it is gone, its loss is noticed by whoever waits."""
        if self._control is not None:
            with contextlib.suppress(OSError):
                data = messages.pack(message)
                if descriptors:
                    socket.send_fds(self._control, [data], descriptors)
                else:
                    self._control.sendall(data)

    def take(self) -> Child:
        """A fresh child, waiting for its job. Raises ForkServerLostError when none is to be had."""
        child = self._spare if self._spare is not None and self._spare.end is None else self._fork()
        self._spare = None
        deadline = clock.Deadline.after(_START_LIMIT)
        while not child.pid:
            if self._control is None or deadline.expired:
                raise ForkServerLostError("the process from which tests are forked died or does not answer")
            self.reactor.run_once(deadline)
        self._spare = self._fork()
        return child

    def _fork(self) -> Child:
        here, there = socket.socketpair()
        out_read, out_write = os.pipe()
        err_read, err_write = os.pipe()
        child = Child(self, here.detach(), out_read, err_read)
        self._asked_for.append(child)
        self.request(Fork(), there.fileno(), out_write, err_write)
        there.close()
        os.close(out_write)
        os.close(err_write)
        return child

    def _receive(self) -> bool:
        """Take in what the process has said; returns whether there may be more."""
        if self._control is None:
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
        except ValueError:  # somebody else has written to it
            data = b""
        if not data:
            self._lose()
        return bool(data)

    def _take_in(self, message: Forked | Exited | Loaded) -> None:
        if isinstance(message, Forked):
            child = self._asked_for.popleft()
            child.pid = message.pid
            self._living[message.pid] = child
        elif isinstance(message, Exited):
            self._living.pop(message.pid).ended(End(message.status, message.cpu_time, message.max_rss))
        else:
            self._loaded(message)

    def _loaded(self, message: Loaded) -> None:
        """Take in what the process has loaded."""

    def _lose(self) -> None:
        """Take note that the process is gone."""
        raise NotImplementedError

    def _forget_children(self) -> None:
        """None of them can be alive any more."""
        children = [*self._asked_for, *self._living.values()]
        self._asked_for.clear()
        self._living.clear()
        self._spare = None
        for child in children:
            child.ended(End(None))


class PluginServer(WorkerPool):
    """A child of the fork server that has loaded one file and forks the tests of that file. See ``fork_server``.

    ``fixtures`` are the generations that were up when the file was loaded: what it learnt from them holds as long.
    """

    def __init__(self, reactor: Reactor, child: Child, plugin: PluginRef, fixtures: Mapping[str, int]) -> None:
        super().__init__(reactor)
        self.fixtures = dict(fixtures)
        self.process = child
        self._fit: bool | None = None
        child.on_end = self.gone
        job = Job(kind="plugin server", id="", name="", plugin=plugin, folder="", run_folder="")
        self._attach(child.serve_plugin(job, self._printed))

    @property
    def loading(self) -> bool:
        """Whether the file is still being loaded."""
        return self._fit is None and self._control is not None

    @property
    def usable(self) -> bool:
        """Whether tests can be forked from it."""
        return bool(self._fit) and self._control is not None

    def dismiss(self) -> None:
        """End it, and wait until nothing of it is left."""
        self._fit = False
        self.process.dismiss()
        self.gone()

    def _printed(self, _stream: str, _data: bytes) -> None:
        self._fit = False  # what the file prints when it is loaded belongs to each test

    def _loaded(self, message: Loaded) -> None:
        self.process.drain()
        if self._fit is None:
            self._fit = not message.problems

    def _lose(self) -> None:
        self._detach()

    def gone(self) -> None:
        """Its process has ended, and so has everything that it forked."""
        while self._receive():
            pass
        self._detach()
        self._forget_children()


class ForkServerClient(WorkerPool):
    """Starts the fork server process, takes children from it, and starts another one when it is lost.

    ``uses`` says how many tests are planned for a plug-in file: one with several is loaded once, in a plug-in server.
    ``launched`` is a process that was started before there was anything to say to it.
    """

    def __init__(
        self,
        reactor: Reactor,
        *,
        preload: Iterable[str] = (),
        uses: Mapping[str, int] | None = None,
        launched: Launched | None = None,
        stop_now: Callable[[], bool] = lambda: False,
    ) -> None:
        super().__init__(reactor)
        self.problems: list[str] = []
        self.loading_took = 0.0
        self._preload = tuple(preload)
        self._uses = Counter(uses or {})
        self._launched = launched
        self._stop_now = stop_now
        self._servers: dict[str, PluginServer] = {}
        self._process: Launched | None = None
        self._stacks: StackFile | None = None

    def start(self) -> None:
        """Start the fork server process without waiting for it."""
        self._process, self._launched = self._launched or launch(), None
        self._close_stacks()
        self._stacks = StackFile(self._process.dump)
        self._attach(self._process.control)
        if self._preload:
            self.request(Preload(self._preload))
        self._spare = self._fork()

    def take(
        self,
        plugin: PluginRef | None = None,
        fixtures: Mapping[str, int] | None = None,
        limit: float | None = None,
    ) -> Child:
        """A fresh child, waiting for its job. Raises ForkServerLostError when none is to be had.

        ``plugin`` is what a test will load and ``fixtures`` are the generations it will stand on: where several tests
        share the file, the child comes from a plug-in server. Raises LoadTimeoutError when that has not loaded the file
        within ``limit`` seconds; after that, each test loads it for itself. ``loading_took`` says how long it took.
        """
        self.loading_took = 0.0
        if self._process is None:
            self.start()
        try:
            if plugin is not None and plugin.language == "python":
                server = self._server_for(plugin, fixtures or {}, limit)
                if server is not None:
                    with contextlib.suppress(ForkServerLostError):  # the test loads it, then
                        return server.take()
            return super().take()
        except ForkServerLostError:
            self._lose()
            raise

    def _server_for(self, plugin: PluginRef, fixtures: Mapping[str, int], limit: float | None) -> PluginServer | None:
        path = plugin.path
        server = self._servers.get(path)
        planned = self._uses[path]
        self._uses[path] = planned - 1
        if server is not None and (not server.usable or server.fixtures != fixtures):
            if not server.usable:
                self._uses[path] = planned = 0  # it has died under a test; that may happen once
            self._servers.pop(path).dismiss()
            server = None
        if server is None and planned > 1:
            server = self._make_server(plugin, fixtures, limit)
        return server

    def _make_server(self, plugin: PluginRef, fixtures: Mapping[str, int], limit: float | None) -> PluginServer | None:
        for path in [path for path in self._servers if self._uses[path] <= 0]:
            self._servers.pop(path).dismiss()
        if len(self._servers) >= _PLUGIN_SERVERS:
            return None
        server = PluginServer(self.reactor, super().take(), plugin, fixtures)
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
            self.dump_stacks(server.process)
        server.dismiss()
        if overdue:
            raise LoadTimeoutError(f"loading did not end within {until.limit:g} s")
        return None

    def dump_stacks(self, child: Child) -> None:
        """Have a child that runs a test dump its stacks, see :meth:`StackFile.dump`."""
        if self._stacks is not None:
            self._stacks.dump(child, self.reactor)

    def new_stacks(self) -> str:
        """What has been dumped since the last call, at most 256 KiB of it."""
        return self._stacks.new() if self._stacks is not None else ""

    def rouse(self) -> None:
        """Let the fork server and the plug-in servers go on, should somebody have stopped one."""
        if self._process is not None:
            self._process.resume()
            for server in self._servers.values():
                processes.signal_process(server.process.pid, signal.SIGCONT)

    def abandon(self) -> None:
        """Kill a fork server that does not do its work, and with it all of its children."""
        self._lose()

    def close(self, timeout: float = 30.0) -> None:
        """Let the fork server end, with all that it still has; kill it if it does not within ``timeout`` seconds."""
        process = self._process or self._launched
        self.rouse()
        self._detach()
        if process is not None:
            process.control.close()
            if processes.await_exit(process.keeper, timeout):
                self._process = None
            else:
                self._lose()
        self._forget_servers()
        self._forget_children()  # closes the descriptors of the spare: every suite worker has a fork server
        self._close_stacks()

    def _close_stacks(self) -> None:
        if self._stacks is not None:
            self._stacks.close()
            self._stacks = None

    def _loaded(self, message: Loaded) -> None:
        self.problems.extend(message.problems)

    def _lose(self) -> None:
        """The fork server is gone, or is to be: have its keeper end all that is left, and take note."""
        self._detach()
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            if not processes.await_exit(process.keeper, _VANISH):
                processes.signal_process(process.keeper, signal.SIGKILL)  # something of it cannot be killed
                processes.await_exit(process.keeper, None)
        self._forget_servers()
        self._forget_children()

    def _forget_servers(self) -> None:
        for server in self._servers.values():
            server.gone()
        self._servers.clear()
