"""Where in an author's files something happened: the line that a person wants to see.

That is a line of the plug-in, also where a layer between it and the framework (that of robot tests, say) made the call
or raised the error: a reader of "joint_limits.py:140" knows which step of the test it was.
"""

from __future__ import annotations

import sys
import traceback
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from types import FrameType

#: The modules of all plug-ins begin with it.
PLUGINS = "rtf_plugins."
#: Frames of these files are not the author's; a failure is located and a traceback shown without them.
OWN_FOLDER = str(Path(__file__).parent)


def calling_place(own: str) -> tuple[str, int]:
    """File and line from which ``own``, a file of the framework, was called.

    The nearest frame of a plug-in, or without one the nearest outside of ``own``.
    """
    frame = sys._getframe(1)  # noqa: SLF001 - inspect.stack() reads source files and takes milliseconds
    while frame.f_back is not None and frame.f_code.co_filename in (own, __file__):
        frame = frame.f_back
    nearest = frame
    while not _of_plugin(frame):
        if frame.f_back is None:
            frame = nearest
            break
        frame = frame.f_back
    return frame.f_code.co_filename, frame.f_lineno


def raised_place(error: BaseException) -> tuple[str, int]:
    """File and line of the innermost frame of a plug-in; without one, of the innermost that is not the framework's."""
    place, in_plugin = ("", 0), False
    for frame, line in traceback.walk_tb(error.__traceback__):
        file = frame.f_code.co_filename
        if _of_plugin(frame):
            place, in_plugin = (file, line), True
        elif not in_plugin and not file.startswith((OWN_FOLDER, "<frozen")):
            place = (file, line)
    return place


def _of_plugin(frame: FrameType) -> bool:
    name = frame.f_globals.get("__name__")
    return isinstance(name, str) and name.startswith(PLUGINS)
