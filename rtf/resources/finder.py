"""Finds resources in the places where YARP's ResourceFinder looks, in its order, and says which places these were.

YARP tells only which file it took. A file of the same name in the current directory silently wins over the one that
was meant, so here every search reports all its places: what was taken, what exists but came too late, what is
missing.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from enum import Enum, StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.bottle import Property, as_string, to_string
from rtf.resources.arguments import parse_arguments
from rtf.resources.directories import Directory, PathDirectories
from rtf.resources.errors import ResourceNotFoundError
from rtf.resources.property_file import PropertyFile, read_property_file

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence


class Policy(Enum):
    """Whether a search ends with the first place that has the file, or takes them all."""

    FIRST = "first"
    ALL = "all"


class PlaceStatus(StrEnum):
    """What became of a place."""

    FOUND = "found"
    SHADOWED = "exists, but an earlier place has it too"
    MISSING = "missing"
    SKIPPED = "not considered"


@dataclass(frozen=True, slots=True)
class Place:
    """One place of a search: the path that was tried, which rule put it into the order, what came of it and why."""

    path: Path
    rule: str
    status: PlaceStatus
    note: str = ""

    def __str__(self) -> str:
        """Write the place as a line: status, path, rule, and the note if there is one."""
        note = f"; {self.note}" if self.note else ""
        return f"{self.status.name.lower():8} {self.path}  ({self.rule}{note})"


@dataclass(frozen=True, slots=True)
class Search:
    """The outcome of a search: the name asked for and every place, in order."""

    name: str
    places: tuple[Place, ...]

    @property
    def paths(self) -> tuple[Path, ...]:
        """Every path that the policy takes."""
        return tuple(place.path for place in self.places if place.status is PlaceStatus.FOUND)

    @property
    def path(self) -> Path | None:
        """The first path that was found, ``None`` when nothing was."""
        return next(iter(self.paths), None)

    def lines(self) -> list[str]:
        """Render the search for people: a heading with the result, then a line for every place."""
        result = ", ".join(map(str, self.paths)) or "not found"
        return [f"{self.name}: {result}", *(f"  {place}" for place in self.places)]


class ResourceFinder:
    """Looks files up for one program: its contexts, its robot, its environment and its current directory.

    ``contexts`` are tried in order. ``robot`` is the name of the robot's folder; by default ``YARP_ROBOT_NAME``, else
    ``default``. ``roots`` are further directories, searched after YARP's own, for files that travel with a program.
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
        """Configure from a command line: ``--context``, ``--from`` and whatever else overrides the file.

        ``--context`` replaces the contexts, and so does ``default_context`` when it is given and the command line has
        none. The file is read, ``variables`` defining names in it, and the command line is laid over it. A main file
        found in the current directory makes later searches look beside it first and pass contexts over (near-main
        mode). A default file may be absent; one that was asked for and cannot be found raises
        :class:`ResourceNotFoundError`. The result is also kept in :attr:`properties`.
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
        """Try every place for ``name``, below the folder ``resource_type`` of each (``contexts``, ``robots`` …).

        ``directory`` insists on a directory; otherwise all that exists will do. An absolute name is its only place.
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
        """The first file called ``name``; raises :class:`ResourceNotFoundError`, with the places, if there is none."""
        search = self.search(name, resource_type=resource_type)
        if search.path is None:
            raise not_found(search)
        return search.path

    def find_file(self, key: str) -> Path:
        """The file that the configuration names under ``key``, or when it has no such key the file called ``key``."""
        return self.find(as_string(self.properties.find(key)) or key)

    def _candidates(self, name: str, resource_type: str) -> Iterator[tuple[Path, str, str]]:
        """Yield path, rule and, for a place that is passed over, the reason."""
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
    """Make the error that says that a search found nothing, and where it looked."""
    return ResourceNotFoundError("\n".join(search.lines()))


def _exists(path: Path, *, directory: bool) -> bool:
    try:
        return path.is_dir() if directory else path.exists()
    except (OSError, ValueError):  # a place that may not be entered, or a name that no file can have
        return False
