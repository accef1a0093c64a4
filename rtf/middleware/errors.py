"""What can go wrong between ports: one base error, and leaves that are built-ins as well."""

from __future__ import annotations

from rtf.errors import RtfError


class MiddlewareError(RtfError):
    """Something about a port, a name or a connection; the message names it and what would fix it."""


class NameNotFoundError(MiddlewareError, LookupError):
    """No port of this name is registered."""


class AddressError(MiddlewareError, ValueError):
    """A text that is no port name or contact."""


class ConnectError(MiddlewareError, ConnectionError):
    """Two ports cannot be connected, or their connection broke."""


class ProtocolError(MiddlewareError, ConnectionError):
    """A peer said something that the protocol does not allow, or more than it may."""


class PortClosedError(MiddlewareError, OSError):
    """The port is closed or interrupted, so nothing can be read or written."""


class WaitTimeoutError(MiddlewareError, TimeoutError):
    """Something did not happen in time."""
