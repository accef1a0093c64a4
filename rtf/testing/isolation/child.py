"""The runner's side of a forked process: it gets a job, is read, interrupted and killed.

A child belongs to a :class:`Pool`, and to the thread of that. It has a channel for messages, its two output streams,
and a file for the stacks of its threads.
"""

from __future__ import annotations

import os
import select
import signal
import socket
import threading
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from rtf import clock
from rtf.testing.isolation import messages, processes
from rtf.testing.isolation.messages import DUMP_SIGNAL, NUDGE_PERIOD, NUDGE_SIGNAL, Frames, Inspect, Job, MessageError
from rtf.testing.isolation.messages import Signal as SendSignal

if TYPE_CHECKING:
    from collections.abc import Callable

    import msgspec

    from rtf.testing.isolation.reactor import Reactor

_CHUNK = 1 << 18
#: More than any pipe holds; yet a process that could not be killed must not write for ever.
_LAST_CHUNKS = 64
_QUOTED = 1000
_SEND_LIMIT = 5.0
#: Seconds after which a process that was killed must be gone, and after which one that closed its channel is not dying.
_VANISH = 5.0
_DYING = 2.0
#: At most so many bytes of stacks are kept.
_STACKS_KEPT = 1 << 18
#: Stacks that have not grown for so many seconds are complete; and so long is waited for them at most.
_SETTLED = 0.02
_PATIENCE = 1.0


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


class Pool(Protocol):
    """The process that forks children, from the runner's side; see :mod:`~rtf.testing.isolation.worker_pool`."""

    reactor: Reactor

    def request(self, message: msgspec.Struct, *descriptors: int) -> None: ...
    def rouse(self) -> None: ...
    def abandon(self) -> None: ...


class Child:
    """A process forked by the fork server, from the request for it until nothing of it is left."""

    def __init__(self, pool: Pool) -> None:
        self.pid = 0  # until it is forked
        self.end: End | None = None
        self.channel_closed = False
        #: Whether it lives on without a channel: one that dies closes it a moment before its end is known.
        self.cut_off = False
        #: Whether it has written bytes that are no message; nothing can be decoded after that.
        self.garbled = False
        #: The tests that it has done, if it does several.
        self.done: set[str] = set()
        self.on_end: Callable[[], None] | None = None
        self._on_message: Callable[[bytes], None] | None = None
        self._on_output: Callable[[str, bytes], None] | None = None
        self._pool = pool
        self._reactor = pool.reactor
        self._frames = Frames()
        self._sending = threading.Lock()  # any thread may send an answer, while the channel is being closed
        here, there = socket.socketpair()
        out, its_out = os.pipe()
        err, its_err = os.pipe()
        self._channel = here.detach()
        self._streams = {"stdout": out, "stderr": err}
        self._stacks = os.memfd_create("rtf-stacks", os.MFD_CLOEXEC)  # readable when the process has died
        self._stacks_read = 0
        self._stacks_unread = b""
        for descriptor in (self._channel, out, err):
            os.set_blocking(descriptor, False)
        pool.request(messages.Fork(), there.fileno(), its_out, its_err, self._stacks)
        there.close()
        os.close(its_out)
        os.close(its_err)

    # Work --------------------------------------------------------------------------------------------------------

    def begin(
        self, job: Job | Inspect, on_message: Callable[[bytes], None], on_output: Callable[[str, bytes], None]
    ) -> None:
        """Give the child its job, and have its messages and its output handed over as they come."""
        first = self._on_message is None
        self._on_message = on_message
        self._on_output = on_output
        if first:
            self._listen()
        self.send(job)

    def _listen(self) -> None:
        if not self.channel_closed:
            self._reactor.watch(self._channel, self._read_channel)
        for name, descriptor in self._streams.items():
            self._reactor.watch(descriptor, lambda name=name: self._read_output(name))  # type: ignore[misc]

    def serve_plugin(self, job: Job, on_output: Callable[[str, bytes], None]) -> socket.socket:
        """Make the child a plug-in server; returns the socket on which it takes requests."""
        self.send(job)
        self._on_output = on_output
        self.channel_closed = True  # it is the server's now
        self._listen()
        os.set_blocking(self._channel, True)
        return socket.socket(fileno=self._channel)

    def send(self, message: msgspec.Struct) -> None:
        """Send a message to the child. If the child is gone, nothing happens; the reactor reports its end."""
        view = memoryview(messages.pack(message))
        with self._sending:
            while view and not self.channel_closed:
                try:
                    view = view[os.write(self._channel, view) :]
                except BlockingIOError:
                    if not select.select([], [self._channel], [], _SEND_LIMIT)[1]:
                        return
                except OSError:
                    return

    def mark_as_host(self) -> None:
        """Tell the fork server that this child tears a fixture down, and needs time for it."""
        self._pool.request(messages.MarkHost(self.pid))

    # Being stopped -----------------------------------------------------------------------------------------------

    def signal(self, signum: int, *, group: bool = False) -> None:
        """Send a signal to the child, or to its whole process group, by a fork server that may have been stopped."""
        self._pool.rouse()
        self._pool.request(SendSignal(self.pid, signum, group))

    def interrupt(self, signum: int) -> None:
        """Send the child a signal to leave its current step, and nudge it until :meth:`stop_nudging` or its end."""
        self.signal(signal.SIGCONT)
        self.signal(signum)
        self._call_later(NUDGE_PERIOD, self._nudge)

    def _nudge(self) -> None:
        self.signal(NUDGE_SIGNAL)
        self._call_later(NUDGE_PERIOD, self._nudge)

    def stop_nudging(self) -> None:
        """Stop nudging, because the child has left its step."""
        self._reactor.cancel(self._nudge)

    def kill(self) -> None:
        """Kill the child and its process group; if it does not end in time, kill the fork server with all children."""
        self.stop_nudging()
        self.signal(signal.SIGKILL, group=True)
        self._call_later(_VANISH, self._give_up)

    def _call_later(self, seconds: float, callback: Callable[[], None]) -> None:
        if self.end is None:
            self._reactor.call_later(seconds, callback)

    def _give_up(self) -> None:
        self._pool.abandon()

    def dismiss(self) -> None:
        """Kill the child, and wait until it is gone."""
        self.kill()
        while self.end is None:
            self._reactor.run_once(clock.Deadline())

    def dump_stacks(self) -> str:
        """Make a child that takes too long write its stacks; returns its state in the kernel before.

        A stopped child is woken. The wait is a second at most. Nothing else may be asked of the child meanwhile: the
        dump reads the frames of running threads, and a thread that leaves its frames at that moment, because it was
        told to stop, crashes the process.
        """
        state = processes.kernel_state(self.pid)
        self.signal(signal.SIGCONT)
        self._read_stacks()
        before = size = self._stacks_read
        patience = clock.Deadline.after(_PATIENCE)
        self.signal(DUMP_SIGNAL)
        while not patience.expired and self.end is None:
            pause = clock.Deadline.after(_SETTLED)
            while not pause.expired:
                self._reactor.run_once(pause)
            self._read_stacks()
            last, size = size, self._stacks_read
            if before < size == last:
                break
        return state

    def new_stacks(self) -> str:
        """Return the stacks written since the last call, also by a crash; at most 256 KiB of each dump."""
        self._read_stacks()
        data, self._stacks_unread = self._stacks_unread, b""
        return data.decode("utf-8", "backslashreplace")

    def _read_stacks(self) -> None:
        if self.end is None:  # afterwards they have been read, and the file is closed
            size = os.fstat(self._stacks).st_size
            wanted = min(size - self._stacks_read, _STACKS_KEPT)
            self._stacks_unread += os.pread(self._stacks, wanted, self._stacks_read)
            self._stacks_read = size

    # Reading -----------------------------------------------------------------------------------------------------

    def drain(self) -> None:
        """Read the output that has been written so far."""
        for name in [*self._streams]:
            self._read_output(name)

    def ended(self, end: End) -> None:
        """Record the end, and read what was still under way. Called by the pool."""
        self._read_channel()
        for name in [*self._streams]:
            self._read_output(name, chunks=_LAST_CHUNKS)
        self._close_channel()
        for name in [*self._streams]:
            self._close_stream(name)
        self._read_stacks()
        os.close(self._stacks)
        for timer in (self._nudge, self._give_up, self._note_cut_off):
            self._reactor.cancel(timer)
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
            with self._sending:
                self.channel_closed = True
                self._reactor.unwatch(self._channel)
                os.close(self._channel)
            self._call_later(_DYING, self._note_cut_off)

    def _note_cut_off(self) -> None:
        self.cut_off = True

    def _close_stream(self, name: str) -> None:
        descriptor = self._streams.pop(name, None)
        if descriptor is not None:
            self._reactor.unwatch(descriptor)
            os.close(descriptor)
