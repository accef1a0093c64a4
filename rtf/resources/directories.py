"""The configuration and data directories of YARP programs, according to the environment."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.bottle import Property, as_string
from rtf.resources.errors import ResourceError
from rtf.resources.property_file import Reader

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable, Iterator, Mapping


@dataclass(frozen=True, slots=True)
class Directory:
    """A directory, the rule that adds it, and the problem that prevents searching it, if any."""

    path: Path
    rule: str
    problem: str = ""


class PathDirectories:
    """The directories to search, in order: the user's, the system's, the installed ones, ``roots``, and ``path.d``.

    A ``YARP_*`` variable is used unchanged; ``yarp`` is appended to an ``XDG_*`` variable or a default.
    """

    def __init__(self, environment: Mapping[str, str], roots: Iterable[str | os.PathLike[str]] = ()) -> None:
        self._environment = environment
        self._roots = [Path(root) for root in roots]

    def all(self) -> Iterator[Directory]:
        """Yield every directory, whether it exists or not."""
        yield from self.user()
        yield from self._list("YARP_CONFIG_DIRS", "XDG_CONFIG_DIRS", "/etc/xdg")
        installed = list(self.installed())
        yield from installed
        for directory in installed:
            yield from _path_d(directory.path / "config" / "path.d", self._environment)

    def user(self) -> Iterator[Directory]:
        """Yield the user's two directories; without ``HOME`` there may be none."""
        yield from self._home("YARP_CONFIG_HOME", "XDG_CONFIG_HOME", ".config")
        yield from self._home("YARP_DATA_HOME", "XDG_DATA_HOME", ".local/share")

    def installed(self) -> Iterator[Directory]:
        """Yield the directories of installed data, and the additional ones of the program."""
        yield from self._list("YARP_DATA_DIRS", "XDG_DATA_DIRS", "/usr/local/share:/usr/share")
        for root in self._roots:
            yield Directory(root, "files of the program")

    def _home(self, own: str, xdg: str, default: str) -> Iterator[Directory]:
        environment = self._environment
        if environment.get(own):
            yield Directory(Path(environment[own]), own)
        elif environment.get(xdg):
            yield Directory(Path(environment[xdg], "yarp"), own)
        elif environment.get("HOME"):
            yield Directory(Path(environment["HOME"], default, "yarp"), own)

    def _list(self, own: str, xdg: str, default: str) -> Iterator[Directory]:
        given = own in self._environment
        paths = self._environment[own] if given else self._environment.get(xdg) or default
        for path in filter(None, paths.split(":")):
            yield Directory(Path(path) if given else Path(path, "yarp"), own)


def _path_d(folder: Path, environment: Mapping[str, str]) -> Iterator[Directory]:
    """Yield the directories that the files of a ``path.d`` folder add."""
    if not folder.is_dir():
        return
    properties, reader = Property(), Reader(None, environment)
    try:
        reader.read(properties, str(folder), reader.trail, None)
    except ResourceError as error:
        yield Directory(folder, "path.d", str(error))
        return
    names = properties.find_group("search")
    for name in names.tail() if names is not None else ():
        section = properties.find_group(as_string(name))
        group = None if section is None else section.find_group("path")
        for path in group.tail() if group is not None else ():
            if as_string(path):
                yield Directory(Path(as_string(path)), f"path.d, {as_string(name)}")
