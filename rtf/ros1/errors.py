"""The errors of topics and services."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.ros.errors import RosError

if TYPE_CHECKING:
    from rtf.errors import Location


class Ros1Error(RosError):
    """A topic, a service, a node or a setting that cannot be used. The message says how to correct it."""


class MissingPackageError(Ros1Error, ImportError):
    """The package of ROS's types is not installed."""


class DefinitionError(Ros1Error, ValueError):
    """A definition of a type that cannot be used. The message begins with file, line and column."""

    def __init__(self, message: str, where: Location) -> None:
        super().__init__(f"{where}: {message}")
        self.where = where


class MessageError(Ros1Error, ValueError):
    """Bytes that are no message of a type, or an object that is none."""


class MasterError(Ros1Error, ConnectionError):
    """The master, or another node's server, does not answer, or refuses."""


class PeerError(Ros1Error, ConnectionError):
    """A node refuses a connection, has another type, or violates the protocol."""


class NoServiceError(Ros1Error, TimeoutError):
    """A service is not there, or has not answered in time."""


class ServiceFailedError(Ros1Error):
    """A service has answered that it failed; the message is its own."""
