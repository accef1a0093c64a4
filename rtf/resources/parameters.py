"""The parameters of a robot test: the file in its arguments, found in the context of the suite."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf.bottle import Property, as_string, to_string
from rtf.errors import Location
from rtf.resources.arguments import parse_arguments, split_arguments
from rtf.resources.errors import ResourceSyntaxError
from rtf.resources.finder import ResourceFinder, Search, not_found, read_property_file

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from rtf.resources.lines import Diagnostic

DEFAULT_CONTEXT = "RobotTesting"


@dataclass(frozen=True, slots=True)
class Parameters:
    """The parameters of a test, and how they were found.

    ``properties`` are the contents of the file, or the arguments if these name no file. ``arguments`` and
    ``environment`` are the inputs, for a caller that lets single arguments override the file. ``searches`` has one
    entry per search.
    """

    properties: Property
    arguments: Property
    environment: Property
    file: Path | None = None
    searches: tuple[Search, ...] = ()
    diagnostics: tuple[Diagnostic, ...] = ()


def find_parameters(
    arguments: str | Iterable[str],
    environment: str = "",
    *,
    roots: Iterable[str | os.PathLike[str]] = (),
    process_environment: Mapping[str, str] | None = None,
    cwd: str | os.PathLike[str] | None = None,
) -> Parameters:
    """Find the parameters of a test from its arguments and the environment string of its suite.

    The context is ``--context`` of the arguments, else of the environment, else ``RobotTesting``. Only if neither has
    one and the file of ``--from`` is not found, ``--robotname`` of the environment is tried as the context. The keys of
    the environment are variables in the file. Raises :class:`ResourceError` for an empty ``--from``, for a file that is
    not found (with all places) and for one that cannot be read.
    """
    command = parse_arguments(split_arguments(arguments) if isinstance(arguments, str) else arguments)
    suite = parse_arguments(split_arguments(environment))
    if not command.check("from"):
        return Parameters(command, command, suite)
    name = to_string(command.find("from"))
    if not name:
        raise ResourceSyntaxError("the argument --from names no file", Location("arguments"))
    searches = []
    for context in _contexts(command, suite):
        finder = ResourceFinder(contexts=[context], roots=roots, environment=process_environment, cwd=cwd)
        search = finder.search(name)
        searches.append(search)
        if search.path is not None:
            read = read_property_file(search.path, variables=suite, environment=process_environment, cwd=cwd)
            return Parameters(read.properties, command, suite, search.path, tuple(searches), read.diagnostics)
    raise not_found(Search(name, tuple(place for search in searches for place in search.places)))


def _contexts(command: Property, suite: Property) -> list[str]:
    for source in (command, suite):
        if source.check("context"):
            return [as_string(source.find("context"))]
    robot = as_string(suite.find("robotname"))
    return [DEFAULT_CONTEXT, robot] if robot else [DEFAULT_CONTEXT]
