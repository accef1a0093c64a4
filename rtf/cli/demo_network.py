"""The networks of ``rtf demo``: each with a name server of its own, and the environment of programs in it."""

from __future__ import annotations

import os
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rtf import clock
from rtf.errors import RtfError
from rtf.middleware.naming.client import RemoteNames
from rtf.middleware.naming.configuration import write_place
from rtf.middleware.naming.server import NameServer
from rtf.middleware.ports import remote
from rtf.middleware.ports.network import Network
from rtf.middleware.wire.contact import Contact

if TYPE_CHECKING:
    import subprocess
    from collections.abc import Iterator


class DemonstrationError(RtfError, RuntimeError):
    """Something that the demonstration shows did not happen."""


class DemoNetwork(NamedTuple):
    """A network, the environment of its programs, whose PATH begins with that of this Python, and a folder."""

    network: Network
    environment: dict[str, str]
    folder: Path


@contextmanager
def demo_network() -> Iterator[DemoNetwork]:
    """Run a name server, and find it from programs with the environment."""
    with tempfile.TemporaryDirectory() as folder, NameServer() as server:
        path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", os.defpath)])
        environment = {**os.environ, "YARP_CONFIG_HOME": folder, "XDG_STATE_HOME": folder, "PATH": path}
        write_place(server.contact, environment=environment)
        names = RemoteNames(server.contact)
        try:
            yield DemoNetwork(Network(names), environment, Path(folder))
        finally:
            names.close()


def await_port(network: Network, name: str, program: subprocess.Popen[str] | subprocess.Popen[bytes]) -> None:
    """Wait for a port that a program should open. Raises DemonstrationError if it does not."""
    deadline = clock.Deadline.after(20.0)
    while not remote.exists(network, Contact(name=name)):
        if program.poll() is not None or deadline.expired:
            raise DemonstrationError(f"{name}, which process {program.pid} should open, is not there")
        clock.sleep(0.02)
