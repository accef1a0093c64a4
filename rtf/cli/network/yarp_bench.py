"""The bench of ``rtf yarp-check``: a name server, our network, and programs of YARP that use it."""

from __future__ import annotations

import contextlib
import os
import subprocess
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from rtf import clock
from rtf.errors import RtfError
from rtf.middleware.naming.client import RemoteNames
from rtf.middleware.naming.server import NameServer
from rtf.middleware.ports import remote
from rtf.middleware.ports.network import Network
from rtf.middleware.wire.contact import Contact

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

#: Seconds that a program of YARP may take for one step; it looks up names, and this machine may be busy.
PATIENCE = 20.0
LOOK_AGAIN = 0.05
#: Where the plug-ins of YARP are, and the sockets of unix_stream, which both ends have to find.
_SHARED = ("YARP_DATA_DIRS", "YARP_RUNTIME_DIR")


class CheckError(RtfError):
    """A check has found a difference; the text says which."""


class NotApplicableError(RtfError):
    """A check is about something that the installed YARP does not have."""


@dataclass
class Bench:
    """A name server, ours or YARP's, with our network and the environment of YARP's programs that use it."""

    network: Network
    environment: dict[str, str]
    programs: list[subprocess.Popen[str]] = field(default_factory=list)

    def run(self, *words: str, text: str = "") -> str:
        """Run a ``yarp`` command to its end and return what it printed. Raises CheckError if it fails."""
        done = self.complete("yarp", *words, text=text)
        if done.returncode:
            raise CheckError(f"'yarp {' '.join(words)}' ended with {done.returncode}: {done.stderr.strip()[-300:]}")
        return done.stdout

    def complete(self, *words: str, text: str = "") -> subprocess.CompletedProcess[str]:
        """Run a program to its end, whatever its exit code. Raises CheckError if it does not end."""
        try:
            return subprocess.run(
                words, input=text, capture_output=True, text=True, timeout=PATIENCE, env=self.environment, check=False
            )
        except subprocess.TimeoutExpired:
            raise CheckError(f"'{' '.join(words)}' did not end within {PATIENCE:g} s") from None

    def start(self, *words: str, tool: str = "yarp") -> subprocess.Popen[str]:
        """Start a program of ``yarp``, or of another tool, that goes on; it ends with the check."""
        program = subprocess.Popen(
            [tool, *words],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env=self.environment,
        )
        self.programs.append(program)
        return program

    def await_port(self, name: str) -> None:
        """Wait until a port is registered and answers."""
        await_that(lambda: remote.exists(self.network, Contact(name)), f"the port {name} of YARP is not there")

    def end_programs(self) -> None:
        """Kill the programs that still run."""
        for program in self.programs:
            program.kill()
            program.communicate()
        self.programs.clear()


def await_that(condition: Callable[[], object], complaint: str) -> None:
    """Wait until a condition holds. Raises CheckError with the complaint if it does not in time."""
    deadline = clock.Deadline.after(PATIENCE)
    while not condition():
        if deadline.expired:
            raise CheckError(f"{complaint}, {PATIENCE:g} s later")
        clock.sleep(LOOK_AGAIN)


def _environment(folder: Path) -> dict[str, str]:
    """Return the environment of YARP's programs: a configuration of their own."""
    own = dict.fromkeys(("YARP_CONFIG_HOME", "YARP_DATA_HOME", "YARP_CONF"), str(folder))
    kept = {key: value for key, value in os.environ.items() if not key.startswith("YARP_") or key in _SHARED}
    return {**kept, **own, "YARP_COLORED_OUTPUT": "0"}


@contextlib.contextmanager
def with_our_server(folder: Path) -> Iterator[Bench]:
    """Make a bench with our name server."""
    with NameServer() as server:
        bench = Bench(Network(server.names), _environment(folder))
        bench.run("conf", server.contact.host, str(server.contact.port))
        yield bench


@contextlib.contextmanager
def with_yarpserver(folder: Path) -> Iterator[Bench]:
    """Make a bench with YARP's name server."""
    environment = _environment(folder)
    with NameServer() as free:  # a number that nothing uses now
        number = free.contact.port
    server = subprocess.Popen(
        ["yarpserver", "--ip", "127.0.0.1", "--socket", str(number), "--write"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=environment,
    )
    try:
        names = RemoteNames(Contact("/root", "127.0.0.1", number, "tcp"))
        await_that(lambda: _answers(names), "yarpserver does not answer")
        yield Bench(Network(names), environment)
    finally:
        server.kill()
        server.wait()


def _answers(names: RemoteNames) -> bool:
    try:
        return names.query("/root") is not None
    except RtfError:
        return False
