"""What a request comes to as a program: its file, words, variables and folder, if it may be started."""

from __future__ import annotations

import errno
import os
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.applications.run.children import Launch
from rtf.applications.run.errors import StartError
from rtf.applications.run.protocol import MAX_WORDS, read_environment, split_words
from rtf.applications.run.streams import WINDOW, window_words

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.applications.run.access import RunAccess
    from rtf.applications.run.protocol import Start


def make_launch(request: Start, access: RunAccess, logger: str | None) -> Launch:
    """Return how the program of a request is started; ``logger`` is the port for its output, if there is one.

    Raises StartError.
    """
    words = split_words(request.command)
    if not words or not request.tag:
        raise StartError("it has no command" if not words else "it has no tag; name one with (as TAG)")
    if len(words) > MAX_WORDS:
        raise StartError(f"it has {len(words)} words, and {MAX_WORDS} are the most")
    directory = Path(request.directory or ".").absolute()
    if not directory.is_dir():
        number = errno.ENOTDIR if directory.exists() else errno.ENOENT
        raise StartError(f"cannot set working directory {os.strerror(number)}")
    changed = read_environment(request.environment)
    variables = _variables(changed, forwarded=logger is not None or bool(request.stdio))
    program = _find_program(words[0], directory, variables.get("PATH"))
    access.check_program(program, changed, os.environ)
    return Launch(
        request.tag,
        request.command,
        program,
        words,
        variables,
        str(directory) if request.directory else None,
        request.environment,
        request.hold and not request.stdio,
        logger,
    )


def make_window(request: Start, access: RunAccess) -> Launch:
    """Return how the window for the streams of a program is opened. Raises StartError."""
    words = window_words(request)
    program = _find_program(WINDOW, Path.cwd(), os.environ.get("PATH"))
    access.check_program(program, (), os.environ)
    return Launch(request.tag, WINDOW, program, words, _variables({}, forwarded=False))


def _variables(changed: Mapping[str, str | None], *, forwarded: bool) -> dict[str, str]:
    """Return the environment of a program; ``forwarded`` informs it, as YARP does, that its output goes elsewhere."""
    variables = {**os.environ, "YARP_IS_YARPRUN": "1", "YARPRUN_IS_FORWARDING_LOG": str(int(forwarded))}
    if forwarded:
        variables["PYTHONUNBUFFERED"] = "1"
    for name, value in changed.items():
        if value is None:
            variables.pop(name, None)
        else:
            variables[name] = value
    return variables


def _find_program(name: str, directory: Path, path: str | None) -> str:
    """Find a program as the original does: in the working directory, then on PATH. Raises StartError."""
    here = directory / name
    if here.is_file() and os.access(here, os.X_OK):
        return str(here)
    found = shutil.which(name, path=path) if "/" not in name else None
    if found is None:
        raise StartError(os.strerror(errno.EACCES if here.is_file() else errno.ENOENT))
    return str(Path(found).absolute())
