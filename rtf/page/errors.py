"""What can go wrong behind the page: one base error and its leaves, each also a fitting built-in."""

from __future__ import annotations

from rtf.errors import RtfError


class PageError(RtfError):
    """Base of the errors of the page's layer."""


class SeriesError(PageError, ValueError):
    """A file holds no recorded series, or one beyond all bounds."""


class FileRefusedError(PageError, PermissionError):
    """A path that leads to no ordinary file inside the run's folder."""
