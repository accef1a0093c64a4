"""The programs that a node has started: watched by one thread, which sleeps while nothing happens.

A child is the leader of a session of its own. Its tag runs as long as any process of the child does: its group, and
those that left it with its mark (:mod:`rtf.applications.run.members`). Until then the leader is not reaped, so that no
other group can get its number and be sent its signals.
"""

from __future__ import annotations

import contextlib
import os
import selectors
import signal
import subprocess
import threading
from collections import deque
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Protocol

import msgspec

from rtf import clock
from rtf.applications.run.errors import StartError
from rtf.applications.run.members import HELD_MARK, MARK, lives, look_at, members
from rtf.applications.run.output import Tail
from rtf.testing.isolation import processes

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from rtf.applications.run.members import ProcessState

_CHUNK = 1 << 16
#: What may be unread in a pipe when its program has ended.
_PIPE = 1 << 20
#: Seconds between two looks at processes whose leader has ended.
_LOOK = 0.25
_VANISH = 5.0
_SHOWN_LINES = 5


class Sink(Protocol):
    """Takes the output of a child, in the thread that watches, which must not wait."""

    def feed(self, data: bytes) -> None:
        """Take what was read."""

    def close(self) -> None:
        """Take note that nothing follows."""


@dataclass(frozen=True, slots=True)
class Launch:
    """How a program is started. ``program`` is the file; ``command`` and ``environment`` are for the list of programs.

    ``hold``: it outlives the node. ``log`` is the port of the logger, if there is one, for a child that is found again.
    """

    tag: str
    command: str
    program: str
    words: Sequence[str]
    variables: Mapping[str, str]
    directory: str | None = None
    environment: str = ""
    hold: bool = False
    log: str | None = None


class HeldChild(msgspec.Struct, frozen=True):
    """A held child as its node records it. ``started`` distinguishes it from a later process of its id."""

    pid: int
    started: int
    mark: str
    tag: str
    command: str
    environment: str
    log: str | None


class Child:
    """A program and all its processes. ``sinks`` take its output, besides its tail."""

    def __init__(self, launch: Launch, number: int, pid: int, mark: str, pipe: int) -> None:
        self.launch = launch
        self.number = number
        self.pid = pid
        self.mark = mark
        self.pipe = pipe
        self.tail = Tail()
        self.sinks: list[Sink] = []
        self.process: subprocess.Popen[bytes] | None = None
        self.pidfd = -1
        self.leader_ended = False
        self.left: Sequence[ProcessState] = ()  # known processes, when the leader has ended
        self.ended = threading.Event()
        self.how = ""


class Children:
    """Starts, lists, signals and ends children. ``said`` gets a sentence for each that ends; any thread.

    ``ended`` gets a child that has ended, while it is still listed.
    """

    def __init__(
        self,
        token: str,
        *,
        most: int,
        said: Callable[[str], None],
        changed: Callable[[Iterable[Child]], None] = lambda _: None,
        ended: Callable[[Child], None] = lambda _: None,
    ) -> None:
        self._token = token
        self._most = most
        self._said = said
        self._held_changed = changed
        self._note_ended = ended
        self._lock = threading.RLock()
        self._children: dict[int, Child] = {}  # by number
        self._without_leader: list[Child] = []  # changed by the thread alone
        self._count = 0
        self._closing = False
        self._selector = selectors.DefaultSelector()
        self._todo: deque[Callable[[], None]] = deque()
        self._bell = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
        self._selector.register(self._bell, selectors.EVENT_READ, self._answer_bell)
        self._over = False
        self._thread = threading.Thread(target=self._watch, name="rtf-run-children", daemon=True)
        self._thread.start()

    # Starting ----------------------------------------------------------------------------------------------------

    def start(
        self,
        launch: Launch,
        sinks: Callable[[Child], Iterable[Sink]] = lambda _: (),
        stdin: int = subprocess.DEVNULL,
    ) -> Child:
        """Start a program. ``sinks`` makes what takes its output, besides its tail. Raises StartError."""
        with self._lock:
            if self._closing:
                raise StartError("the node ends")
            if len(self._children) >= self._most:
                raise StartError(f"{self._most} programs run already, which is the limit of this node")
            self._count += 1
            number = self._count
            mark = f"{HELD_MARK if launch.hold else MARK}={self._token}-{number}"
            child = self._spawn(launch, number, mark, stdin)
            child.sinks += sinks(child)
            self._children[number] = child
            self._do(partial(self._add, child))
            if launch.hold:
                self._held_changed(self._held())
        return child

    def _spawn(self, launch: Launch, number: int, mark: str, stdin: int) -> Child:
        ours, theirs = _pipe(held=launch.hold)
        name, _, value = mark.partition("=")
        others = {key: text for key, text in launch.variables.items() if key not in (MARK, HELD_MARK)}
        try:
            process = subprocess.Popen(
                launch.words,
                executable=launch.program,
                stdin=stdin,
                stdout=theirs if launch.log is not None or not launch.hold else subprocess.DEVNULL,
                stderr=subprocess.STDOUT,
                env={**others, name: value},
                cwd=launch.directory,
                start_new_session=True,
            )
        except (OSError, ValueError) as error:
            os.close(ours)
            raise StartError(getattr(error, "strerror", None) or str(error)) from None
        finally:
            os.close(theirs)
        child = Child(launch, number, process.pid, mark, ours)
        child.process = process
        child.pidfd = os.pidfd_open(process.pid)
        return child

    def adopt(self, found: HeldChild, sinks: Callable[[Child], Iterable[Sink]]) -> Child | None:
        """Watch a child that an earlier node has left; None if it is gone."""
        state = look_at(found.pid)
        if state is None or state.zombie or state.started != found.started:
            return None
        pipe = -1
        with contextlib.suppress(OSError):  # it has closed its output, or ends at this moment
            if found.log is not None:
                pipe = os.open(f"/proc/{found.pid}/fd/1", os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with self._lock:
            self._count += 1
            launch = Launch(found.tag, found.command, "", (), {}, None, found.environment, hold=True, log=found.log)
            child = Child(launch, self._count, found.pid, found.mark, pipe)
            try:
                child.pidfd = os.pidfd_open(found.pid)
            except ProcessLookupError:
                if pipe >= 0:
                    os.close(pipe)
                return None
            child.sinks += sinks(child)
            self._children[child.number] = child
            self._do(partial(self._add, child))
        return child

    # Asking ------------------------------------------------------------------------------------------------------

    def running(self) -> Sequence[Child]:
        """Return the children that run, in the order of their starts."""
        with self._lock:
            return [*self._children.values()]

    def find(self, tag: str) -> Sequence[Child]:
        """Return the children of a tag; several may have the same."""
        return [child for child in self.running() if child.launch.tag == tag]

    def signal(self, children: Iterable[Child], *signals: int) -> None:
        """Send signals to all processes of children."""
        with self._lock:
            whole = [child for child in children if child.number in self._children]
            for child in whole:
                if not child.leader_ended:
                    for signum in signals:
                        processes.signal_group(child.pid, signum)
            # Looked at afterwards: what leaves its group at this moment is in the group before, or found now.
            found = members([(child.pid, child.mark) for child in whole])
            for child in whole:
                for process in found[child.pid]:
                    if child.leader_ended or process.group != child.pid:
                        for signum in signals:
                            processes.signal_process(process.pid, signum)

    # Ending ------------------------------------------------------------------------------------------------------

    def close(self, grace: float) -> None:
        """End all children that are not held: SIGTERM, SIGKILL after ``grace`` seconds. Held ones are left alone."""
        with self._lock:
            self._closing = True
        ending = [child for child in self.running() if not child.launch.hold]
        if ending:
            self._end(ending, grace)
        self._do(self._stop)
        self._thread.join(_VANISH)
        with self._lock:
            for child in self._children.values():
                self._let_go(child)
            self._children.clear()
        self._selector.close()
        os.close(self._bell)

    def _end(self, ending: Sequence[Child], grace: float) -> None:
        deadline = clock.Deadline.after(grace)
        self.signal(ending, signal.SIGTERM, signal.SIGCONT)
        for child in ending:
            child.ended.wait(deadline.remaining())
        left = [child for child in ending if not child.ended.is_set()]
        if left:
            self._said(f"{', '.join(child.launch.tag for child in left)}: did not end within {grace:g} s; killed")
        deadline = clock.Deadline.after(_VANISH)
        while left and not deadline.expired:
            self.signal(left, signal.SIGKILL)
            left[0].ended.wait(2 * _LOOK)
            left = [child for child in ending if not child.ended.is_set()]

    def _let_go(self, child: Child) -> None:
        if child.process is not None:
            child.process.returncode = 0  # it is not ours to wait for any more
        self._close_descriptors(child)
        for sink in child.sinks:
            sink.close()

    # The thread --------------------------------------------------------------------------------------------------

    def _do(self, work: Callable[[], None]) -> None:
        self._todo.append(work)
        with contextlib.suppress(OSError):  # closed
            os.eventfd_write(self._bell, 1)

    def _answer_bell(self) -> None:
        os.eventfd_read(self._bell)
        while self._todo:
            self._todo.popleft()()

    def _stop(self) -> None:
        self._over = True

    def _watch(self) -> None:
        while not self._over:
            for key, _ in self._selector.select(_LOOK if self._without_leader else None):
                key.data()
            if self._without_leader:
                self._finish_empty()

    def _add(self, child: Child) -> None:
        self._selector.register(child.pidfd, selectors.EVENT_READ, partial(self._note_end, child))
        if child.pipe >= 0:
            os.set_blocking(child.pipe, False)
            self._selector.register(child.pipe, selectors.EVENT_READ, partial(self._read, child))

    def _read(self, child: Child) -> bool:
        """Read once, so that one child cannot keep the thread from the others. False if there is nothing to read."""
        if child.pipe < 0:
            return False
        try:
            data = os.read(child.pipe, _CHUNK)
        except BlockingIOError:
            return False
        if not data:
            self._selector.unregister(child.pipe)
            os.close(child.pipe)
            child.pipe = -1
            return False
        child.tail.feed(data)
        for sink in child.sinks:
            sink.feed(data)
        return True

    def _note_end(self, child: Child) -> None:
        """Look how the leader ended, without reaping it."""
        self._selector.unregister(child.pidfd)
        if child.process is not None:
            result = os.waitid(os.P_PIDFD, child.pidfd, os.WEXITED | os.WNOWAIT)
            assert result is not None
            exited = result.si_code == os.CLD_EXITED
            status = result.si_status
            child.how = processes.describe_end(status, "" if exited else processes.signal_name(status))
        else:
            child.how = "its exit status is not known, as it was started by an earlier node"
        with self._lock:
            child.leader_ended = True
        self._without_leader.append(child)

    def _finish_empty(self) -> None:
        """Finish the children of which no process is left. All processes are looked at only if those known are gone."""
        looked_at = [child for child in self._without_leader if not any(map(lives, child.left))]
        found = members([(child.pid, child.mark) for child in looked_at]) if looked_at else {}
        for child in looked_at:
            child.left = found[child.pid]
            if not child.left:
                self._without_leader.remove(child)
                self._finish(child)

    def _finish(self, child: Child) -> None:
        for _ in range(_PIPE // _CHUNK):
            if not self._read(child):
                break
        if child.pipe >= 0:
            self._selector.unregister(child.pipe)
        self._note_ended(child)
        with self._lock:
            self._children.pop(child.number, None)
            if child.process is not None:
                child.process.wait()
            self._close_descriptors(child)
            if child.launch.hold:
                self._held_changed(self._held())
        for sink in child.sinks:
            sink.close()
        last = "".join(f"\n  {line}" for line in child.tail.lines(_SHOWN_LINES))
        self._said(f"{child.launch.tag} ({child.pid}) ended: {child.how}{last}")
        child.ended.set()

    @staticmethod
    def _close_descriptors(child: Child) -> None:
        for descriptor in (child.pipe, child.pidfd):
            if descriptor >= 0:
                os.close(descriptor)
        child.pipe = child.pidfd = -1

    def _held(self) -> Sequence[Child]:
        return [child for child in self._children.values() if child.launch.hold]


def _pipe(*, held: bool) -> tuple[int, int]:
    """Make the pipe of a child's output. A held one can read it, too: so it never writes to a pipe without a reader."""
    ours, theirs = os.pipe2(os.O_CLOEXEC)
    if held:
        os.close(theirs)
        theirs = os.open(f"/proc/self/fd/{ours}", os.O_RDWR | os.O_CLOEXEC)
    return ours, theirs
