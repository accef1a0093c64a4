"""The files of a robot as one tree: each ``xi:include`` is replaced by the first element of the named file.

Only files below the folder of the configuration are read; symbolic links are resolved before the check.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf import xml_tree
from rtf.errors import Location
from rtf.robot.interface.problems import RobotFileError

if TYPE_CHECKING:
    from pathlib import Path

    from rtf.robot.interface.problems import ProblemLog
    from rtf.xml_tree import Document, Element

INCLUDE = "xi:include"
#: The document type line of a robot's file.
DOCTYPE = (
    '<!DOCTYPE robot PUBLIC "-//YARP//DTD yarprobotinterface 3.0//EN"'
    ' "http://www.yarp.it/DTD/yarprobotinterfaceV3.0.dtd">'
)
MAX_DEPTH = 16
MAX_FILES = 1000
MAX_VALUE = 64 << 10  # characters of one attribute or text
MAX_BYTES = 32 << 20  # of all files

_PUBLIC = re.compile(r"-//YARP//DTD yarprobotinterface ([0-9]{1,3})\.([0-9]{1,3})//EN")
_READ, _DEPRECATED, _NEVER_SUPPORTED = 3, 1, 2


@dataclass(frozen=True, slots=True)
class Tags:
    """The tags that include or exclude parts of a robot. ``everything`` enables all."""

    enabled: frozenset[str] = frozenset()
    disabled: frozenset[str] = frozenset()
    everything: bool = False

    def include(self, enabled_by: str | None, disabled_by: str | None) -> bool:
        """Return whether an element with these ``enabled_by`` and ``disabled_by`` attributes is included."""
        wanted = enabled_by is None or self.everything or not self.enabled.isdisjoint(enabled_by.split())
        return wanted and self.disabled.isdisjoint((disabled_by or "").split())


def load(path: Path, tags: Tags, problems: ProblemLog, *, allow_deprecated: bool = False) -> Element:
    """Return the tree of a file with all includes. A file that cannot be included is a problem and left out.

    Raises RobotFileError if the first file cannot be read.
    """
    try:
        folder = path.parent.resolve()
        real = path.resolve()
    except (OSError, RuntimeError, ValueError) as error:
        raise RobotFileError.of(Location(str(path)), f"cannot be found: {error}", "fix the path") from None
    loader = _Loader(folder, tags, problems, allow_deprecated=allow_deprecated)
    return loader.load(path, (real,), Location(str(path)))


class _Loader:
    """Reads files, and enforces the limits on their total."""

    def __init__(self, folder: Path, tags: Tags, problems: ProblemLog, *, allow_deprecated: bool) -> None:
        self._folder = folder
        self._tags = tags
        self._problems = problems
        self._allow_deprecated = allow_deprecated
        self._files = 0
        self._bytes = 0
        self._elements = 0

    def load(self, path: Path, trail: tuple[Path, ...], asked: Location) -> Element:
        """Return the tree of one file; its resolved path is the last of ``trail``. Raises RobotFileError."""
        try:
            document = xml_tree.parse(self._read(path, trail[-1], asked), str(path), declarations=True)
        except xml_tree.XmlError as error:
            raise RobotFileError.of(error.location, error.message, error.hint) from None
        root = document.root
        assert root is not None  # of a file that is well-formed
        self._elements += document.elements
        if self._elements > xml_tree.MAX_ELEMENTS:
            raise RobotFileError.of(asked, f"the files of the robot have more than {xml_tree.MAX_ELEMENTS} elements")
        old = self._version(document, root) == _DEPRECATED
        if root.tag == INCLUDE:
            raise RobotFileError.of(root.location, f"a file cannot begin with <{INCLUDE}>")
        self._replace_includes(root, path, trail, "file" if old else None)
        return root

    def _read(self, path: Path, real: Path, asked: Location) -> bytes:
        self._files += 1
        if self._files > MAX_FILES:
            raise RobotFileError.of(asked, f"the robot has more than {MAX_FILES} files", "put some together")
        try:
            data = _bytes_of(real)
        except (OSError, ValueError) as error:
            why = getattr(error, "strerror", None) or error
            raise RobotFileError.of(asked, f"{str(path)[:500]} cannot be read: {why}", "fix the path") from None
        self._bytes += len(data)
        if self._bytes > MAX_BYTES:
            raise RobotFileError.of(asked, f"the files of the robot are larger than {MAX_BYTES >> 20} MiB")
        return data

    def _replace_includes(self, element: Element, path: Path, trail: tuple[Path, ...], old: str | None) -> None:
        """Replace the includes below an element. ``old``: the attribute that includes a file in version 1."""
        _check_sizes(element)
        children: list[Element] = []
        for child in element.children:
            if child.tag != INCLUDE and old not in child.attributes:
                self._replace_includes(child, path, trail, old)
                children.append(child)
            elif self._tags.include(child.attributes.get("enabled_by"), child.attributes.get("disabled_by")):
                children += self._included(child, path, trail)
        element.children = children

    def _included(self, node: Element, path: Path, trail: tuple[Path, ...]) -> list[Element]:
        """Return the replacement of an include: one element, or none after an error, which is recorded."""
        try:
            return [self._follow(node, path, trail)]
        except RobotFileError as error:
            for problem in error.problems:
                if problem not in self._problems.errors:
                    self._problems.error(problem.location, problem.sentence, problem.hint)
            return []

    def _follow(self, node: Element, path: Path, trail: tuple[Path, ...]) -> Element:
        target, real = self._locate(node, path)
        if real in trail:
            circle = " -> ".join(one.name for one in (*trail[trail.index(real) :], real))
            raise RobotFileError.of(node.location, f"files include each other: {circle}", "cut the circle")
        if len(trail) >= MAX_DEPTH:
            raise RobotFileError.of(node.location, f"includes are nested deeper than {MAX_DEPTH}", "put some together")
        return self.load(target, (*trail, real), node.location)

    def _locate(self, node: Element, path: Path) -> tuple[Path, Path]:
        """Return the path of an include as written, and its resolved path, which is in the folder."""
        href = node.attributes.get("href" if node.tag == INCLUDE else "file", "").strip()
        if not href:
            raise RobotFileError.of(node.location, f"<{INCLUDE}> names no file", 'write href="FILE.xml"')
        target = path.parent / href
        try:
            real = target.resolve()
        except (OSError, RuntimeError, ValueError) as error:
            raise RobotFileError.of(node.location, f"{href[:200]!r} is not a path: {error}") from None
        if not real.is_relative_to(self._folder):
            leads = "" if real == target.absolute() else f" (it leads to {real})"
            raise RobotFileError.of(
                node.location,
                f"{href!r} is outside of the folder of the configuration, {self._folder}{leads}",
                "copy the file into it; only files in it are read",
            )
        return target, real

    def _version(self, document: Document, root: Element) -> int:
        """Return the version of the format. An unsupported one is recorded as an error."""
        if not document.doctype:
            self._problems.warn(root.location, "the file has no document type, 3.0 is assumed", f"begin with {DOCTYPE}")
            return _READ
        place = document.doctype_location
        if document.doctype != root.tag:
            self._problems.warn(place, f"the document type is {document.doctype!r}, but the file holds <{root.tag}>")
        version = _PUBLIC.fullmatch(document.public_id)
        if version is None:
            self._problems.error(
                place, f"{document.public_id!r} is not a document type of robots", f"begin with {DOCTYPE}"
            )
            return _READ
        major = int(version[1])
        if major == _DEPRECATED and not self._allow_deprecated:
            self._problems.error(
                place, "version 1 of the format is deprecated", "give --allow-deprecated-dtd, or write 3.0"
            )
        elif major not in (_READ, _DEPRECATED):
            known = "was never supported" if major == _NEVER_SUPPORTED else "is not known"
            self._problems.error(place, f"version {version[1]}.{version[2]} of the format {known}", "write version 3.0")
        return major


def _check_sizes(element: Element) -> None:
    """Refuse what is longer than anything that a robot needs. Raises RobotFileError."""
    for name, value in element.attributes.items():
        if len(name) + len(value) > MAX_VALUE:
            text = f"an attribute of <{element.tag[:40]}> is longer than {MAX_VALUE >> 10} KiB"
            raise RobotFileError.of(element.location, text, "shorten it")
    if len(element.text) > MAX_VALUE:
        raise RobotFileError.of(element.location, f"a text is longer than {MAX_VALUE >> 10} KiB", "shorten it")


def _bytes_of(path: Path) -> bytes:
    """Read a file, up to one byte more than allowed. Raises OSError, also for anything but a regular file."""
    if not path.is_file():
        raise FileNotFoundError("there is no such file")
    with path.open("rb") as stream:
        return stream.read(xml_tree.MAX_BYTES + 1)
