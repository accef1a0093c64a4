"""The errors of interface files and of the calls that follow from them."""

from __future__ import annotations

from rtf.errors import Location, RtfError
from rtf.middleware.errors import MiddlewareError


class IdlError(RtfError, ValueError):
    """An interface file that cannot be used. The message begins with file, line and column."""

    def __init__(self, message: str, where: Location) -> None:
        super().__init__(f"{where}: {message}")
        self.where = where


class CallError(MiddlewareError):
    """A server does not know the function, or does not accept the arguments of a call."""


class MissingPackageError(RtfError, ImportError):
    """The package that reads interface files is not installed. The message says how to install it."""
