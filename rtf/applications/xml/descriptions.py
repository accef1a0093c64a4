"""The descriptions of programs, and of the machines of a lab."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rtf.applications.xml.fields import Fields
from rtf.applications.xml.model import Argument, Channel, Computer, Description
from rtf.applications.xml.tree import read_tree
from rtf.applications.xml.vocabulary import check
from rtf.resources import ResourceFinder
from rtf.resources.finder import Policy
from rtf.xml_tree import XmlError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.testing.suite.diagnostics import DiagnosticLog
    from rtf.xml_tree import Element


def find_description(program: str, beside: Path, problems: DiagnosticLog) -> Description | None:
    """Return the description of a program: ``NAME.xml`` in ``modules`` beside the application, or where YARP looks.

    Problems of its file are collected; one that cannot be read is none.
    """
    name = f"{Path(program).name}.xml"
    places = [folder / "modules" / name for folder in (beside, beside.parent)]
    found = (
        next(filter(Path.is_file, places), None)
        or ResourceFinder(cwd=beside).search(name, resource_type="modules").path
    )
    if found is None or not found.is_file():
        return None
    try:
        return read_description(found, problems)
    except XmlError as error:
        problems.error(error.message, error.location, error.hint)
        return None


def find_computers(beside: Path, problems: DiagnosticLog) -> list[Computer]:
    """Return the machines that files in ``resources`` beside the application, or where YARP looks, describe."""
    found = ResourceFinder(cwd=beside).search("resources", policy=Policy.ALL, directory=True)
    computers: list[Computer] = []
    for path in (path for folder in found.paths for path in sorted(folder.glob("*.xml"))):
        try:
            computers += read_computers(path, problems)
        except XmlError as error:
            problems.error(error.message, error.location, error.hint)
    return computers


def read_description(path: Path, problems: DiagnosticLog) -> Description:
    """Read the description of a program. Raises XmlError."""
    root, fields = _root(path, "module", problems)

    def channels(group: str, name: str) -> tuple[Channel, ...]:
        return tuple(_channel(one, fields) for outer in fields.all(root, group) for one in fields.all(outer, name))

    words = (one for group in fields.all(root, "arguments") for one in fields.all(group, "param", "switch"))
    needs = (one for group in fields.all(root, "dependencies") for one in fields.all(group, "computer"))
    return Description(
        fields.text(root, "name", path.stem),
        fields.text(root, "description"),
        fields.text(root, "version"),
        tuple(_argument(one, fields) for one in words),
        channels("data", "input"),
        channels("data", "output"),
        channels("services", "server"),
        channels("services", "client"),
        tuple(dict(figures(one, fields)) for one in needs),
        str(path),
    )


def read_computers(path: Path, problems: DiagnosticLog) -> tuple[Computer, ...]:
    """Read the machines of a lab. Raises XmlError."""
    root, fields = _root(path, "resources", problems)
    return tuple(
        Computer(
            fields.text(one, "name"),
            fields.text(one, "description"),
            fields.truth(fields.text(one, "disable"), "<disable>"),
            dict(figures(one, fields)),
        )
        for one in fields.all(root, "computer")
    )


def _root(path: Path, kind: str, problems: DiagnosticLog) -> tuple[Element, Fields]:
    root = read_tree(path, problems.warning)
    if root.name != kind:
        raise XmlError(f"the file holds <{root.tag[:40]}>, not <{kind}>", root.location)
    check(root, kind, problems)
    return root, Fields(problems, {}, [0])


def _argument(element: Element, fields: Fields) -> Argument:
    return Argument(
        fields.of(element),
        fields.truth(fields.attribute(element, "required"), "required"),
        fields.attribute(element, "default"),
        fields.attribute(element, "desc"),
        element.name == "switch",
    )


def _channel(element: Element, fields: Fields) -> Channel:
    port = next(fields.all(element, "port"), None)
    return Channel(
        fields.text(element, "port"),
        fields.text(element, "type"),
        fields.attribute(port, "carrier") if port is not None else "",
        fields.truth(fields.text(element, "required"), "<required>"),
        fields.truth(fields.text(element, "priority"), "<priority>"),
        fields.text(element, "description"),
    )


def figures(element: Element, fields: Fields, above: str = "") -> Iterator[tuple[str, str]]:
    """Yield the figures of a machine, by names such as ``memory.total_space``."""
    for child in element.children:
        name = f"{above}{child.name}"
        if child.children:
            yield from figures(child, fields, f"{name}.")
        elif child.text and name not in ("name", "description", "disable"):
            yield name, fields.of(child)
