"""Remote variables: what a board tells of itself by name, such as its coupling matrices."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rtf.bottle import Bottle


class IRemoteVariables(ABC):
    """Values by name. Tests use ``kinematic_mj`` (coupling blocks, each flattened) and ``torqueControlEnabled``."""

    @abstractmethod
    def variable(self, key: str) -> Bottle:
        """The value of a name. Raises RefusedError for one that is not known."""

    @abstractmethod
    def set_variable(self, key: str, value: Bottle) -> None:
        """Change it; most are refused."""

    @abstractmethod
    def variables(self) -> tuple[str, ...]:
        """The names."""
