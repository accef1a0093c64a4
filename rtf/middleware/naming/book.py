"""What a process asks of whoever keeps the names."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.names import Contact


class Names(ABC):
    """The names of a network. All may be called from any thread.

    All raise ConnectError when the server cannot be reached, and AddressError for a name that cannot be registered.
    """

    @abstractmethod
    def register(self, name: str, *, carrier: str = "", host: str = "", port: int = 0, promise: str = "") -> Contact:
        """Register a name, whether it is known or not; what is left out is chosen. No name: ``/tmp/port/N``.

        The number of the result is 0 where nobody hands out numbers: whoever listens takes any, and registers again
        with it.
        """

    @abstractmethod
    def unregister(self, name: str) -> None:
        """Forget a name and what it owns, whether it is known or not."""

    @abstractmethod
    def query(self, name: str) -> Contact | None:
        """Where a port is, or None."""

    @abstractmethod
    def list(self, prefix: str = "") -> Sequence[Contact]:
        """All ports in the order of their names, or those at or below one."""

    @abstractmethod
    def set_property(self, name: str, key: str, values: Sequence[str]) -> None:
        """Note a set of values about a port, in the place of those before; none: forget them."""

    @abstractmethod
    def get_property(self, name: str, key: str) -> Sequence[str]:
        """What was noted about a port, sorted; nothing about one that is not known."""

    @abstractmethod
    def announce(self, name: str, *, active: bool = True) -> None:
        """Say that a port listens and can be connected, or that it could not be reached."""

    @abstractmethod
    def command(self, line: str) -> Sequence[str]:
        """Give a command as it is typed, such as ``list /robot``; returns all lines of the answer."""

    def close(self) -> None:  # noqa: B027 - most have nothing to close
        """Nothing more is asked. What is registered stays."""
