"""The fork server: a single-threaded process with everything loaded, from which tests and fixture hosts are forked.

It runs no author's code itself. As the subreaper of all that its children start, it ends whatever a child leaves behind
before it reports the child's end; and when the runner dies, however that happens, it ends its children, fixtures in
reverse order and with time to tear down, and then itself.

*Plug-in servers.* Where several tests come from one file, a child loads the file and then serves as a fork server of
its own, from which the tests of that file are forked, each with the file's module as it was right after loading. That
halves what a small test takes, and a large library is imported once. A file is fit for this if loading it left nothing
behind that a fork does not copy (:func:`unfit_because`).
"""

from __future__ import annotations

import gc
import importlib
import os
import select
import signal
import socket
import sys
from collections import deque
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, NoReturn

from rtf import clock
from rtf.testing.isolation import messages, processes, worker
from rtf.testing.isolation.messages import (
    NUDGE_PERIOD,
    NUDGE_SIGNAL,
    SAFE_STATE_LIMIT,
    SAFE_STATE_NAME,
    Exited,
    Fork,
    Forked,
    Frames,
    Inspect,
    Job,
    Loaded,
    MarkHost,
    Preload,
    Signal,
)
from rtf.testing.isolation.processes import CHANNEL_FD, DUMP_FD

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.testing.plugins import PluginRef

#: How long a fixture may take to come down once the runner is gone, beside the time in which it enters its safe state.
ORPHAN_GRACE = 10.0
#: How long a killed process may take to vanish; one that does not is not waited for again.
VANISH_LIMIT = 5.0
#: Files that come with a request for a child: its channel, its two streams, and the file for its stacks.
_FILES = 4
#: As much of the list of children as is read in one go; further ones have their turn when these are gone.
_CHILDREN_SIZE = 1 << 16
_ALL_FILES = 1 << 20


class ForkServer:
    """The main loop of the process: it takes requests from the runner, and ends of children."""

    def __init__(self, control: socket.socket, keeper: int = 0) -> None:
        self._control = control
        self._frames = Frames()
        self._descriptors: deque[int] = deque()
        self._pidfds: dict[int, int] = {}  # of each child, by its id
        self._pids: dict[int, int] = {}  # the other way round
        self._hosts: list[int] = []
        self._unkillable: set[int] = set()
        self._children = os.open(f"/proc/self/task/{os.getpid()}/children", os.O_RDONLY | os.O_CLOEXEC)
        self._poll = select.poll()
        self._poll.register(control, select.POLLIN)
        self._keeper = os.pidfd_open(keeper) if keeper else -1
        if keeper:
            self._poll.register(self._keeper, select.POLLIN)

    def serve(self) -> None:
        """Work until the runner, or the keeper, is gone; then end everything."""
        control = self._control.fileno()
        while True:
            ready = [descriptor for descriptor, _ in self._poll.poll()]
            for descriptor in ready:
                if descriptor in self._pids:
                    self._reap(self._pids[descriptor])  # first: the run waits for this
            if self._keeper in ready or (control in ready and not self._receive()):
                break
        self._shut_down()

    def _receive(self) -> bool:
        try:
            data, descriptors, _, _ = socket.recv_fds(self._control, 1 << 16, 16 * _FILES)
        except ConnectionError:
            return False
        self._descriptors.extend(descriptors)
        for frame in self._frames.feed(data):
            self._carry_out(messages.to_fork_server(frame))
        return bool(data)

    def _carry_out(self, message: Fork | Signal | MarkHost | Preload) -> None:
        if isinstance(message, Fork):
            self._fork()
        elif isinstance(message, Preload):
            self._send(_preload(message.modules))
        elif message.pid not in self._pidfds:
            return  # it ended meanwhile, and its end is on its way
        elif isinstance(message, MarkHost):
            self._hosts.append(message.pid)
        elif message.group:
            processes.signal_group(message.pid, message.signum)
        else:
            processes.signal_process(message.pid, message.signum)

    def _send(self, message: messages.Message) -> None:
        with suppress(OSError):  # the runner is gone; the next poll says so
            self._control.sendall(messages.pack(message))

    # Children ----------------------------------------------------------------------------------------------------

    def _fork(self) -> None:
        files = [self._descriptors.popleft() for _ in range(_FILES)]
        gc.freeze()  # or a child's collector would write to every object, and the kernel copy their pages
        pid = os.fork()
        if pid == 0:
            status = 70
            try:
                status = _child_main(*files)
            finally:
                os._exit(status)
        for descriptor in files:
            os.close(descriptor)
        pidfd = self._pidfds[pid] = os.pidfd_open(pid)
        self._pids[pidfd] = pid
        self._poll.register(pidfd, select.POLLIN)
        self._send(Forked(pid))

    def _reap(self, pid: int) -> None:
        """Record the end of a child, and report it once nothing is left of what the child started."""
        status, cpu_time, max_rss = processes.reap(pid)
        pidfd = self._pidfds.pop(pid)
        del self._pids[pidfd]
        self._poll.unregister(pidfd)
        os.close(pidfd)
        self._end_orphans()
        self._send(Exited(pid, status, cpu_time, max_rss))

    def _end_orphans(self) -> None:
        """Kill the processes that this one has inherited, and wait until they are gone."""
        while orphans := self._orphans():
            for pid in orphans:
                processes.signal_process(pid, signal.SIGKILL)
                if not processes.await_exit(pid, VANISH_LIMIT):
                    self._unkillable.add(pid)  # it must not hold up the run

    def _orphans(self) -> list[int]:
        children = os.pread(self._children, _CHILDREN_SIZE, 0).split()
        return [pid for word in children if (pid := int(word)) not in self._pidfds and pid not in self._unkillable]

    # The end -----------------------------------------------------------------------------------------------------

    def _shut_down(self) -> None:
        self._poll.unregister(self._control)
        self._control.close()
        if self._keeper >= 0:
            self._poll.unregister(self._keeper)
        hosts = [pid for pid in self._hosts if pid in self._pidfds]
        for pid in [*self._pidfds]:
            if pid not in hosts:
                processes.signal_group(pid, signal.SIGKILL)
        for host in reversed(hosts):
            if host in self._pidfds:
                self._end_host(host)
        final = clock.Deadline.after(VANISH_LIMIT)
        while (self._pidfds or processes.children_of(os.getpid())) and not final.expired:
            for pid in processes.descendants_of(os.getpid()):
                processes.signal_process(pid, signal.SIGKILL)
            self._reap_ready(min(0.2, final.remaining()))
            if not self._pidfds:
                self._end_orphans()

    def _end_host(self, host: int) -> None:
        """Tear a fixture down, whose dependents are down, and kill it if it exceeds its time."""
        left, securing = ORPHAN_GRACE, SAFE_STATE_LIMIT
        processes.signal_process(host, signal.SIGCONT)
        processes.signal_process(host, signal.SIGTERM)
        while host in self._pidfds and left > 0:
            began = clock.monotonic()
            processes.signal_process(host, NUDGE_SIGNAL)
            self._reap_ready(min(NUDGE_PERIOD, left))
            passed = clock.monotonic() - began
            if securing <= 0 or processes.name_of(host) != SAFE_STATE_NAME:
                left -= passed
                continue
            securing -= passed
            if securing <= 0:
                processes.signal_process(host, signal.SIGTERM)  # it leaves its safe state, and is torn down
        if host in self._pidfds:
            processes.signal_group(host, signal.SIGKILL)

    def _reap_ready(self, timeout: float) -> None:
        for descriptor, _ in self._poll.poll(timeout * 1000):
            if descriptor in self._pids:
                self._reap(self._pids[descriptor])


# A child -------------------------------------------------------------------------------------------------------------


def _child_main(channel_fd: int, out_fd: int, err_fd: int, dump_fd: int) -> int:
    """Run as a worker: tie this fresh fork to its parent, then do jobs until the last. Returns the exit status."""
    os.setpgid(0, 0)
    processes.die_with_parent()
    processes.adopt_orphans()
    os.dup2(out_fd, 1)
    os.dup2(err_fd, 2)
    os.dup2(channel_fd, CHANNEL_FD, inheritable=False)
    os.dup2(dump_fd, DUMP_FD, inheritable=False)
    os.closerange(DUMP_FD + 1, _ALL_FILES)
    _seed_anew()
    channel = worker.Channel(CHANNEL_FD)
    while True:
        job = channel.receive()
        if isinstance(job, Inspect):
            from rtf.testing import inspection

            return inspection.serve(job, channel)
        if not isinstance(job, Job):  # a late answer to a question of the last job
            continue
        if job.memory:
            processes.limit_memory(job.memory)
        if job.kind == "test":
            worker.work(job, channel)
            if job.last:
                _end_logging()
                return 0
        elif job.kind == "fixture":
            from rtf.testing.supervision import fixture_host

            return fixture_host.host(job, channel)
        else:
            return _serve_plugin(job.plugin)


def _end_logging() -> None:
    """Have handlers of :mod:`logging` write what they hold back, as at the end of any program; this one just exits."""
    if "logging" in sys.modules:
        try:
            sys.modules["logging"].shutdown()
        except Exception:  # noqa: BLE001 - as at the end of any program, it is shown and changes nothing
            import traceback

            traceback.print_exc()


def _seed_anew() -> None:
    """Seed numpy's random numbers, if numpy is loaded; ``os.fork`` has seeded Python's."""
    numpy_random = sys.modules.get("numpy.random")
    if numpy_random is not None:
        numpy_random.seed()


# Being one -----------------------------------------------------------------------------------------------------------


def main(keeper: int) -> NoReturn:
    """Run the fork server of a runner."""
    os.set_inheritable(CHANNEL_FD, False)
    os.set_inheritable(DUMP_FD, False)
    processes.adopt_orphans()
    processes.no_core_dumps()
    processes.prefer_for_oom_kill()
    worker.prepare()
    ForkServer(socket.socket(fileno=CHANNEL_FD), keeper).serve()
    os._exit(0)


def _preload(names: tuple[str, ...]) -> Loaded:
    """Import the modules of the suites here, once instead of in each test; return which of them cannot be."""
    problems = []
    gc.disable()  # imports make many objects and no garbage
    with _one_thread():
        for name in names:
            try:
                importlib.import_module(name)
            except Exception as error:  # noqa: BLE001 - whatever an import does, the run says so and goes on without it
                problems.append(f"preload {name}: {type(error).__name__}: {error}")
    gc.enable()
    return Loaded(tuple(problems))


@contextmanager
def _one_thread() -> Iterator[None]:
    """Keep the library behind numpy from starting threads in the block, which a fork would lack."""
    name = "OPENBLAS_NUM_THREADS"
    if name in os.environ:
        yield
        return
    os.environ[name] = "1"
    try:
        yield
    finally:
        os.environ.pop(name, None)


def _serve_plugin(plugin: PluginRef) -> int:
    """Turn this worker into the fork server for the tests of one file. Returns the exit status of the process.

    It reports that the file is loaded; or else a problem, and each test loads the file for itself and reports what
    is wrong with it in its own name.
    """
    control = socket.socket(fileno=CHANNEL_FD)
    before = _state()
    try:
        with _one_thread():
            worker.load_plugin(plugin)
        sys.stdout.flush()
        sys.stderr.flush()
        reason = unfit_because(before, _state())
    except BaseException as error:  # noqa: BLE001 - even sys.exit() in the file is the tests' to report
        reason = f"{type(error).__name__}: {error}"
    if reason:
        control.sendall(messages.pack(Loaded((reason,))))
        return 0
    control.sendall(messages.pack(Loaded()))
    ForkServer(control).serve()
    return 0


def _state() -> dict[str, Any]:
    """Return what a process has that its forks would share, or would not get."""
    with open("/proc/self/maps", encoding="utf-8") as stream:  # noqa: PTH123
        shared = [line for line in stream if line.split()[1].endswith("s")]
    return {
        "threads": os.listdir("/proc/self/task"),  # noqa: PTH208 - names only
        "processes": processes.children_of(os.getpid()),
        "open files": sorted(os.listdir("/proc/self/fd")),  # noqa: PTH208
        "shared memory": shared,
        "timers": [
            signal.getitimer(which) for which in (signal.ITIMER_REAL, signal.ITIMER_VIRTUAL, signal.ITIMER_PROF)
        ],
        "random numbers that have begun": _random_state(),
    }


def _random_state() -> object:
    """Return the state of Python's random numbers, and that of numpy's if they were seeded or drawn from.

    A seed that was not chosen leaves numpy's generator (MT19937, ``init_by_array``) with 2**31 in the first word of its
    state, and at the end of it.
    """
    import random

    python = random.getstate()
    numpy_random = sys.modules.get("numpy.random")
    if numpy_random is None:
        return python, None
    _, words, position, _, _ = numpy_random.get_state()
    untouched = words[0] == 1 << 31 and position >= len(words) - 1
    return python, None if untouched else (words.tobytes(), position)


def unfit_because(before: dict[str, Any], after: dict[str, Any]) -> str:
    """Return why tests must not be forked from a process whose state a file's loading has changed; empty if they may.

    A thread would be missing in the fork, and so would a timer; a child process, an open file or socket (with its
    position) and shared memory would be the same one in each test; a chosen seed would be lost.
    """
    changed = [what for what in before if before[what] != after[what]]
    return f"loading it left {', '.join(changed)}" if changed else ""
