"""The interface of a name service."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.wire.contact import Contact


class Names(ABC):
    """The registered names of a network. All methods may be called from any thread.

    All raise ConnectError if the server cannot be reached, and AddressError for a name that cannot be registered.
    """

    @abstractmethod
    def register(self, name: str, *, carrier: str = "", host: str = "", port: int = 0, promise: str = "") -> Contact:
        """Register a name, known or not; the server fills in what is left out. An empty name: ``/tmp/port/N``.

        The port number of the result is 0 where the service does not assign numbers: the caller then listens at any
        free one and registers again with it.
        """

    @abstractmethod
    def unregister(self, name: str) -> None:
        """Remove a name and the names that it owns. An unknown name is not an error."""

    @abstractmethod
    def query(self, name: str) -> Contact | None:
        """Return the contact of a port, or None."""

    @abstractmethod
    def list(self, prefix: str = "") -> Sequence[Contact]:
        """Return all ports, or those at or below ``prefix``, sorted by name."""

    @abstractmethod
    def set_property(self, name: str, key: str, values: Sequence[str]) -> None:
        """Store a set of values under a key of a port, replacing earlier ones; an empty set removes the key."""

    @abstractmethod
    def get_property(self, name: str, key: str) -> Sequence[str]:
        """Return the values of a key of a port, sorted; empty for an unknown port."""

    @abstractmethod
    def announce(self, name: str, *, active: bool = True) -> None:
        """Announce that a port listens and can be connected, or, if not ``active``, that it could not be reached."""

    @abstractmethod
    def command(self, line: str) -> Sequence[str]:
        """Execute a command as it is typed, such as ``list /robot``. Return all lines of the answer."""

    def close(self) -> None:  # noqa: B027 - most have nothing to close
        """Close the client. Registered names stay registered."""
