"""The errors of resources: one base class that names the location, and five subclasses."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.errors import RtfError

if TYPE_CHECKING:
    from rtf.errors import Location


class ResourceError(RtfError):
    """A configuration cannot be found or read; ``location`` is the line that requests or contains it, if any."""

    def __init__(self, message: str, location: Location | None = None) -> None:
        super().__init__(message if location is None else f"{location}: {message}")
        self.location = location


class ResourceNotFoundError(ResourceError, FileNotFoundError):
    """There is no file of this name in any of the places, which the message lists."""


class ResourceReadError(ResourceError, OSError):
    """The file exists, but cannot be read."""


class ResourceSyntaxError(ResourceError, ValueError):
    """A line is invalid even by YARP's liberal rules."""


class ResourceIncludeError(ResourceError, RecursionError):
    """Files include each other in a circle, or the chain of includes is too long."""


class ResourceLimitError(ResourceError, ValueError):
    """The configuration exceeds a limit of size, files or line length."""
