"""What can go wrong with resources: one base error that names the place, and five leaves."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.errors import RtfError

if TYPE_CHECKING:
    from rtf.errors import Location


class ResourceError(RtfError):
    """A configuration that cannot be found or read; ``location`` is the line that asked for it or holds it, if any."""

    def __init__(self, message: str, location: Location | None = None) -> None:
        super().__init__(message if location is None else f"{location}: {message}")
        self.location = location


class ResourceNotFoundError(ResourceError, FileNotFoundError):
    """No file of that name in any of the places, which the message lists."""


class ResourceReadError(ResourceError, OSError):
    """The file is there and the system refuses to give its contents."""


class ResourceSyntaxError(ResourceError, ValueError):
    """A line that has no meaning even to a reader as liberal as YARP's."""


class ResourceIncludeError(ResourceError, RecursionError):
    """Files that include each other in a circle, or a chain of includes that is too long."""


class ResourceLimitError(ResourceError, ValueError):
    """More text, more files or longer lines than any configuration has."""
