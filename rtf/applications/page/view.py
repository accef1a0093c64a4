"""What the page shows of an application: modules with their ports, connections, and all problems at their place.

Variables are replaced, and what is embedded is there, too, without the ids of what can be edited.
"""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from rtf.applications.check import check_application
from rtf.applications.page.document import Document, edited, ids_of, places, read_document
from rtf.applications.placement import shown_node
from rtf.applications.ports import beginnings, ports_of
from rtf.applications.xml.descriptions import find_computers, find_description, read_description
from rtf.applications.xml.reader import read_application
from rtf.applications.xml.tree import parse_tree
from rtf.errors import Location
from rtf.resources import ResourceFinder
from rtf.resources.finder import Policy
from rtf.testing.suite.diagnostics import DiagnosticLog
from rtf.xml_tree import XmlError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from rtf.applications.ports import OpenedPorts
    from rtf.applications.xml.model import Application, Connection, Description
    from rtf.middleware.ports.network import Network
    from rtf.testing.events import Diagnosed
    from rtf.xml_tree import Element

#: The most descriptions in the palette.
_MOST_DESCRIBED = 1000


class PortView(msgspec.Struct, frozen=True):
    """A port: its kind is input, output, server or client. One that is not ``described`` is known by a connection."""

    name: str
    kind: str
    type: str = ""
    required: bool = False
    described: bool = True


class ModuleView(msgspec.Struct, frozen=True):
    """A module. Without an id it belongs to the embedded application in ``file``. It ``waits`` for ports."""

    id: str
    tag: str
    label: str
    command: str
    node: str
    file: str
    waits: tuple[str, ...]
    ports: tuple[PortView, ...]


class ConnectionView(msgspec.Struct, frozen=True):
    """A connection; ``key`` identifies it among those of the network."""

    id: str
    key: str
    source: str
    target: str
    carrier: str
    persist: bool


class ProblemView(msgspec.Struct, frozen=True):
    """A problem: its severity, text and place, and the module or connection that it is of, if there is one."""

    severity: str
    text: str
    hint: str
    place: str
    id: str


class View(msgspec.Struct, frozen=True):
    """An application as it is shown. With ``errors`` it cannot be run."""

    name: str
    description: str
    errors: bool
    modules: tuple[ModuleView, ...]
    connections: tuple[ConnectionView, ...]
    problems: tuple[ProblemView, ...]


#: Encodes views as JSON; their texts have places in files, which are left out.
ENCODER = msgspec.json.Encoder(enc_hook=str)


def view_of(
    path: Path, variables: Mapping[str, str], document: Document | None, network: Network | None = None
) -> tuple[Document, View]:
    """Return a file's document and view, as it would be with the changes of ``document``. Nothing is written.

    With a network, nodes and external ports are asked for. Raises XmlError, and as :func:`edited`.
    """
    read, root = read_document(path)
    if document is None or document == read:
        document, ids = read, ids_of(read)  # problems have their places in the file as it is
    else:
        data, ids = edited(path, document)
        root = parse_tree(data, str(path))
    return document, _view(path, variables, root, ids, network)


def _view(path: Path, variables: Mapping[str, str], root: Element, ids: list[str], network: Network | None) -> View:
    loaded = read_application(path, variables, root=root)
    problems = [*loaded.diagnostics]
    if not loaded.has_errors:
        found = DiagnosticLog()
        check_application(loaded.application, found, network)
        problems += found
    known = [*places(root, ids)]
    by_place = {location: ident for location, ident in known if ident}
    application = loaded.application
    return View(
        application.name,
        application.description,
        loaded.has_errors,
        tuple(_modules(application, by_place)),
        tuple(_connection(one, by_place) for one in application.connections),
        tuple(_problem(one, known) for one in problems),
    )


def _modules(application: Application, by_place: Mapping[Location, str]) -> Iterator[ModuleView]:
    folder = Path(application.file).parent
    used = _used(application)
    computers = find_computers(folder, DiagnosticLog())
    for module in application.modules:
        opened = ports_of(module, find_description(module.name, folder, DiagnosticLog()))
        yield ModuleView(
            by_place.get(module.location, ""),
            module.tag,
            f"{module.prefix} {Path(module.name).name}".strip(),
            module.command,
            shown_node(module, computers),
            Path(module.location.file).name,
            tuple(one.port for one in module.dependencies),
            tuple(_ports(opened, used)),
        )


def _used(application: Application) -> Mapping[str, list[tuple[str, str]]]:
    """Return the ports that connections and dependencies name, with their kinds, by all beginnings of their names."""
    kinds = {str(one.port): "server" for module in application.modules for one in module.dependencies}
    kinds |= {str(one.target.port): "input" for one in application.connections}
    kinds |= {str(one.source.port): "output" for one in application.connections}
    found: dict[str, list[tuple[str, str]]] = defaultdict(list)
    for name, kind in kinds.items():
        for stem in beginnings(name):
            found[stem].append((name, kind))
    return found


def _ports(opened: OpenedPorts, used: Mapping[str, list[tuple[str, str]]]) -> Iterator[PortView]:
    for name, (kind, channel) in opened.described.items():
        yield PortView(name, kind, channel.type, channel.required)
    for name, kind in used.get(opened.stem, ()) if opened.stem else ():
        if name not in opened.described:
            yield PortView(name, kind, described=False)


def _connection(one: Connection, by_place: Mapping[Location, str]) -> ConnectionView:
    ident = by_place.get(one.location, "")
    return ConnectionView(ident, key_of(one), one.source.port, one.target.port, one.carrier, one.persist)


def key_of(connection: Connection) -> str:
    """Return what identifies a connection among those of the network."""
    return f"{connection.source.port} {connection.target.port}"


def _problem(one: Diagnosed, known: list[tuple[Location, str]]) -> ProblemView:
    place = Location(one.file, one.line, one.column)
    before = [ident for at, ident in known if at.file == one.file and (at.line, at.column) <= (one.line, one.column)]
    return ProblemView(
        str(one.severity), one.text, one.hint, str(place) if one.file else "", before[-1] if before else ""
    )


# The palette ---------------------------------------------------------------------------------------------------------


class ArgumentView(msgspec.Struct, frozen=True):
    """A word of a program's command line."""

    name: str
    required: bool
    default: str
    description: str
    switch: bool


class ProgramView(msgspec.Struct, frozen=True):
    """A program of which there is a description."""

    name: str
    description: str
    file: str
    arguments: tuple[ArgumentView, ...]
    ports: tuple[PortView, ...]


def palette(folder: Path) -> list[ProgramView]:
    """Return the programs that are described beside an application, or where YARP looks; the nearest of each name."""
    shared = ResourceFinder(cwd=folder).search("modules", policy=Policy.ALL, directory=True).paths
    found: dict[str, ProgramView] = {}
    for place in (folder / "modules", folder.parent / "modules", *shared):
        for file in sorted(place.glob("*.xml"))[:_MOST_DESCRIBED]:
            if file.stem in found or len(found) >= _MOST_DESCRIBED:
                continue
            try:
                description = read_description(file, DiagnosticLog())
            except XmlError:  # the check of an application that uses it reports why
                continue
            found[file.stem] = _program(file, description)
    return sorted(found.values(), key=lambda one: one.name)


def _program(file: Path, description: Description) -> ProgramView:
    arguments = (
        ArgumentView(one.name, one.required, one.default, one.description, one.switch) for one in description.arguments
    )
    channels = (
        PortView(one.port, kind, one.type, one.required)
        for kind in ("input", "output", "server", "client")
        for one in getattr(description, f"{kind}s")
    )
    return ProgramView(file.stem, description.description, str(file), tuple(arguments), tuple(channels))
