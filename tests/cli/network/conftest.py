"""A name server in a process for the tests of a file, and tools that use it, each in a process of its own."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from rtf import clock
from rtf.middleware.naming.client import RemoteNames
from rtf.middleware.wire.contact import Contact

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

_LIMIT = 30.0
_AVAILABLE = re.compile(r"is available at ip (\S+) port (\d+)")


class Tool:
    """A running tool. Its output goes to files, so that it can be read while the tool runs."""

    def __init__(self, folder: Path, number: int, words: tuple[str, ...], environment: dict[str, str]) -> None:
        self.words = words
        self._out, self._err = folder / f"{number}.out", folder / f"{number}.err"
        with self._out.open("wb") as out, self._err.open("wb") as err:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "rtf", *words],
                stdin=subprocess.PIPE,
                stdout=out,
                stderr=err,
                env=environment,
                cwd=folder,
            )

    @property
    def stdout(self) -> str:
        """The standard output up to now."""
        return self._out.read_text(encoding="utf-8")

    @property
    def stderr(self) -> str:
        """The standard error up to now."""
        return self._err.read_text(encoding="utf-8")

    def type(self, *lines: str) -> None:
        """Type lines at the tool's input."""
        assert self.process.stdin is not None
        try:
            self.process.stdin.write("".join(f"{line}\n" for line in lines).encode())
            self.process.stdin.flush()
        except BrokenPipeError:
            self.process.wait(_LIMIT)
            message = f"{self.words} ended with {self.process.returncode}: {self.stdout}{self.stderr}"
            raise AssertionError(message) from None

    def wait(self) -> int:
        """End the input, and return the exit code."""
        assert self.process.stdin is not None
        if not self.process.stdin.closed:
            self.process.stdin.close()
        return self.process.wait(_LIMIT)

    def leave(self) -> None:
        """Close the input; lines that were not read are lost."""
        assert self.process.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            self.process.stdin.close()

    def end(self, signum: int = signal.SIGINT) -> int:
        """Send a signal, and return the exit code."""
        self.process.send_signal(signum)
        try:
            return self.process.wait(_LIMIT)
        except subprocess.TimeoutExpired:
            self.process.send_signal(signal.SIGABRT)  # faulthandler says where it is
            self.process.wait(_LIMIT)
            raise AssertionError(f"{self.words} did not end: {self.stdout}{self.stderr}") from None

    def until(self, condition: Callable[[], object], what: str = "") -> None:
        """Wait until a condition holds, while the tool runs."""
        deadline = clock.Deadline.after(_LIMIT)
        while not condition():
            message = f"{self.words}: {what} did not come about\nstdout: {self.stdout}\nstderr: {self.stderr}"
            assert not deadline.expired, message
            clock.sleep(0.005)

    def until_printed(self, text: str) -> None:
        """Wait until the tool has printed a line."""
        self.until(lambda: text in self.stdout.splitlines(), f"the line {text!r}")


class Net:
    """A name server in a process, the tools that use it, and a client of its names."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.config = folder / "config"
        self.environment = {
            **os.environ,
            "YARP_CONFIG_HOME": str(self.config),
            "NO_COLOR": "1",
            "PYTHONFAULTHANDLER": "1",
        }
        self.environment["YARP_RUNTIME_DIR"] = str(folder / "runtime")
        for name in ("YARP_NAMESPACE", "YARP_PORT_PREFIX", "YARP_PORT_RANGE", "COLUMNS"):
            self.environment.pop(name, None)
        self._tools: list[Tool] = []
        self.server = self.start("nameserver", "--socket", "0", "--write", "--no-discovery")
        self.server.until(lambda: _AVAILABLE.search(self.server.stdout), "the name server")
        found = _AVAILABLE.search(self.server.stdout)
        assert found is not None
        self.contact = Contact("/root", found[1], int(found[2]), "tcp")
        self.names = RemoteNames(self.contact)

    def start(self, *words: str, **environment: str) -> Tool:
        """Start a tool."""
        tool = Tool(self.folder, len(self._tools), words, {**self.environment, **environment})
        self._tools.append(tool)
        return tool

    def run(self, *words: str, lines: tuple[str, ...] = (), **environment: str) -> Tool:
        """Run a tool to its end."""
        tool = self.start(*words, **environment)
        tool.type(*lines)
        tool.wait()
        return tool

    def opened(self, name: str, *words: str) -> Tool:
        """Start a tool that opens a port, and wait until the port answers."""
        tool = self.start(*words)
        tool.until(lambda: self.answers(name), f"the port {name}")
        return tool

    def answers(self, name: str) -> bool:
        """Return whether a port is registered and accepts connections."""
        contact = self.names.query(name)
        try:
            if contact is not None:
                socket.create_connection((contact.host, contact.port), 10).close()
        except OSError:
            return False
        return contact is not None

    def close(self) -> None:
        """Kill the tools that still run."""
        for tool in reversed(self._tools):
            tool.process.kill()
            tool.process.wait()
            tool.leave()


@pytest.fixture(scope="module")
def _net(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Net]:
    made = Net(tmp_path_factory.mktemp("net"))
    yield made
    made.close()


@pytest.fixture
def net(_net: Net) -> Iterator[Net]:
    """The network; the test must end its tools, and leave no registered name."""
    before = len(_net._tools)
    yield _net
    left = [tool.words for tool in _net._tools[before:] if tool.process.poll() is None]
    for tool in _net._tools[before:]:
        tool.process.kill()
        tool.process.wait()
        tool.leave()
    known = [contact.name for contact in _net.names.list()]
    for name in known:
        if name not in ("/root", "fallback"):
            _net.names.unregister(name)
    assert left == []
    assert known == ["/root", "fallback"]
