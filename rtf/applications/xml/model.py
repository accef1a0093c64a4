"""An application as it is run, and what is known of its programs and machines: plain data with places in files."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Self

from rtf.errors import Location

if TYPE_CHECKING:
    from collections.abc import Mapping


class Text(str):
    """A text from a file, its variables replaced, with its place."""

    __slots__ = ("location",)
    location: Location

    def __new__(cls, text: str = "", location: Location | None = None) -> Self:
        """Make a text; without a place its file is unknown."""
        made = super().__new__(cls, text)
        made.location = location or Location()
        return made


#: TCP is the carrier of a connection that names none, as in YARP up to 3.12.1: every port understands it.
NOTHING, LOCALHOST, TCP = Text(), Text("localhost"), Text("tcp")


class RestartPolicy(StrEnum):
    """When a module that has ended is started again."""

    NEVER = "never"
    ON_FAILURE = "on-failure"
    ALWAYS = "always"


@dataclass(frozen=True, slots=True)
class Restart:
    """The policy, how often in a row, and the seconds between two attempts."""

    policy: RestartPolicy = RestartPolicy.NEVER
    attempts: int = 5
    backoff: float = 1.0


@dataclass(frozen=True, slots=True)
class PortDependency:
    """A port that has to be open, within ``timeout`` seconds; a ``request`` has to get the ``reply``."""

    port: Text
    timeout: float | None = None
    request: str = ""
    reply: str = ""


@dataclass(frozen=True, slots=True)
class Module:
    """A program that is started: how, where, after what, and how long it takes.

    ``prefix`` is put before the names of its ports, those of the embedding applications included. ``start_delay`` are
    the seconds after its start in which it becomes ready, ``stop_delay`` those before its stop. ``ports`` are pairs of
    names of ports, the second of which replaces the first. ``ready`` is a port by which it shows that it is ready, in
    place of a fixed time. ``number`` distinguishes modules that are the same in all else. ``shown`` is its name for
    people, if that is not the command. ``anywhere``: the file names no node, so one may be chosen. A node may also be
    several names, among which one is chosen (:mod:`rtf.applications.placement`). ``needs`` are figures that its machine
    has to have, besides those of its description, such as ``("memory.free_space", "1024")``.
    """

    name: Text
    parameters: Text = NOTHING
    node: Text = LOCALHOST
    deployer: Text = NOTHING
    stdio: Text = NOTHING
    workdir: Text = NOTHING
    prefix: str = ""
    environment: Text = NOTHING
    display: Text = NOTHING
    dependencies: tuple[PortDependency, ...] = ()
    start_delay: float = 0.0
    stop_delay: float = 0.0
    ports: tuple[tuple[Text, Text], ...] = ()
    restart: Restart = Restart()
    ready: str = ""
    number: int = 0
    shown: str = ""
    anywhere: bool = False
    needs: tuple[tuple[str, str], ...] = ()
    location: Location = field(default_factory=Location, compare=False)

    @property
    def command(self) -> str:
        """The program and its parameters."""
        return f"{self.name} {self.parameters}".rstrip()

    @property
    def tag(self) -> str:
        """The tag by which its node knows it, as yarpmanager forms it: either finds what the other has started."""
        node = "" if self.node == LOCALHOST else f"/{self.node.lstrip('/')}"
        text = f"{node}{self.name}{self.parameters}{self.environment}{self.number}"
        return text.replace(" ", ":").replace("/", ":")

    def __str__(self) -> str:
        """Return the name for people: the program, its first words, and the node."""
        shown = self.shown or self.command
        shown = shown if len(shown) <= _SHOWN else f"{shown[: _SHOWN - 1]}…"
        return shown if self.node == LOCALHOST else f"{shown} on {self.node}"


_SHOWN = 60


@dataclass(frozen=True, slots=True)
class End:
    """An end of a connection; ``external``: a program of another application opens the port."""

    port: Text
    external: bool = False
    qos: Text = NOTHING


@dataclass(frozen=True, slots=True)
class Connection:
    """A connection from one port to another."""

    source: End
    target: End
    carrier: Text = TCP
    persist: bool = False
    name: str = ""
    location: Location = field(default_factory=Location, compare=False)

    def __str__(self) -> str:
        """Return ``/from -> /to``."""
        return f"{self.source.port} -> {self.target.port}"


@dataclass(frozen=True, slots=True)
class Arbitrator:
    """The rules of a port: a connection by its id, or its source, and the condition under which it is accepted."""

    port: Text
    rules: tuple[tuple[Text, Text], ...]


@dataclass(frozen=True, slots=True)
class Application:
    """An application with all that it embeds. ``embedded`` are the files of those, in order."""

    name: Text
    file: str
    description: str = ""
    version: str = ""
    authors: tuple[str, ...] = ()
    dependencies: tuple[PortDependency, ...] = ()
    modules: tuple[Module, ...] = ()
    connections: tuple[Connection, ...] = ()
    arbitrators: tuple[Arbitrator, ...] = ()
    embedded: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Argument:
    """A word of a program's command line: ``--name`` with a value, or a switch without one."""

    name: str
    required: bool = False
    default: str = ""
    description: str = ""
    switch: bool = False


@dataclass(frozen=True, slots=True)
class Channel:
    """A port that a program opens, with the type of its messages. ``required``: it has to be connected."""

    port: Text
    type: str = ""
    carrier: str = ""
    required: bool = False
    priority: bool = False
    description: str = ""


@dataclass(frozen=True, slots=True)
class Description:
    """What is known of a program: its arguments, its ports, and figures that a machine has to have."""

    name: str
    description: str = ""
    version: str = ""
    arguments: tuple[Argument, ...] = ()
    inputs: tuple[Channel, ...] = ()
    outputs: tuple[Channel, ...] = ()
    servers: tuple[Channel, ...] = ()
    clients: tuple[Channel, ...] = ()
    needs: tuple[Mapping[str, str], ...] = ()
    file: str = ""


@dataclass(frozen=True, slots=True)
class Computer:
    """A machine of a lab: its node, and its figures, such as ``memory.total_space``."""

    name: Text
    description: str = ""
    disabled: bool = False
    figures: Mapping[str, str] = field(default_factory=dict)
