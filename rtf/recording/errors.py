"""The errors of recordings."""

from __future__ import annotations

from rtf.errors import RtfError


class RecordingError(RtfError, ValueError):
    """A recording that cannot be read or written. The message begins with the file, and the line if there is one."""


class MissingPackageError(RtfError, ImportError):
    """The package that reads and writes MCAP is not installed. The message says how to install it."""
