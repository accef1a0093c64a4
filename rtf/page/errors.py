"""The errors of the page's server side: a base class and its subclasses, which are also built-in exceptions."""

from __future__ import annotations

from rtf.errors import RtfError


class PageError(RtfError):
    """Base class of the errors of the page."""


class SeriesError(PageError, ValueError):
    """A file has no recorded series, or one that is too large."""


class FileRefusedError(PageError, PermissionError):
    """A path does not lead to a regular file inside the run folder."""
