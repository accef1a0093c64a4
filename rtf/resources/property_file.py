"""The parser of configuration files in the YARP property file format.

A line is ``key value…`` or ``key = value…``; ``[section]`` begins a group of keys and ``[]`` ends it; ``[list name]``
adds a name to a list and begins the section ``name``; ``[include …]`` and ``[import …]`` read other files. What YARP
silently accepts but is rarely intended is accepted, too, and reported as a :class:`Diagnostic`.

Of a repeated key outside sections the last one counts. Inside a section both are kept, and look-ups find the first.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, BottleError, BottleLimitError, Property, as_string, to_string
from rtf.errors import Location
from rtf.resources.errors import (
    ResourceIncludeError,
    ResourceLimitError,
    ResourceNotFoundError,
    ResourceReadError,
    ResourceSyntaxError,
)
from rtf.resources.lines import Diagnostic, DiagnosticKind, Line, join_lines, split_lines
from rtf.resources.variables import Variables

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from rtf.resources.lines import LogicalLine

MAX_SIZE = 16 << 20
"""The largest configuration, in characters read and expanded; iCub's largest has some 100 kilobytes."""
MAX_FILES = 1000
MAX_INCLUDE_DEPTH = 32
MAX_DIAGNOSTICS = 1000
_INCLUDE_SIZES = (2, 3, 4)
_IMPORT_SIZE = 3
_NAMED_SECTION_SIZE = 2


@dataclass(frozen=True, slots=True)
class PropertyFile:
    """A parsed configuration: the keys, the diagnostics, and all files that were read, in order."""

    properties: Property
    diagnostics: tuple[Diagnostic, ...] = ()
    files: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class _Trail:
    """The search directories of included files, and the files that are being read, outermost first."""

    search: tuple[str, ...]
    chain: tuple[str, ...] = ()


class Reader:
    """The reading of a configuration with all its includes: the limits, and the diagnostics.

    ``find`` returns the file of a context, for ``[import context file]``; without it such a line is an error.
    """

    def __init__(
        self,
        variables: Property | None,
        environment: Mapping[str, str] | None,
        cwd: str | os.PathLike[str] | None = None,
        find: Callable[[str, str], Path | None] | None = None,
    ) -> None:
        given = Property() if variables is None else variables
        self._environment = os.environ if environment is None else environment
        self._variables = Variables(self._environment, given)
        self._cwd = Path.cwd() if cwd is None else Path(cwd)
        self._find = find
        self._diagnostics: list[Diagnostic] = []
        self._files: list[str] = []
        self._size = 0
        self.trail = _Trail(tuple(part for part in as_string(given.find("CONFIG_PATH")).split(";") if part))

    def result(self, properties: Property) -> PropertyFile:
        """Return the keys with what was found while they were read."""
        return PropertyFile(properties, tuple(self._diagnostics), tuple(self._files))

    def charge(self, size: int, location: Location | None) -> None:
        """Count characters that are read or expanded. Raises :class:`ResourceLimitError` when they are too many."""
        self._size += size
        if self._size > MAX_SIZE:
            raise ResourceLimitError(f"the configuration is larger than {MAX_SIZE} characters", location)

    def report(self, diagnostic: Diagnostic) -> None:
        """Keep a diagnostic, unless there are too many."""
        if len(self._diagnostics) < MAX_DIAGNOSTICS:
            self._diagnostics.append(diagnostic)

    def read(self, target: Property, name: str, trail: _Trail, location: Location | None) -> None:
        """Read a file or a directory into ``target``."""
        path = self._locate(name, trail.search, location)
        real = os.path.realpath(path)
        if real in trail.chain:
            raise ResourceIncludeError(f"{name} includes itself: {' -> '.join((*trail.chain, real))}", location)
        if len(trail.chain) >= MAX_INCLUDE_DEPTH:
            raise ResourceIncludeError(f"{name} is included {MAX_INCLUDE_DEPTH} files deep", location)
        lines = self._directory_lines(path, location) if path.is_dir() else self._file_lines(path, location)
        self.read_lines(target, lines, _Trail((*trail.search, str(path.parent)), (*trail.chain, real)))

    def _locate(self, name: str, search: tuple[str, ...], location: Location | None) -> Path:
        candidates = [self._cwd / name, *(self._cwd / directory / name for directory in search)]
        for candidate in candidates:
            if _is_readable(candidate):
                return candidate
        tried = ", ".join(dict.fromkeys(map(str, candidates)))
        raise ResourceNotFoundError(f"there is no file {name!r}; tried {tried}", location)

    def _file_lines(self, path: Path, location: Location | None) -> Iterator[Line]:
        if len(self._files) == MAX_FILES:
            raise ResourceLimitError(f"the configuration has more than {MAX_FILES} files", location)
        try:
            with path.open("rb") as stream:
                data = stream.read(MAX_SIZE + 1)
        except OSError as error:
            raise ResourceReadError(f"cannot read {path}: {error.strerror}", location) from error
        self._files.append(str(path))
        self.charge(len(data), Location(str(path)))
        text = data.decode("utf-8", "surrogateescape").removeprefix("\ufeff")
        return split_lines(text, str(path))

    def _directory_lines(self, path: Path, location: Location | None) -> Iterator[Line]:
        for file in files_of(path, location):
            yield from self._file_lines(file, location)
            yield Line("[]", str(file), 0)

    def read_lines(self, target: Property, lines: Iterable[Line], trail: _Trail) -> None:
        """Read lines into ``target``, starting outside all sections."""
        section = ""
        for line in join_lines(lines):
            for diagnostic in line.diagnostics():
                self.report(diagnostic)
            try:
                text = self._expanded(line, target) if line.balanced else line.text
                if text.startswith("[") and "]" in text and line.balanced:
                    section = self._header(target, text[1 : text.index("]")], line.location, trail)
                elif text:
                    self._add(target, section, Bottle.parse(text), line.location)
            except BottleError as error:
                kind = ResourceLimitError if isinstance(error, BottleLimitError) else ResourceSyntaxError
                raise kind(str(error), line.location) from error

    def _expanded(self, line: LogicalLine, target: Property) -> str:
        text = line.without_comment()
        if "$" not in text:
            return text
        try:
            text, undefined = self._variables.expand(text, target, MAX_SIZE - self._size)
        except ResourceLimitError as error:
            raise ResourceLimitError(str(error), line.location) from None
        self.charge(len(text), line.location)
        for name in undefined:
            message = f"the variable {name!r} is not defined; it becomes empty"
            self.report(Diagnostic(DiagnosticKind.UNDEFINED_VARIABLE, message, line.location, name))
        return text

    def _add(self, target: Property, section: str, group: Bottle, location: Location) -> None:
        if not group:
            return
        if as_string(group.get(1)) == "=":
            del group[1]
        key = to_string(group[0])
        parent = target.find_group(section) if section else None
        earlier = target.location(key) if parent is None else target.location(section, key)
        if earlier is not None and earlier.file == location.file:
            counts = "the last one" if parent is None else "the first one"
            message = f"{key!r} was given before, at {earlier}; {counts} counts"
            self.report(Diagnostic(DiagnosticKind.REPEATED_KEY, message, location, key))
        if parent is None:
            target.put_group(group, key=key, location=location)
        else:
            parent.append(group)
            if earlier is None:
                target.locate(location, section, key)

    def _header(self, target: Property, header: str, location: Location, trail: _Trail) -> str:
        """Execute a line in square brackets; return the section that is open afterwards, if any."""
        words = [to_string(word) for word in Bottle.parse(header)] if " " in header else []
        if len(words) > 1 and words[0] == "include":
            self._include(target, words[1:], location, trail)
            return ""
        if len(words) > 1 and words[0] == "import":
            self._import(target, words[1:], location, trail)
            return ""
        name = header
        if len(words) == _NAMED_SECTION_SIZE:
            key, name = words
            self.add_to_list(target, key, name, location)
        if name and not target.check(name):
            target.put_group(Bottle([name]), key=name, location=location)
        return name

    def add_to_list(self, target: Property, key: str, name: str, location: Location) -> None:
        """Add a name to the list that a key holds, which begins with the first one."""
        names = target.find_group(key)
        if names is None:
            target.put(key, name, location=location)
        else:
            names.append(name)

    def _include(self, target: Property, words: list[str], location: Location, trail: _Trail) -> None:
        if len(words) + 1 not in _INCLUDE_SIZES:
            raise ResourceSyntaxError("an include names a file, or a section and a file, or a list too", location)
        if len(words) == 1:
            self.read(target, words[0], trail, location)
            return
        *names, section, file = words
        for name in names:
            self.add_to_list(target, name, section, location)
        self.include_section(target, section, file, trail, location)

    def include_section(
        self, target: Property, section: str, name: str, trail: _Trail, location: Location | None
    ) -> None:
        """Read a file into a section, added to its present contents."""
        before = (target.find_group(section) or Bottle()).tail()
        self.charge(len(before), location)
        inner = Property.from_bottle(before)
        for key in inner:
            place = target.location(section, key)
            if place is not None:
                inner.locate(place, key)
        self.read(inner, name, trail, location)
        if not len(inner):
            return
        target.put_group(Bottle([section, *inner.to_bottle()]), key=section, location=location)
        for key in inner:
            place = inner.location(key)
            if place is not None:
                target.locate(place, section, key)

    def _import(self, target: Property, words: list[str], location: Location, trail: _Trail) -> None:
        if len(words) + 1 != _IMPORT_SIZE:
            raise ResourceSyntaxError("an import is [import context file]", location)
        if self._find is None:
            raise ResourceIncludeError("a file that says where to search cannot import another", location)
        path = self._find(*words)
        if path is None:
            raise ResourceNotFoundError(f"there is no file {words[1]!r} in the context {words[0]!r}", location)
        self.read(target, str(path), trail, location)


def _is_readable(path: Path) -> bool:
    try:
        return path.is_file() or path.is_dir()
    except (OSError, ValueError):  # an invalid file name
        return False


def files_of(path: Path, location: Location | None) -> list[Path]:
    """Return the ``*.ini`` files of a directory, in the order of their names."""
    try:
        return sorted(file for file in path.iterdir() if file.name.endswith(".ini"))
    except OSError as error:
        raise ResourceReadError(f"cannot read the directory {path}: {error.strerror}", location) from error
