"""The errors of the middleware: one base class, and subclasses that are also built-in exceptions."""

from __future__ import annotations

from rtf.errors import RtfError


class MiddlewareError(RtfError):
    """An error of a port, a name or a connection. The message names it and says how to fix it."""


class NameNotFoundError(MiddlewareError, LookupError):
    """No port of this name is registered."""


class AddressError(MiddlewareError, ValueError):
    """A text that is not a port name or contact."""


class ConnectError(MiddlewareError, ConnectionError):
    """Two ports cannot be connected, or their connection was lost."""


class NameServerError(ConnectError):
    """The name server does not answer, so nothing is known of any name."""


class ProtocolError(MiddlewareError, ConnectionError):
    """A peer violated the protocol, or exceeded one of its limits."""


class PortClosedError(MiddlewareError, OSError):
    """The port is closed or interrupted: nothing can be read or written."""


class WaitTimeoutError(MiddlewareError, TimeoutError):
    """An operation did not finish within its timeout."""
