"""The deployer ``ssh``: runs modules on a machine that needs nothing but a shell and Linux.

Programs are started, listed and signalled by scripts (:mod:`~rtf.applications.ssh.scripts`). Their output comes by the
connection that started them: when that is lost they run on, and are found again by their tags, but what they write
from then on is lost.
"""

from __future__ import annotations

import threading
from functools import partial
from pathlib import PurePath
from typing import TYPE_CHECKING

from rtf import clock
from rtf.applications.deployer import Deployer
from rtf.applications.errors import DeployerError
from rtf.applications.run.errors import StartError
from rtf.applications.run.output import LineSender, Tail
from rtf.applications.run.protocol import Ending, split_words
from rtf.applications.ssh import scripts
from rtf.applications.ssh.connection import RemoteProgram, SshConnection
from rtf.logs.record import COLLECTOR
from rtf.testing.isolation import processes

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rtf.applications.deployer import DeployerContext
    from rtf.applications.run.protocol import Start
    from rtf.applications.run.sysinfo import SystemInfo

#: Seconds for which a list is used unless something is known to have changed: a list costs the other end some ms.
_FRESH = 0.5
#: Seconds for the end of the output of a program that has ended, and for its last lines to reach the logger.
_LAST_OUTPUT = 2.0
_LAST, _MOST_LINES = 20, 4096
#: What shells add to the number of a signal for the status of a program that it has killed.
_KILLED = 128


class SshDeployer(Deployer):
    """Runs modules on the machine ``place``, a host of ``~/.ssh/config`` or of the network."""

    def __init__(self, place: str, context: DeployerContext) -> None:
        super().__init__(place.lstrip("/"), context)
        self._connection = SshConnection(self.place)
        self._programs: dict[str, _Program] = {}
        self._listing = threading.Lock()
        self._listed: dict[str, int] = {}
        self._stale_at = 0.0
        self._changes, self._listed_changes = 0, -1

    def note_change(self) -> None:
        """Take note that a program has begun, or may have ended."""
        self._changes += 1

    def start(self, request: Start) -> int:
        program = _Program(request, self)
        try:
            scripts.start_script(request, "")
        except StartError as error:
            raise self._refused(request, str(error)) from None
        said = self._connection.start(partial(scripts.start_script, request), program)
        if not program.pid:
            raise self._refused(request, said.partition(" ")[2] or "its shell says nothing")
        self._programs[request.tag] = program
        return program.pid

    def _refused(self, request: Start, reason: str) -> DeployerError:
        return DeployerError(f"{request.command} cannot be started on {self.place}: {reason}")

    def running(self) -> Mapping[str, int]:
        with self._listing:
            changes = self._changes
            if changes != self._listed_changes or clock.monotonic() >= self._stale_at:
                found = self._list()
                if self._listed.keys() - found.keys():  # one in the middle of exec has no environment
                    found = {**self._list(), **found}
                self._listed, self._listed_changes = found, changes
                self._stale_at = clock.monotonic() + _FRESH
            return self._listed

    def _list(self) -> dict[str, int]:
        return scripts.read_list(self._connection.run(scripts.list_script))

    def signal(self, tag: str, signum: int) -> bool:
        script = partial(scripts.signal_script, tag, processes.signal_name(signum))
        sent = self._connection.run(script).startswith(b"sent")
        self.note_change()
        return sent

    def ending(self, tag: str) -> Ending | None:
        program = self._programs.get(tag)
        if program is None:
            return None
        program.closed.wait(_LAST_OUTPUT)
        status = program.status
        if status is None:
            return None
        killed = processes.signal_name(status - _KILLED) if status > _KILLED else ""
        signal = killed if killed.startswith("SIG") else ""
        return Ending(program.pid, processes.describe_end(status, signal), (*program.tail.lines(_LAST),))

    def output(self, tag: str) -> Sequence[str]:
        program = self._programs.get(tag)
        return () if program is None else program.tail.lines(_MOST_LINES)

    def which(self, program: str, directory: str = "") -> str:
        answer = self._connection.run(partial(scripts.locate_script, program, directory))
        return answer.decode("utf-8", "replace").rstrip("\n")

    def figures(self) -> SystemInfo:
        return scripts.read_figures(self._connection.run(scripts.figures_script))

    def close(self) -> None:
        self._connection.close()
        deadline = clock.Deadline.after(_LAST_OUTPUT)
        for program in self._programs.values():
            program.join(deadline.remaining())


class _Program(RemoteProgram):
    """A program that was started by this connection, with its last lines, and the port that logs its lines."""

    def __init__(self, request: Start, deployer: SshDeployer) -> None:
        super().__init__()
        self.tail = Tail()
        self._request = request
        self._deployer = deployer
        self._sender: LineSender | None = None

    def note_start(self) -> None:
        request, deployer = self._request, self._deployer
        if request.log is not None:
            program = PurePath(split_words(request.command)[0]).name
            self._sender = LineSender(
                f"/log/{deployer.place}/{program}/{self.pid}",
                network=deployer.context.network,
                target=request.log or COLLECTOR,
                report=deployer.context.report,
            )
        deployer.note_change()

    def feed(self, data: bytes) -> None:
        self.tail.feed(data)
        if self._sender is not None:
            self._sender.feed(data)

    def note_end(self) -> None:
        if self._sender is not None and self.closed.is_set():
            self._sender.close()
        self._deployer.note_change()

    def join(self, timeout: float) -> None:
        """Wait until its last lines are sent, ``timeout`` seconds at most."""
        if self._sender is not None:
            self._sender.join(timeout)
