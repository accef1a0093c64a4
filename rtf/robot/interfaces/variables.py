"""Remote variables: named values of a board, such as its coupling matrices."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rtf.bottle import Bottle


class IRemoteVariables(ABC):
    """Values by name. Tests use ``kinematic_mj`` (coupling blocks, each flattened) and ``torqueControlEnabled``."""

    @abstractmethod
    def variable(self, key: str) -> Bottle:
        """Return the value of a variable. Raises RefusedError for an unknown one."""

    @abstractmethod
    def set_variable(self, key: str, value: Bottle) -> None:
        """Set a variable; most refuse it."""

    @abstractmethod
    def variables(self) -> tuple[str, ...]:
        """Return the names of all variables."""
