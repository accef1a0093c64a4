"""Applications for tests: written to a folder, read, and run on a network in this process with nodes of its own."""

from __future__ import annotations

import sys
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.applications.deployer import DeployerContext
from rtf.applications.events import Event, Kind, State
from rtf.applications.manager import Manager
from rtf.applications.session import Session, holder
from rtf.applications.xml.reader import read_application
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.applications.events import Say
    from rtf.applications.xml.model import Application


def module(name: str, parameters: str = "", inside: str = "", node: str = "localhost") -> str:
    """Write a module."""
    return f"<module><name>{name}</name><parameters>{parameters}</parameters><node>{node}</node>{inside}</module>"


def shell(folder: Path, name: str, script: str, inside: str = "", node: str = "localhost") -> str:
    """Write a module ``sh NAME.sh`` in the folder, and its script. Words behind a blank of the name are arguments."""
    (folder / f"{name.partition(' ')[0]}.sh").write_text(script)
    words = name.replace(" ", ".sh ", 1) if " " in name else f"{name}.sh"
    return module("sh", words, f"<workdir>{folder}</workdir>{inside}", node)


def needs(port: str, **attributes: str) -> str:
    """Write a dependency on a port."""
    words = "".join(f' {name}="{value}"' for name, value in attributes.items())
    return f"<dependencies><port{words}>{port}</port></dependencies>"


def application(folder: Path, content: str) -> Application:
    """Read an application with this content, which must have no problem."""
    path = folder / "lab.xml"
    path.write_text(f"<application><name>lab</name>{content}</application>")
    loaded = read_application(path)
    assert loaded.diagnostics == ()
    return loaded.application


@dataclass
class Lab:
    """A manager, its network, and what it said."""

    network: Network
    manager: Manager
    said: list[Event] = field(default_factory=list)

    def texts(self, kind: Kind) -> list[str]:
        """What happened of this kind, without the folder of Python."""
        return [one.text.replace(sys.executable, "python") for one in self.said if one.kind is kind]

    def states(self) -> list[State]:
        """The states of the modules."""
        return [unit.state for unit in self.manager.units]


@contextmanager
def lab(app: Application, network: Network | None = None, **context: object) -> Iterator[Lab]:
    """Make a manager; afterwards all modules are stopped."""
    network = network or Network(LocalNames())
    said: list[Event] = []
    around = DeployerContext(network, network, "/app/lab", **context)  # type: ignore[arg-type]
    with Manager(app, around, said.append, patience=5.0) as manager:
        yield Lab(network, manager, said)
        manager.stop()


class LabFactory:
    """Makes sessions and managers of applications on a network in this process; sessions are files of a folder."""

    def __init__(self, folder: Path, network: Network | None = None) -> None:
        self.network = network or Network(LocalNames())
        self._folder = folder

    def session(self, application: Application) -> Session:
        """Begin the session of an application."""
        return Session(self._path(application))

    def holder(self, application: Application) -> int:
        """Return the process that holds the session."""
        return holder(self._path(application))

    def manager(self, application: Application, said: Say, *, attached: bool = False) -> Manager:
        """Make the manager of an application."""
        around = DeployerContext(self.network, self.network, "/app/page", attached=attached)
        return Manager(application, around, said, patience=5.0)

    def _path(self, application: Application) -> Path:
        return self._folder / f"{application.name}.session"
