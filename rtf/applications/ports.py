"""Which ports the modules of an application open, and so which module waits for which.

A port is known from the description of a program, with what the command line says instead of a default, and from the
words of the command line alone: ``--name /x`` or a first word ``/x`` stand for ``/x`` and all ports below it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from graphlib import CycleError, TopologicalSorter
from typing import TYPE_CHECKING

from rtf.applications.run.protocol import split_words
from rtf.applications.xml.model import Text

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from rtf.applications.xml.model import Application, Channel, Description, Module


#: The most words of a name that are looked at.
_MOST_WORDS = 16


@dataclass(frozen=True, slots=True)
class OpenedPorts:
    """The ports of a module: those described, with their kind (input, output, server, client), and the begin of others.

    ``stem`` is empty where the command line names no port.
    """

    described: Mapping[str, tuple[str, Channel]]
    stem: str

    def opens(self, port: str) -> bool:
        """Return whether the module opens a port, as far as is known."""
        return port in self.described or (bool(self.stem) and f"{port}/".startswith(f"{self.stem}/"))


def beginnings(port: str) -> Iterator[str]:
    """Yield a port's name, and the names that it is below: ``/a/b/c``, ``/a/b``, ``/a``; of a very long one some."""
    yield port
    words = port.split("/", _MOST_WORDS)
    yield from ("/".join(words[:end]) for end in range(len(words) - 1, 1, -1))


def ports_of(module: Module, description: Description | None) -> OpenedPorts:
    """Return the ports of a module."""
    words = split_words(module.parameters)
    stem = _stem(words)
    described = {}
    for kind, channel in _channels(description):
        name = _renamed(channel.port, description, stem)
        name = next((new for old, new in module.ports if old == name), name)
        port = Text(module.prefix + name, channel.port.location)
        described[str(port)] = (kind, replace(channel, port=port))
    return OpenedPorts(described, module.prefix + stem if stem else "")


def _stem(words: Sequence[str]) -> str:
    """Return the name that a command line gives to the ports of its program."""
    for index, word in enumerate(words):
        if word == "--name" and index + 1 < len(words):
            name = words[index + 1]
            return name if name.startswith("/") else f"/{name}"
    first = next((index for index, word in enumerate(words) if word.startswith(("/", "--"))), None)
    return words[first] if first is not None and words[first].startswith("/") else ""


def _renamed(port: str, description: Description | None, stem: str) -> str:
    """Return a described port as it is called if the command line names another ``name`` than the default."""
    arguments = description.arguments if description is not None else ()
    default = next((one.default for one in arguments if one.name == "name"), "")
    default = f"/{default.lstrip('/')}" if default else ""
    if stem and default and f"{port}/".startswith(f"{default}/"):
        return stem + port[len(default) :]
    return port


def _channels(description: Description | None) -> Iterator[tuple[str, Channel]]:
    if description is not None:
        for kind in ("input", "output", "server", "client"):
            for channel in getattr(description, f"{kind}s"):
                if channel.port:
                    yield kind, channel


class Order:
    """Who waits for whom: ``needs`` has for each module, by its index, those that open the ports for which it waits.

    ``circle`` are the modules that wait for each other, the first one again at the end; empty without.
    """

    def __init__(self, application: Application, ports: Sequence[OpenedPorts]) -> None:
        self.needs: dict[int, set[int]] = {}
        for index, module in enumerate(application.modules):
            wanted = [one.port for one in module.dependencies]
            self.needs[index] = {
                other for other, opened in enumerate(ports) if any(opened.opens(port) for port in wanted)
            }
        try:
            self._levels = [*_levels(self.needs)]
            self.circle: tuple[int, ...] = ()
        except CycleError as error:
            self._levels = [[*self.needs]]
            self.circle = tuple(error.args[1])

    def circle_text(self, application: Application) -> str:
        """Return the circle for people."""
        return " -> ".join(str(application.modules[index].name) for index in self.circle)

    def levels(self) -> list[list[int]]:
        """Return the modules in groups: each waits for those of earlier groups only."""
        return self._levels


def _levels(needs: Mapping[int, set[int]]) -> Iterator[list[int]]:
    sorter = TopologicalSorter(needs)
    sorter.prepare()
    while sorter.is_active():
        ready = sorted(sorter.get_ready())
        yield ready
        sorter.done(*ready)
