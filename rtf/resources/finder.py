"""The resource finder: it searches YARP's places in YARP's order, and reports all of them; and reading what it finds.

YARP reports only the file that it chose. A file of the same name in the current directory silently takes precedence
over the intended one, so here every search lists its places: the chosen file, existing files with lower precedence, and
missing ones.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from enum import Enum, StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.bottle import Property, as_string, to_string
from rtf.errors import Location
from rtf.resources.arguments import parse_arguments
from rtf.resources.directories import Directory, PathDirectories
from rtf.resources.errors import ResourceNotFoundError
from rtf.resources.lines import split_lines
from rtf.resources.property_file import PropertyFile, Reader, files_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence


class Policy(Enum):
    """Whether a search returns the first place that has the file, or all of them."""

    FIRST = "first"
    ALL = "all"


class PlaceStatus(StrEnum):
    """The result for a place."""

    FOUND = "found"
    SHADOWED = "exists, but an earlier place has it too"
    MISSING = "missing"
    SKIPPED = "not considered"


@dataclass(frozen=True, slots=True)
class Place:
    """A place of a search: the path, the rule that added it, its status, and a note."""

    path: Path
    rule: str
    status: PlaceStatus
    note: str = ""

    def __str__(self) -> str:
        """Return the place as a line: status, path, rule, and the note if there is one."""
        note = f"; {self.note}" if self.note else ""
        return f"{self.status.name.lower():8} {self.path}  ({self.rule}{note})"


@dataclass(frozen=True, slots=True)
class Search:
    """The result of a search: the requested name and all places, in order."""

    name: str
    places: tuple[Place, ...]

    @property
    def paths(self) -> tuple[Path, ...]:
        """The paths that the policy selects."""
        return tuple(place.path for place in self.places if place.status is PlaceStatus.FOUND)

    @property
    def path(self) -> Path | None:
        """The first path that was found, ``None`` if there is none."""
        return next(iter(self.paths), None)

    def lines(self) -> list[str]:
        """Return the search as lines: a heading with the result, then a line for every place."""
        result = ", ".join(map(str, self.paths)) or "not found"
        return [f"{self.name}: {result}", *(f"  {place}" for place in self.places)]


class ResourceFinder:
    """Finds files for a program with its contexts, its robot, its environment and its current directory.

    ``contexts`` are tried in order. ``robot`` is the name of the robot's folder; default: ``YARP_ROBOT_NAME``, else
    ``default``. ``roots`` are additional directories, searched after YARP's own, for files of the program.
    ``environment`` and ``cwd`` default to the process's.
    """

    def __init__(
        self,
        *,
        contexts: Sequence[str] = (),
        robot: str | None = None,
        roots: Iterable[str | os.PathLike[str]] = (),
        environment: Mapping[str, str] | None = None,
        cwd: str | os.PathLike[str] | None = None,
    ) -> None:
        self._environment = os.environ if environment is None else environment
        self.cwd = Path.cwd() if cwd is None else Path(cwd)
        self.contexts = [context for context in contexts if context]
        self.robot = robot or self._environment.get("YARP_ROBOT_NAME") or "default"
        self.near_main = False
        self.properties = Property()
        self._main_directory: Path | None = None
        self._directories = PathDirectories(self._environment, roots)

    def configure(
        self,
        arguments: Iterable[str],
        *,
        default_context: str = "",
        default_file: str = "",
        variables: Property | None = None,
    ) -> PropertyFile:
        """Configure from a command line: ``--context``, ``--from`` and options that override keys of the file.

        ``--context`` replaces the contexts, and so does ``default_context`` if the command line has none. The file is
        read with the names in ``variables``, and the options of the command line override its keys. If the main file is
        in the current directory, later searches look beside it first and skip contexts (near-main mode). A default file
        may be missing; a requested one that cannot be found raises :class:`ResourceNotFoundError`. The result is also
        stored in :attr:`properties`.
        """
        words = list(arguments)
        command = parse_arguments(words)
        context = as_string(command.find("context")) if command.check("context") else default_context
        if context:
            self.contexts = [context]
        name = to_string(command.find("from")) or default_file
        read = PropertyFile(Property())
        if name:
            search = self.search(name)
            if search.path is not None:
                self._main_directory = search.path.parent
                self.near_main = search.places[0].status is PlaceStatus.FOUND
                read = read_property_file(search.path, variables=variables, environment=self._environment, cwd=self.cwd)
            elif command.check("from"):
                raise not_found(search)
        self.properties = parse_arguments(words, into=read.properties)
        return read

    def search(
        self, name: str, *, resource_type: str = "", policy: Policy = Policy.FIRST, directory: bool = False
    ) -> Search:
        """Search every place for ``name``, in the subfolder ``resource_type`` of each (``contexts``, ``robots`` …).

        ``directory`` requires a directory; otherwise any file type is accepted. An absolute name is its only place.
        """
        places: list[Place] = []
        seen: set[Path] = set()
        found = False
        for candidate, rule, note in self._candidates(name, resource_type):
            if candidate in seen:
                continue
            seen.add(candidate)
            status = PlaceStatus.SKIPPED
            if not note:
                status = PlaceStatus.FOUND if _exists(candidate, directory=directory) else PlaceStatus.MISSING
            if status is PlaceStatus.FOUND and found and policy is Policy.FIRST:
                status = PlaceStatus.SHADOWED
            found = found or status is PlaceStatus.FOUND
            places.append(Place(candidate, rule, status, note))
        return Search(name, tuple(places))

    def find(self, name: str, *, resource_type: str = "") -> Path:
        """Return the first file with this name. Raises :class:`ResourceNotFoundError`, with the places."""
        search = self.search(name, resource_type=resource_type)
        if search.path is None:
            raise not_found(search)
        return search.path

    def find_file(self, key: str) -> Path:
        """Return the file that the key ``key`` of the configuration names, or without that key the file ``key``."""
        return self.find(as_string(self.properties.find(key)) or key)

    def _candidates(self, name: str, resource_type: str) -> Iterator[tuple[Path, str, str]]:
        """Yield path, rule and, for a skipped place, the reason."""
        if Path(name).is_absolute():
            yield Path(name), "absolute path", ""
            return
        tail = Path(resource_type, name)
        yield self.cwd / tail, "current directory", ""
        if self._main_directory is not None:
            note = "" if self.near_main else "the main configuration file was not in the current directory"
            yield self._main_directory / tail, "beside the main configuration file", note
        roots = list(self._directories.all())
        for root in roots:
            yield root.path / "robots" / self.robot / tail, f"robot {self.robot} in {root.rule}", root.problem
        note = "the main configuration file was in the current directory" if self.near_main else ""
        for context in self.contexts:
            for root in (Directory(self.cwd, "current directory"), *roots):
                path = root.path / "contexts" / context / tail
                yield path, f"context {context} in {root.rule}", note or root.problem
        for root in roots:
            yield root.path / tail, root.rule, root.problem


def not_found(search: Search) -> ResourceNotFoundError:
    """Return the error of a search without result, with its places."""
    return ResourceNotFoundError("\n".join(search.lines()))


# Reading configuration files, which may import others that the finder finds -----------------------------------------


def read_property_file(
    path: str | os.PathLike[str],
    *,
    variables: Property | None = None,
    environment: Mapping[str, str] | None = None,
    cwd: str | os.PathLike[str] | None = None,
) -> PropertyFile:
    """Read a file, or all ``*.ini`` files of a directory in the order of their names.

    ``variables`` define names for ``${name}``; their key ``CONFIG_PATH`` lists additional directories, separated by
    ``;``, to search for files. ``environment`` defaults to the process's, ``cwd`` to the process's directory. Raises
    only :class:`ResourceError`.
    """
    reader = _reader(variables, environment, cwd)
    target = Property()
    reader.read(target, os.fspath(path), reader.trail, None)
    return reader.result(target)


def read_property_directory(
    path: str | os.PathLike[str],
    section_list: str,
    *,
    variables: Property | None = None,
    environment: Mapping[str, str] | None = None,
) -> PropertyFile:
    """Read every ``*.ini`` of a directory into a section of its own, named by its path and listed in ``section_list``.

    The other arguments and the errors are those of :func:`read_property_file`.
    """
    reader = _reader(variables, environment, None)
    target = Property()
    for file in files_of(Path(path), None):
        reader.include_section(target, str(file), str(file), reader.trail, None)
        reader.add_to_list(target, section_list, str(file), Location(str(file)))
    return reader.result(target)


def parse_property_text(
    text: str,
    *,
    file: str = "<string>",
    variables: Property | None = None,
    environment: Mapping[str, str] | None = None,
    cwd: str | os.PathLike[str] | None = None,
) -> PropertyFile:
    """Parse text as the contents of ``file``; otherwise like :func:`read_property_file`."""
    reader = _reader(variables, environment, cwd)
    target = Property()
    reader.charge(len(text), Location(file))
    reader.read_lines(target, split_lines(text, file), reader.trail)
    return reader.result(target)


def _reader(
    variables: Property | None, environment: Mapping[str, str] | None, cwd: str | os.PathLike[str] | None
) -> Reader:
    def find(context: str, name: str) -> Path | None:
        return ResourceFinder(contexts=[context], environment=environment, cwd=cwd).search(name).path

    return Reader(variables, environment, cwd, find)


def _exists(path: Path, *, directory: bool) -> bool:
    try:
        return path.is_dir() if directory else path.exists()
    except (OSError, ValueError):  # no permission, or an invalid file name
        return False
