"""A real master for the tests of a file, nodes at it, and programs of ROS 1, which run with the system's Python."""

from __future__ import annotations

import os
import subprocess
import tempfile
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest

from free_ports import free_port
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.ros1.errors import MasterError
from rtf.ros1.master import Master
from rtf.ros1.node import Node
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


class Ros:
    """A master, and the programs of ROS 1 at it."""

    def __init__(self, home: str) -> None:
        self.port = free_port()
        self.uri = f"http://127.0.0.1:{self.port}"
        places = {"ROS_MASTER_URI": self.uri, "ROS_IP": "127.0.0.1", "ROS_HOME": home, "ROS_LOG_DIR": home}
        self.environment = {**os.environ, **places, "PYTHONPATH": "", "PYTHONWARNINGS": ""}
        self.master: subprocess.Popen[str] | None = None

    def start(self) -> None:
        """Start the master."""
        self.master = self.begin("rosmaster", "--core", "-p", str(self.port))
        eventually(self._answers, "the master does not answer", 20)

    def stop(self) -> None:
        """Kill the master."""
        assert self.master is not None
        self.master.kill()
        self.master.communicate()

    @contextmanager
    def at_work(self) -> Iterator[None]:
        """Have the master within a block."""
        self.start()
        try:
            yield
        finally:
            self.stop()

    def begin(self, *command: str) -> subprocess.Popen[str]:
        """Start a program."""
        return subprocess.Popen(command, env=self.environment, stdin=-3, stdout=-1, stderr=-2, text=True)

    @contextmanager
    def running(self, *command: str) -> Iterator[subprocess.Popen[str]]:
        """Run a program within a block; it is ended there."""
        program = self.begin(*command)
        try:
            yield program
        finally:
            program.kill()
            program.communicate()

    def run(self, *command: str) -> str:
        """Return what a program prints. It has to succeed."""
        done = subprocess.run(
            command, env=self.environment, stdin=-3, capture_output=True, text=True, timeout=60, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    def _answers(self) -> bool:
        try:
            return Master(self.uri, "/tests").pid() > 0
        except MasterError:
            return False


@pytest.fixture(scope="module")
def ros() -> Iterator[Ros]:
    """A system of ROS 1 on this machine."""
    with tempfile.TemporaryDirectory() as home:
        system = Ros(home)
        with system.at_work():
            yield system


@pytest.fixture
def said() -> list[str]:
    """What nodes have reported."""
    return []


@pytest.fixture
def node(ros: Ros, said: list[str]) -> Iterator[Callable[..., Node]]:
    """Make nodes; they are closed."""
    made: list[Node] = []

    def make(name: str, namespace: str = "/", **settings: int) -> Node:
        made.append(Node(name, namespace, master=ros.uri, host="127.0.0.1", report=said.append, **settings))
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.fixture
def network() -> Network:
    """A network whose names are known to this process only."""
    return Network(LocalNames())
