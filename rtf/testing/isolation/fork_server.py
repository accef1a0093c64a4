"""The fork server: a warm, single-threaded process from which every test and fixture host is forked.

It is started once, has everything loaded that a test needs, and always holds a spare child ready, so that a test begins
in well under a millisecond. It runs no author's code itself. As the subreaper of all that its children start, it ends
whatever a child leaves behind before it reports the child's end; and when the runner dies, however that happens, it
ends its children, fixtures in reverse order and with time to tear down, and then itself.

*Templates.* Where several tests come from one file, a child is made a template: it loads the file and then serves as a
fork server of its own, from which the tests of that file are forked, each with the file's module as it was right after
loading. A file is fit for this if loading it left nothing behind that a fork does not copy (:func:`unfit_because`).
What it draws or reads while it is loaded, such as the time, is then the same for all tests of the file.

*Forking.* What a small test costs is mostly memory: with each fork the kernel copies the map of all pages, and after it
each page that the test, or the fork server while the test lives, writes to; and Python writes to every object it looks
at. So the loop below is flat, ``forking`` chooses the cheaper fork, and the modules that the fork server loads do
without ``threading``, ``random`` and ``logging`` and put off what few tests need.
"""

from __future__ import annotations

import gc
import importlib
import os
import select
import signal
import struct
import sys
from _socket import SCM_RIGHTS, SOL_SOCKET, socket, socketpair  # the C type: half the objects of the one in ``socket``
from typing import TYPE_CHECKING, NoReturn

from rtf import clock
from rtf.testing.isolation import forking, processes, worker
from rtf.testing.isolation.fork_server_protocol import (
    CHILD,
    CONTROL_FD,
    DUMP_FD,
    EXITED,
    FORK,
    FORK_SPARE,
    FORK_SPARE_REQUEST,
    MARK_HOST,
    NUDGE_PERIOD,
    NUDGE_SIGNAL,
    PRELOAD,
    READY,
    REPORT,
    REQUEST,
    SAFE_STATE_LIMIT,
    SAFE_STATE_NAME,
    SIGNAL_GROUP,
    UNFIT,
)

if TYPE_CHECKING:
    from rtf.testing.plugins import PluginRef

#: How long a fixture may take to come down once the runner is gone, beside the time in which it parks, and how long a
#: killed process may take to vanish.
ORPHAN_GRACE = 10.0
STRAY_GRACE = 5.0

#: As much of the list of children as is looked at in one go; strays beyond it have their turn when these are gone.
_CHILDREN_SIZE = 1 << 16


class ForkServer:
    """The process's one loop: requests, exits, strays."""

    def __init__(self, control: socket) -> None:
        self._control = control
        self._pidfds: dict[int, int] = {}  # of every process that is a child of this one, by its id
        self._pids: dict[int, int] = {}  # the other way round
        self._strays: set[int] = set()
        self._hosts: list[int] = []
        self._poll = select.poll()
        self._poll.register(control, select.POLLIN)
        self._born: list[tuple[bytes, socket, int, int]] = []
        self._ended: list[bytes] = []
        self._buffer = b""
        self._pid = os.getpid()
        self._children = os.open(f"/proc/self/task/{self._pid}/children", os.O_RDONLY)
        self._stray_deadline = _NEVER
        self._make_process = forking.choose_fork()

    def serve(self) -> None:
        """Work until the runner is gone; then end everything."""
        control = self._control.fileno()
        poll = self._poll.poll
        pids = self._pids
        while True:
            timeout = None if self._stray_deadline is _NEVER else self._stray_deadline.remaining() * 1000
            asked = False
            for descriptor, _ in poll(timeout):
                if descriptor == control:
                    asked = True
                else:
                    self._reap(pids[descriptor])  # before anything else: the run waits for this
            if asked and not self._receive():
                break
            if self._stray_deadline is not _NEVER and self._stray_deadline.expired:
                self._report()  # a stray that cannot be killed must not hold up the run
        self._shut_down()

    # Requests ----------------------------------------------------------------------------------------------------

    def _receive(self) -> bool:
        try:
            data = self._control.recv(65536)
        except ConnectionError:
            return False
        if data == FORK_SPARE_REQUEST:
            self._fork()
            return True
        if not data:
            return False
        data = self._buffer + data
        position, size = 0, REQUEST.size
        while len(data) - position >= size:
            kind, pid, signum = REQUEST.unpack_from(data, position)
            end = position + size + (pid if kind == PRELOAD else 0)
            if len(data) < end:
                break
            self._obey(kind, pid, signum, data[position + size : end])
            position = end
        self._buffer = data[position:]
        return True

    def _obey(self, kind: bytes, pid: int, signum: int, text: bytes) -> None:
        if kind in (FORK, FORK_SPARE):
            self._fork()
            if kind == FORK:
                self._report(ends=False)
        elif kind == PRELOAD:
            _preload(self._control, text.decode().split())
            self._make_process = forking.choose_fork()
        elif pid not in self._pidfds:
            return  # it ended meanwhile, and its end is on its way
        elif kind == MARK_HOST:
            self._hosts.append(pid)
        elif kind == SIGNAL_GROUP:
            processes.signal_group(pid, signum)
        else:
            processes.signal_process(pid, signum)

    # Children ----------------------------------------------------------------------------------------------------

    def _fork(self) -> None:
        here, there = socketpair()
        out_read, out_write = os.pipe()
        err_read, err_write = os.pipe()
        pid = self._make_process()
        if pid < 0:
            pid = os.fork()  # which meets the same want of memory, and says so
        if pid == 0:
            status = 70
            try:
                status = worker.child_main(there.fileno(), out_write, err_write)
            finally:
                os._exit(status)
        there.close()
        os.close(out_write)
        os.close(err_write)
        self._adopt(pid)
        self._born.append((REPORT.pack(CHILD, pid, 0, 0.0, 0), here, out_read, err_read))

    def _adopt(self, pid: int) -> None:
        pidfd = os.pidfd_open(pid)
        self._pidfds[pid] = pidfd
        self._pids[pidfd] = pid
        self._poll.register(pidfd, select.POLLIN)

    def _reap(self, pid: int) -> None:
        """Take note of an end, and report it once nothing is left of what the dead child started."""
        status, cpu, resident = processes.reap(pid)
        pidfd = self._pidfds.pop(pid)
        del self._pids[pidfd]
        self._poll.unregister(pidfd)
        os.close(pidfd)
        if pid in self._strays:
            self._strays.discard(pid)
        else:
            self._ended.append(REPORT.pack(EXITED, pid, status, cpu, resident))
        for word in os.pread(self._children, _CHILDREN_SIZE, 0).split():
            if int(word) not in self._pidfds:
                self._end_stray(int(word))
        if not self._strays:
            self._report()
        elif self._stray_deadline is _NEVER:
            self._stray_deadline = clock.Deadline.after(STRAY_GRACE)

    def _end_stray(self, pid: int) -> None:
        try:
            self._adopt(pid)
        except ProcessLookupError:
            return
        processes.signal_process(pid, signal.SIGKILL)
        self._strays.add(pid)

    def _report(self, *, ends: bool = True) -> None:
        """Tell of new children, and of those that have ended."""
        reports = []
        descriptors: list[int] = []
        for report, here, out, err in self._born:
            reports.append(report)
            descriptors += (here.fileno(), out, err)
        if ends:
            reports += self._ended
            self._ended.clear()
            self._stray_deadline = _NEVER
        try:
            if descriptors:
                packed = struct.pack(f"={len(descriptors)}i", *descriptors)
                self._control.sendmsg(reports, [(SOL_SOCKET, SCM_RIGHTS, packed)])
            elif reports:
                self._control.sendmsg(reports)
        except OSError:
            pass  # the runner is gone; the next poll says so
        for _, here, out, err in self._born:
            here.close()
            os.close(out)
            os.close(err)
        self._born.clear()

    # The end -----------------------------------------------------------------------------------------------------

    def _shut_down(self) -> None:
        self._poll.unregister(self._control)
        self._control.close()
        hosts = [pid for pid in self._hosts if pid in self._pidfds]
        for pid in [*self._pidfds]:
            if pid not in hosts:
                processes.signal_group(pid, signal.SIGKILL)
        for host in reversed(hosts):
            if host in self._pidfds:
                self._end_host(host)
        final = clock.Deadline.after(STRAY_GRACE)
        while (self._pidfds or processes.children_of(self._pid)) and not final.expired:
            for pid in processes.descendants_of(self._pid):
                processes.signal_process(pid, signal.SIGKILL)
            self._reap_ready(min(0.2, final.remaining()))

    def _end_host(self, host: int) -> None:
        """Have a fixture come down, in its time: what depends on it is down. One that does not is killed."""
        left, parking = ORPHAN_GRACE, SAFE_STATE_LIMIT
        processes.signal_process(host, signal.SIGCONT)
        processes.signal_process(host, signal.SIGTERM)
        while host in self._pidfds and left > 0:
            began = clock.monotonic()
            processes.signal_process(host, NUDGE_SIGNAL)
            self._reap_ready(min(NUDGE_PERIOD, left))
            passed = clock.monotonic() - began
            if parking <= 0 or processes.name_of(host) != SAFE_STATE_NAME:
                left -= passed
                continue
            parking -= passed
            if parking <= 0:
                processes.signal_process(host, signal.SIGTERM)  # it leaves the park, and is torn down
        if host in self._pidfds:
            processes.signal_group(host, signal.SIGKILL)

    def _reap_ready(self, timeout: float) -> None:
        for descriptor, _ in self._poll.poll(timeout * 1000):
            if descriptor in self._pids:
                self._reap(self._pids[descriptor])


_NEVER = clock.Deadline()


# Being one -----------------------------------------------------------------------------------------------------------


def _send_text(control: socket, kind: bytes, text: str) -> None:
    data = text.encode()
    control.sendall(REPORT.pack(kind, len(data), 0, 0.0, 0) + data)


def _preload(control: socket, names: list[str]) -> None:
    """Load modules that the suites' tests need once here instead of in each test, and tell of those that cannot be."""
    problems = []
    for name in names:
        try:
            importlib.import_module(name)
        except Exception as error:  # noqa: BLE001 - whatever an import does, the run says so and goes on without it
            problems.append(f"preload {name}: {type(error).__name__}: {error}")
    _send_text(control, READY, "\n".join(problems))
    _settle()


def _settle() -> None:
    """Have as little memory as possible for the kernel to copy, page by page, with every child."""
    gc.collect()
    gc.freeze()  # keeps the collector of a child from looking at, and so writing to, every object
    processes.give_memory_back()


def main() -> NoReturn:
    """Be the fork server: what a fresh interpreter does that :mod:`rtf.testing.isolation.launch` has started."""
    os.set_inheritable(CONTROL_FD, False)
    os.set_inheritable(DUMP_FD, False)
    processes.adopt_orphans()
    processes.no_core_dumps()
    processes.prefer_for_oom_kill()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # a thread pool would not survive the fork
    worker.prepare()
    _settle()
    ForkServer(socket(fileno=CONTROL_FD)).serve()
    os._exit(0)


def be_template(plugin: PluginRef, control_fd: int) -> int:
    """Turn this worker into a fork server for the tests of one file. Returns the exit status of the process.

    The first report is READY, or UNFIT with the reason; then each test loads the file for itself, and tells what is
    wrong with it in its own name.
    """
    control = socket(fileno=control_fd)
    before = _kernel_state()
    try:
        worker.load_template(plugin)
        sys.stdout.flush()
        sys.stderr.flush()
        reason = unfit_because(before, _kernel_state())
    except BaseException as error:  # noqa: BLE001 - even sys.exit() in the file is the tests' to report
        reason = f"{type(error).__name__}: {error}"
    if reason:
        _send_text(control, UNFIT, reason)
        return 0
    _settle()
    _send_text(control, READY, "")
    ForkServer(control).serve()
    return 0


def _kernel_state() -> dict[str, list[str]]:
    """What a process has from the kernel that its forks would share, or would not get."""
    with open("/proc/self/maps", encoding="utf-8") as stream:  # noqa: PTH123
        shared = [line for line in stream if line.split()[1].endswith("s")]
    timers = [str(signal.getitimer(which)) for which in (signal.ITIMER_REAL, signal.ITIMER_VIRTUAL, signal.ITIMER_PROF)]
    return {
        "threads": os.listdir("/proc/self/task"),  # noqa: PTH208 - names only
        "processes": [str(pid) for pid in processes.children_of(os.getpid())],
        "open files": sorted(os.listdir("/proc/self/fd")),  # noqa: PTH208
        "shared memory": shared,
        "timers": timers,
    }


def unfit_because(before: dict[str, list[str]], after: dict[str, list[str]]) -> str:
    """Why tests must not be forked from a process whose state was changed by loading a file; empty if they may.

    A thread would be missing in the fork, and so would a timer; a child process, an open file or socket (with its
    position) and shared memory would be the same one in each test.
    """
    changed = [what for what in before if before[what] != after[what]]
    return f"loading it left {', '.join(changed)}" if changed else ""
