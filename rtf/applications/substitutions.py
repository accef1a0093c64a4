"""Programs that do not exist on a machine, and what is started instead: a table in TOML.

A table per program, by its name without folders::

    [iCub_SIM]
    command = "rtf simulator --robot icubSim"    # and the module's own parameters with: parameters = true
    ready = "/icubSim/simulator/rpc:i"           # the port by which it shows that it is ready
    provides = { YARP_ROBOT_NAME = "icubSim" }   # variables for the tests that use it

    [gzclient]
    missing = "the window of a simulator"        # there is none; an application without it is started all the same
    optional = true                              # only if this says so

A program that is on PATH is never replaced. Only modules on this machine are looked at.
"""

from __future__ import annotations

import shutil
import sys
import tomllib
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from rtf.applications.deployers import is_local, program_of
from rtf.applications.errors import ApplicationError
from rtf.applications.run.protocol import join_words, split_words
from rtf.applications.xml.model import Text

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.applications.xml.model import Module

SHIPPED = Path(__file__).with_name("substitutions.toml")
#: A file of this name beside an application is its own table, over the shipped one.
OWN_NAME = "substitutions.toml"


class Entry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What becomes of a program: a ``command`` instead of it, or the reason why it is ``missing``."""

    command: str = ""
    parameters: bool = False
    ready: str = ""
    provides: dict[str, str] = {}
    missing: str = ""
    optional: bool = False


@dataclass(frozen=True, slots=True)
class Substituted:
    """A module as it is started. ``message`` says what was done, empty if nothing. ``missing``: it is not started."""

    module: Module
    message: str = ""
    missing: bool = False
    optional: bool = False
    provides: Mapping[str, str] = field(default_factory=dict)


def read_table(path: Path = SHIPPED) -> Mapping[str, Entry]:
    """Read a table. Raises ApplicationError."""
    try:
        return msgspec.convert(tomllib.loads(path.read_text(encoding="utf-8")), dict[str, Entry])
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, msgspec.ValidationError) as error:
        raise ApplicationError(f"{path}: {getattr(error, 'strerror', None) or error}") from None


def table_of(folder: Path) -> Mapping[str, Entry]:
    """Return the shipped table, with what a folder's own table says instead. Raises ApplicationError."""
    own = folder / OWN_NAME
    return {**read_table(), **(read_table(own) if own.exists() else {})}


def substitute(module: Module, table: Mapping[str, Entry]) -> Substituted:
    """Return what is started for a module."""
    program = program_of(module)
    entry = table.get(Path(program).name)
    if entry is None or not is_local(module.node) or is_there(program, module.workdir):
        return Substituted(module)
    if entry.missing:
        return Substituted(module, f"{program} is not there: {entry.missing}", missing=True, optional=entry.optional)
    first, *rest = split_words(entry.command)
    words = [sys.executable, "-P", "-m", "rtf", *rest] if first == "rtf" else [first, *rest]
    parameters = f"{join_words(words[1:])} {module.parameters if entry.parameters else ''}".rstrip()
    made = replace(
        module,
        name=Text(words[0], module.name.location),
        parameters=Text(parameters, module.parameters.location),
        ready=entry.ready,
        shown=module.command,
    )
    shown = f"{entry.command} {module.parameters if entry.parameters else ''}".rstrip()
    return Substituted(made, f"{module.command} is replaced by: {shown}", provides=entry.provides)


def is_there(program: str, workdir: str) -> bool:
    """Return whether a program is on PATH, or in its working directory, or is a path to one."""
    return shutil.which(program) is not None or shutil.which(Path(workdir or ".", program)) is not None
