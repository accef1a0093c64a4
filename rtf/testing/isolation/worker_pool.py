"""The runner's side of the fork server: it is started here, and each child it forks is fed, heard and ended here."""

from __future__ import annotations

import array
import contextlib
import os
import select
import signal
import socket
from collections import Counter, deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf import clock
from rtf.testing.isolation import fork_server_protocol as wire
from rtf.testing.isolation import processes
from rtf.testing.isolation.job import Job
from rtf.testing.isolation.launch import Launched, launch
from rtf.testing.isolation.stacks import StackFile
from rtf.testing.outcome import TestingError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from rtf.testing.isolation.reactor import Reactor
    from rtf.testing.plugins import PluginRef

#: A line longer than this is no event of ours; the child that sends it is ended.
LINE_LIMIT = 32 << 20
_CHUNK = 1 << 18
#: More than any pipe holds; yet a stray that could not be killed must not write for ever.
_LAST_CHUNKS = 64
_START_LIMIT = 60.0
_SEND_LIMIT = 5.0

#: Seconds before a child is listened to. Most tests are over by then and are heard as a whole; to be woken for each
#: thing they say would take them the processor for longer than they need it.
_LISTEN_DELAY = 0.002

#: Children kept ready by the fork server and by each template: one for the next test, one for the test after it,
#: because a test may be over before the next fork is.
_SPARES = 2
#: Files that are kept loaded at the same time, and how long loading one may take before each test loads it for itself.
_TEMPLATES = 4
_TEMPLATE_LIMIT = 10.0


class ForkServerLostError(TestingError, ConnectionError):
    """The fork server died or does not answer. A new one is started for the next test."""


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
    """A forked process of ours, from the moment it is handed out to the moment nothing of it is left."""

    def __init__(self, pool: WorkerPool, pid: int, events: int, out: int, err: int) -> None:
        self.pid = pid
        self.end: End | None = None
        self.channel_closed = False
        self.on_line: Callable[[bytes], None] | None = None
        self.on_output: Callable[[str, bytes], None] | None = None
        self.on_end: Callable[[], None] | None = None
        self._pool = pool
        self._reactor = pool.reactor
        self._buffer = b""
        self._events = events
        self._streams = {"stdout": out, "stderr": err}

    def begin(self, line: bytes, on_line: Callable[[bytes], None], on_output: Callable[[str, bytes], None]) -> None:
        """Give the child its job, and have its lines and output handed over as they come."""
        first = self.on_line is None
        self.on_line = on_line
        self.on_output = on_output
        if first:
            for descriptor in (self._events, *self._streams.values()):
                os.set_blocking(descriptor, False)
            self._reactor.call_later(_LISTEN_DELAY, self._listen)
        self.send(line)

    def _listen(self) -> None:
        reactor = self._reactor
        if not self.channel_closed:
            reactor.watch(self._events, self._read_events)
        for name, descriptor in self._streams.items():
            reactor.watch(descriptor, lambda name=name: self._read_output(name))  # type: ignore[misc]

    def become_template(self, message: bytes, on_output: Callable[[str, bytes], None]) -> socket.socket:
        """Have the child serve as a fork server; returns the socket on which it does."""
        self.send(message)
        self.on_output = on_output
        for name, descriptor in self._streams.items():
            os.set_blocking(descriptor, False)
            self._reactor.watch(descriptor, lambda name=name: self._read_output(name))  # type: ignore[misc]
        self.channel_closed = True  # for this class; it is another one's now
        return socket.socket(fileno=self._events)

    def dismiss(self) -> None:
        """Let a child that waits for another job end, and wait until it has."""
        self.signal(signal.SIGKILL, group=True)
        deadline = clock.Deadline.after(_SEND_LIMIT)
        while self.end is None and not deadline.expired:
            self._reactor.run_once(deadline)

    def drain(self) -> None:
        """Take in what has been written so far."""
        for name in [*self._streams]:
            self._read_output(name)

    def send(self, line: bytes) -> None:
        """Send one line to the child; nothing happens when it is gone, which its end will tell."""
        view = memoryview(line)
        while view and not self.channel_closed:
            try:
                view = view[os.write(self._events, view) :]
            except BlockingIOError:
                if not select.select([], [self._events], [], _SEND_LIMIT)[1]:
                    return
            except OSError:
                return

    def signal(self, signum: int, *, group: bool = False) -> None:
        """Send a signal to the child, or to its whole process group."""
        self._pool.request(wire.SIGNAL_GROUP if group else wire.SIGNAL, self.pid, signum)

    def mark_as_host(self) -> None:
        """Tell the fork server that this child tears something down, and is to be given time for it."""
        self._pool.request(wire.MARK_HOST, self.pid)

    def ended(self, end: End) -> None:
        """Take note of the end and of all that was still under way. Called by the fork server."""
        self._reactor.cancel(self._listen)
        self._read_events()
        for name in [*self._streams]:
            self._read_output(name, chunks=_LAST_CHUNKS)
        self._close_events()
        for name in [*self._streams]:
            self._close_stream(name)
        self.end = end
        if self.on_end is not None:
            self.on_end()

    def _read_events(self) -> None:
        while not self.channel_closed:
            try:
                data = os.read(self._events, _CHUNK)
            except BlockingIOError:
                return
            except OSError:
                data = b""
            if not data:
                self._close_events()
                return
            *lines, self._buffer = (self._buffer + data).split(b"\n") if self._buffer else data.split(b"\n")
            if self.on_line is not None:
                for line in lines:
                    self.on_line(line)
            if len(self._buffer) > LINE_LIMIT:
                if self.on_line is not None:
                    self.on_line(self._buffer[:1000])  # no event, which says why the channel is closed
                self._buffer = b""
                self._close_events()
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
            elif self.on_output is not None:
                self.on_output(name, data)

    def _close_events(self) -> None:
        if not self.channel_closed:
            self.channel_closed = True
            self._reactor.unwatch(self._events)
            os.close(self._events)

    def _close_stream(self, name: str) -> None:
        descriptor = self._streams.pop(name, None)
        if descriptor is not None:
            self._reactor.unwatch(descriptor)
            os.close(descriptor)


class WorkerPool:
    """The children of one forking process, as the runner sees them: those that are ready, and those that live."""

    def __init__(self, reactor: Reactor) -> None:
        self.reactor = reactor
        self._control: socket.socket | None = None
        self._buffer = b""
        self._descriptors: deque[int] = deque()
        self._ready: deque[Child] = deque()
        self._living: dict[int, Child] = {}

    def _attach(self, control: socket.socket) -> None:
        self._control = control
        self._buffer = b""
        self._descriptors.clear()
        self.reactor.watch(control.fileno(), self._receive)

    def _ask_for_spares(self) -> None:
        self._tell(wire.FORK_REQUEST * _SPARES)

    def _tell(self, message: bytes) -> None:
        """Send something; if the process is gone, its loss is noticed by whoever waits."""
        if self._control is not None:
            with contextlib.suppress(OSError):
                self._control.sendall(message)

    def _detach(self) -> None:
        if self._control is not None:
            self.reactor.unwatch(self._control.fileno())
            self._control.close()
            self._control = None
        for descriptor in self._descriptors:
            os.close(descriptor)
        self._descriptors.clear()

    def take(self) -> Child:
        """A fresh child, waiting for its job. Raises ForkServerLostError when none is to be had."""
        if not self._ready:
            self._await_spare()
        child = self._ready.popleft()
        self._living[child.pid] = child
        self._tell(wire.FORK_SPARE_REQUEST if self._ready else wire.FORK_REQUEST)
        return child

    def _await_spare(self) -> None:
        deadline = clock.Deadline.after(_START_LIMIT)
        while not self._ready:
            if self._control is None or deadline.expired:
                raise ForkServerLostError("the process from which tests are forked died or does not answer")
            self.reactor.run_once(deadline)

    def request(self, kind: bytes, pid: int, signum: int = 0) -> None:
        """Have the process do something to one of its children."""
        self._tell(wire.REQUEST.pack(kind, pid, signum))

    # What the process says ---------------------------------------------------------------------------------------

    def _receive(self) -> None:
        control = self._control
        if control is None:
            return
        try:
            data, ancillary, _, _ = control.recvmsg(65536, _ANCILLARY_SIZE, _FLAGS)
        except BlockingIOError:
            return
        except OSError:
            data, ancillary = b"", []
        for _, _, packed in ancillary:
            self._descriptors.extend(array.array("i", packed))
        if not data:
            self._lose()
            return
        if self._buffer:
            data = self._buffer + data
        position, size = 0, wire.REPORT.size
        while len(data) - position >= size:
            kind, pid, status, cpu, rss = wire.REPORT.unpack_from(data, position)
            text = b""
            if kind in _WITH_TEXT:
                if len(data) - position < size + pid:
                    break
                text = data[position + size : position + size + pid]
            position += size + len(text)
            if kind == wire.EXITED:
                self._exited(pid, End(status, cpu, rss))
            elif kind == wire.CHILD:
                descriptors = self._descriptors
                events, out, err = descriptors.popleft(), descriptors.popleft(), descriptors.popleft()
                self._ready.append(Child(self, pid, events, out, err))
            else:
                self._told(kind, text.decode("utf-8", "backslashreplace"))
        self._buffer = data[position:]

    def _exited(self, pid: int, end: End) -> None:
        child = self._living.pop(pid, None)
        if child is not None:
            child.ended(end)
            return
        for spare in [spare for spare in self._ready if spare.pid == pid]:
            self._ready.remove(spare)
            spare.ended(end)

    def _told(self, kind: bytes, text: str) -> None:
        """Take in what the process says of itself."""

    def _lose(self) -> None:
        """Take note that the process is gone."""
        raise NotImplementedError

    def children(self) -> list[Child]:
        """All that are alive."""
        return [*self._ready, *self._living.values()]

    def _forget_children(self) -> None:
        """None of them can be alive any more: say so to whoever waits."""
        children = self.children()
        self._ready.clear()
        self._living.clear()
        for child in children:
            child.ended(End(None))


_FLAGS = socket.MSG_CMSG_CLOEXEC | socket.MSG_DONTWAIT
_ANCILLARY_SIZE = socket.CMSG_SPACE(3 * 4 * 16)  # more children than are ever told of at once
_WITH_TEXT = (wire.READY, wire.UNFIT)


class Template(WorkerPool):
    """A child of the fork server that has loaded one file and forks the tests of that file. See ``fork_server``.

    ``fixtures`` are the generations that were up when the file was loaded: what it learnt from them holds as long.
    """

    def __init__(self, reactor: Reactor, child: Child, plugin: PluginRef, fixtures: Mapping[str, int]) -> None:
        super().__init__(reactor)
        self.fixtures = dict(fixtures)
        self._fit: bool | None = None
        self._child = child
        child.on_end = self._ended
        job = Job(kind="template", id="", name="", plugin=plugin, folder="", run_folder="")
        self._attach(child.become_template(job.to_message(), self._printed))

    @property
    def pid(self) -> int:
        """Its process."""
        return self._child.pid

    @property
    def usable(self) -> bool:
        """Whether tests can be forked from it."""
        return bool(self._fit) and self._control is not None

    def await_loaded(self, until: clock.Deadline, stop_now: Callable[[], bool]) -> None:
        """Wait for the file to be loaded; afterwards the template is usable, or gone."""
        while self._fit is None and self._control is not None and not until.expired and not stop_now():
            self.reactor.run_once(until)
        self._child.drain()
        if self.usable:
            self._ask_for_spares()
        else:
            self.dismiss()

    def dismiss(self) -> None:
        """End it, and wait until nothing of it is left."""
        self._fit = False
        self._child.dismiss()
        self._ended()

    def _printed(self, _stream: str, _data: bytes) -> None:
        self._fit = False  # what the file prints when it is loaded belongs to each test

    def _told(self, kind: bytes, _text: str) -> None:
        if self._fit is None:
            self._fit = kind == wire.READY

    def _lose(self) -> None:
        self._detach()

    def _ended(self) -> None:
        while self._control is not None and self._child.end is not None:
            self._receive()  # the last words; they end, because the process has
        self._detach()
        self._forget_children()


class ForkServerClient(WorkerPool):
    """Starts the fork server process, takes children from it, and starts another one when it is lost.

    ``uses`` says how many tests are planned for a plug-in file: one with several is loaded once, in a template.
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
        self._preload = " ".join(preload)
        self._uses = Counter(uses or {})
        self._launched = launched
        self._stop_now = stop_now
        self._templates: dict[str, Template] = {}
        self._process: Launched | None = None
        self._lost: list[str] = []  # the marks of fork servers that died
        self._stacks: StackFile | None = None

    def start(self) -> None:
        """Start the fork server process without waiting for it."""
        self._process, self._launched = self._launched or launch(), None
        self._close_stacks()
        self._stacks = StackFile(self._process.dump)
        self._attach(self._process.control)
        if self._preload:
            data = self._preload.encode()
            self._tell(wire.REQUEST.pack(wire.PRELOAD, len(data), 0) + data)
        self._ask_for_spares()

    def take(self, plugin: PluginRef | None = None, fixtures: Mapping[str, int] | None = None) -> Child:
        """A fresh child, waiting for its job. Raises ForkServerLostError when none is to be had.

        ``plugin`` is what a test will load and ``fixtures`` are the generations it will stand on: if a template is
        worth while and possible, the child is forked from it.
        """
        if self._process is None:
            self.start()
        try:
            if plugin is not None and plugin.language == "python":
                template = self._template_for(plugin, fixtures or {})
                if template is not None:
                    with contextlib.suppress(ForkServerLostError):  # the test loads it, then
                        return template.take()
            return super().take()
        except ForkServerLostError:
            self._lose()
            raise

    def _template_for(self, plugin: PluginRef, fixtures: Mapping[str, int]) -> Template | None:
        path = plugin.path
        template = self._templates.get(path)
        planned = self._uses[path]
        self._uses[path] = planned - 1
        if template is not None and (not template.usable or template.fixtures != fixtures):
            if template.usable:
                template.dismiss()
            else:
                self._uses[path] = planned = 0  # it has died under a test; that may happen once
            del self._templates[path]
            template = None
        if template is None and planned > 1:
            template = self._make_template(plugin, fixtures)
        return template

    def _make_template(self, plugin: PluginRef, fixtures: Mapping[str, int]) -> Template | None:
        for path in [path for path in self._templates if self._uses[path] <= 0]:
            self._templates.pop(path).dismiss()
        if len(self._templates) >= _TEMPLATES:
            return None
        template = Template(self.reactor, super().take(), plugin, fixtures)
        template.await_loaded(clock.Deadline.after(_TEMPLATE_LIMIT), self._stop_now)
        if not template.usable:
            self._uses[plugin.path] = 0
            return None
        self._templates[plugin.path] = template
        return template

    def dump_stacks(self, child: Child) -> None:
        """Have a child that runs a test dump its stacks, see :meth:`StackFile.dump`."""
        if self._stacks is not None:
            self._stacks.dump(child, self.reactor)

    def new_stacks(self) -> str:
        """What has been dumped since the last call, at most 256 KiB of it."""
        return self._stacks.new() if self._stacks is not None else ""

    def rouse(self) -> None:
        """Let the fork server and its templates go on, should somebody have stopped one."""
        if self._process is not None:
            for pid in (self._process.pid, *(template.pid for template in self._templates.values())):
                processes.signal_process(pid, signal.SIGCONT)

    def abandon(self) -> None:
        """Kill a fork server that does not do its work, and with it all of its children."""
        if self._process is not None:
            processes.signal_process(self._process.pid, signal.SIGCONT)
            processes.signal_group(self._process.pid, signal.SIGKILL)
        self._lose()

    def close(self, timeout: float = 30.0) -> None:
        """Let the fork server end, with all that it still has; kill it if it does not within ``timeout`` seconds."""
        process = self._process or self._launched
        self.rouse()
        self._detach()
        if process is not None:
            process.control.close()
            if _await_exit(process.pid, timeout):
                end_orphans(process.mark)  # somebody may have killed it before it had ended what tests left behind
                self._process = None
            else:
                self.abandon()
        for mark in self._lost:  # a process that was being started when its fork server died may show itself only later
            end_orphans(mark)
        self._forget_children()  # closes the descriptors of spares and templates: every suite worker has a fork server
        self._close_stacks()

    def _close_stacks(self) -> None:
        if self._stacks is not None:
            self._stacks.close()
            self._stacks = None

    def _told(self, kind: bytes, text: str) -> None:
        if kind == wire.READY:
            self.problems.extend(text.splitlines())

    def _lose(self) -> None:
        """The fork server is gone: its children are, too, by the kernel's hand; make sure, and take note."""
        self._detach()
        process = self._process
        if process is None:
            return
        processes.signal_group(process.pid, signal.SIGKILL)
        living = [child.pid for pool in (self, *self._templates.values()) for child in pool.children()]
        for pid in living:
            processes.signal_group(pid, signal.SIGKILL)
        _await_exit(process.pid, None)
        end_orphans(process.mark)
        self._lost.append(process.mark)
        self._templates.clear()
        self._forget_children()
        self._process = None


def _await_exit(pid: int, timeout: float | None) -> bool:
    """Wait for a child of this process to end, and reap it. False when it does not within ``timeout`` seconds."""
    pidfd = os.pidfd_open(pid)
    try:
        if not select.select([pidfd], [], [], timeout)[0]:
            return False
    finally:
        os.close(pidfd)
    os.waitpid(pid, 0)
    return True


def end_orphans(mark: str) -> None:
    """Kill the processes that carry ``mark`` in their environment and that this process, as subreaper, has inherited.

    The mark keeps other children of this process, which are none of our business, out of it. A child whose mark cannot
    be read at the moment is looked at again: it may be one of ours that dies, and leaves children of its own to us; for
    the same reason it is over only when looking twice shows no other children.
    """
    before: list[int] = []
    deadline = clock.Deadline.after(5.0)
    while not deadline.expired:
        children = processes.all_children_of(os.getpid())
        marked = [pid for pid in children if processes.carries(pid, mark)]
        if not marked:
            if any(processes.in_transit(pid) for pid in children):
                clock.sleep(0.001)
            elif children == before:
                return
            before = children
        for pid in marked:
            for below in [*processes.descendants_of(pid), pid]:
                processes.signal_process(below, signal.SIGKILL)
            with contextlib.suppress(ChildProcessError):
                os.waitpid(pid, 0)
