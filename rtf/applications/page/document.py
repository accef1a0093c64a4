"""An application's file as the page edits it: its own modules and connections as texts, written back into its tree.

The browser gets a :class:`Document` and sends it back changed. Only what differs is changed in the tree, so all that
the page does not know, such as comments, variables and rules of arbitrators, stays in the file.
"""

from __future__ import annotations

import hashlib
import math
from typing import TYPE_CHECKING

import msgspec

from rtf.applications.errors import ApplicationError
from rtf.applications.xml.tree import parse_tree, read_bytes, to_bytes
from rtf.bottle import Bottle, BottleError, as_float
from rtf.errors import Location
from rtf.xml_tree import Element, XmlError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

#: The elements of a module that the page edits: those with a text.
MODULE_TEXTS = ("name", "parameters", "node", "prefix", "workdir", "environment", "deployer", "stdio", "display")
#: An id begins with this; the number of the element among the children of the root follows.
_MODULE, _CONNECTION = "m", "c"
_GEOMETRY, _DEPENDENCIES, _PORT = "geometry", "dependencies", "port"
#: The attributes of a dependency.
_CONDITIONS = ("timeout", "request", "reply")
#: The names of the ends of a connection.
_SOURCE, _TARGET = ("from", "output"), ("to", "input")


class ChangedError(ApplicationError):
    """The file is not any more what the page has read."""


class DependencyText(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A port for which a module waits, as written: how long, and the reply that it has to give to a request."""

    port: str
    timeout: str = ""
    request: str = ""
    reply: str = ""


class ModuleText(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A module of the file: its texts as written, variables included, what it waits for, and the place of its box."""

    id: str
    name: str = ""
    parameters: str = ""
    node: str = ""
    prefix: str = ""
    workdir: str = ""
    environment: str = ""
    deployer: str = ""
    stdio: str = ""
    display: str = ""
    dependencies: tuple[DependencyText, ...] = ()
    x: float | None = None
    y: float | None = None


class ConnectionText(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A connection of the file, as written. External ends are ports of programs that the application does not have."""

    id: str
    source: str = ""
    target: str = ""
    protocol: str = ""
    persist: bool = False
    source_external: bool = False
    target_external: bool = False


class Document(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What of a file is edited. ``revision`` identifies the content of the file that it was read from."""

    revision: str
    modules: tuple[ModuleText, ...] = ()
    connections: tuple[ConnectionText, ...] = ()


def read_document(path: Path) -> tuple[Document, Element]:
    """Read a file, and return it with its tree. Raises XmlError."""
    data = read_bytes(path)
    root = _application(parse_tree(data, str(path)))
    return document_of(root, _revision(data)), root


def document_of(root: Element, revision: str = "") -> Document:
    """Return the document of a tree."""
    modules, connections = [], []
    for index, child in enumerate(root.children):
        if child.name == "module":
            modules.append(_module(f"{_MODULE}{index}", child))
        elif child.name == "connection":
            connections.append(_connection(f"{_CONNECTION}{index}", child))
    return Document(revision, tuple(modules), tuple(connections))


def parse_document(data: bytes) -> Document:
    """Read what a browser has sent. Raises ApplicationError."""
    try:
        return msgspec.json.decode(data, type=Document)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ApplicationError(f"the request is no application: {error}") from None


def edited(path: Path, document: Document) -> tuple[bytes, list[str]]:
    """Return the file with the changes of a document, and the ids of modules and connections in its order.

    Raises XmlError; ChangedError if the file has changed since the document was read; ApplicationError for a text that
    XML cannot hold.
    """
    before, root = read_document(path)
    if before.revision != document.revision:
        raise ChangedError(f"{path} was changed by another program; reload the page to see its new content")
    ids = _apply(root, before, document)
    try:
        data = to_bytes(root)
        parse_tree(data, str(path))
    except (XmlError, UnicodeEncodeError):
        raise ApplicationError("a text has characters that XML cannot hold, such as control characters") from None
    return data, ids


def save(path: Path, document: Document) -> None:
    """Write the changes of a document into its file, which is replaced whole. Raises as :func:`edited`, and OSError."""
    data, _ = edited(path, document)
    path = path.resolve()
    beside = path.with_name(f".{path.name}.new")
    beside.write_bytes(data)
    beside.chmod(path.stat().st_mode)
    beside.replace(path)


def _revision(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _application(root: Element) -> Element:
    if root.name != "application":
        raise XmlError(f"the file holds <{root.tag[:40]}>", root.location, "an application begins with <application>")
    return root


# From the tree -------------------------------------------------------------------------------------------------------


def _module(ident: str, element: Element) -> ModuleText:
    place = _place(element)
    texts = {name: _text(element, name) for name in MODULE_TEXTS}
    x, y = place or (None, None)
    return ModuleText(ident, **texts, dependencies=tuple(map(_dependency, _needed_ports(element))), x=x, y=y)


def _needed_ports(module: Element) -> list[Element]:
    groups = (one for one in module.children if one.name == _DEPENDENCIES)
    return [one for group in groups for one in group.children if one.name == _PORT]


def _dependency(element: Element) -> DependencyText:
    return DependencyText(element.text, *(element.attributes.get(name, "").strip() for name in _CONDITIONS))


def _connection(ident: str, element: Element) -> ConnectionText:
    return ConnectionText(
        ident,
        _text(element, *_SOURCE),
        _text(element, *_TARGET),
        _text(element, "protocol"),
        _is_true(element, "persist"),
        _is_true(_child(element, *_SOURCE), "external"),
        _is_true(_child(element, *_TARGET), "external"),
    )


def _child(element: Element, *names: str) -> Element | None:
    return next((one for one in element.children if one.name in names), None)


def _text(element: Element, *names: str) -> str:
    found = _child(element, *names)
    return found.text if found is not None else ""


def _is_true(element: Element | None, name: str) -> bool:
    word = "" if element is None else element.attributes.get(name, "").strip().lower()
    return word in ("true", "yes", "1", "on")


def _place(module: Element) -> tuple[float, float] | None:
    """Return the place of a box, from a geometry such as ``(Pos (x 10) (y 20))``; None without one."""
    try:
        group = Bottle.parse(_text(module, _GEOMETRY)).find_group("Pos")
    except BottleError:
        return None
    if group is None or not (group.check("x") and group.check("y")):
        return None
    x, y = as_float(group.find("x")), as_float(group.find("y"))
    return (x, y) if math.isfinite(x) and math.isfinite(y) else None


# Into the tree -------------------------------------------------------------------------------------------------------


def _apply(root: Element, before: Document, after: Document) -> list[str]:
    """Change a tree, and return the ids of its modules and connections in their order."""
    was, now = _by_id(before), _by_id(after)
    kept: list[tuple[str, Element]] = []
    for index, child in enumerate(root.children):
        ident = next((f"{kind}{index}" for kind in (_MODULE, _CONNECTION) if f"{kind}{index}" in was), "")
        if ident and ident not in now:
            continue
        if ident:
            _write(child, was[ident], now[ident])
        kept.append((ident, child))
    _insert(kept, "module", [one for one in after.modules if one.id not in was])
    _insert(kept, "connection", [one for one in after.connections if one.id not in was])
    root.children = [child for _, child in kept]
    return [ident for ident, _ in kept if ident]


def _by_id(document: Document) -> dict[str, ModuleText | ConnectionText]:
    found: dict[str, ModuleText | ConnectionText] = {one.id: one for one in document.modules}
    return found | {one.id: one for one in document.connections}


def _insert(kept: list[tuple[str, Element]], name: str, new: Sequence[ModuleText | ConnectionText]) -> None:
    """Put new elements behind the last of their kind; the first module goes before the first connection."""
    last = max((index for index, (_, one) in enumerate(kept) if one.name == name), default=-1)
    first = next((index for index, (_, one) in enumerate(kept) if one.name == "connection"), len(kept))
    place = last + 1 if last >= 0 else first
    for one in reversed(new):
        element = _element(name)
        _write(element, type(one)(one.id), one)
        kept.insert(place, (one.id, element))


def _write(element: Element, was: ModuleText | ConnectionText, now: ModuleText | ConnectionText) -> None:
    if isinstance(was, ModuleText) and isinstance(now, ModuleText):
        for name in MODULE_TEXTS:
            _set_text(element, getattr(was, name), getattr(now, name), name)
        if was.dependencies != now.dependencies:
            _set_dependencies(element, now.dependencies)
        if (was.x, was.y) != (now.x, now.y) and now.x is not None and now.y is not None:
            _set_place(element, now.x, now.y)
    elif isinstance(was, ConnectionText) and isinstance(now, ConnectionText):
        _set_text(element, was.source, now.source, *_SOURCE)
        _set_text(element, was.target, now.target, *_TARGET)
        _set_text(element, was.protocol, now.protocol, "protocol")
        _set_true(element, "persist", was=was.persist, now=now.persist)
        _set_true(_child(element, *_SOURCE), "external", was=was.source_external, now=now.source_external)
        _set_true(_child(element, *_TARGET), "external", was=was.target_external, now=now.target_external)
    else:
        raise ApplicationError(f"the id {now.id!r} is that of a module and of a connection")


def _set_text(element: Element, was: str, now: str, *names: str) -> None:
    now = now.strip()
    if was == now:
        return
    found = _child(element, *names)
    if not now and found is not None and not found.attributes:
        element.children.remove(found)
        return
    if found is None:
        found = _element(names[0])
        element.children.append(found)
    found.pieces = [now]


def _set_true(element: Element | None, name: str, *, was: bool, now: bool) -> None:
    if element is not None and was != now:
        others = {key: value for key, value in element.attributes.items() if key != name}
        element.attributes = {**others, name: "true"} if now else others


def _set_dependencies(module: Element, wanted: Sequence[DependencyText]) -> None:
    """Write the ports for which a module waits. Those that are the same keep their elements with all that they have."""
    groups = [one for one in module.children if one.name == _DEPENDENCIES]
    before = _needed_ports(module)
    made = []
    for one in wanted:
        found = next((old for old in before if _dependency(old) == one), None)
        found = found or next((old for old in before if old.text == one.port), None)
        if found is None:
            found = _element(_PORT)
        else:
            before.remove(found)
        _set_dependency(found, one)
        made.append(found)
    if not groups and made:
        groups = [_element(_DEPENDENCIES)]
        module.children.append(groups[0])
    for number, group in enumerate(groups):
        others = [one for one in group.children if one.name != _PORT]
        group.children = [*others, *(made if number == 0 else ())]
        if not group.children:
            module.children.remove(group)


def _set_dependency(element: Element, now: DependencyText) -> None:
    if _dependency(element) != now:
        element.pieces = [now.port.strip()]
        others = {key: value for key, value in element.attributes.items() if key not in _CONDITIONS}
        given = {name: text for name in _CONDITIONS if (text := getattr(now, name).strip())}
        element.attributes = {**others, **given}


def _set_place(module: Element, x: float, y: float) -> None:
    """Write the place into the geometry, of which all else is kept."""
    if not (math.isfinite(x) and math.isfinite(y)):
        raise ApplicationError("the place of a box is not a number")
    was = _text(module, _GEOMETRY)
    try:
        lists = [*Bottle.parse(was)]
    except BottleError:
        lists = []
    others = [one for one in lists if not (isinstance(one, Bottle) and one.get(0) == "Pos")]
    place = Bottle(["Pos", ["x", round(x, 1)], ["y", round(y, 1)]])
    _set_text(module, was, Bottle([place, *others]).to_text(), _GEOMETRY)


def _element(name: str) -> Element:
    return Element(name, name, {}, Location(), 0, b"")


def ids_of(document: Document) -> list[str]:
    """Return the ids of a document as it was read, in the order of the file."""
    return sorted(_by_id(document), key=lambda ident: int(ident[1:]))


def places(root: Element, ids: Sequence[str]) -> Iterator[tuple[Location, str]]:
    """Yield where each child of a root begins, and the id of it if it has one."""
    remaining = iter(ids)
    for child in root.children:
        yield child.location, next(remaining) if child.name in ("module", "connection") else ""
