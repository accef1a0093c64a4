"""The interface of a backend: it takes jobs as bytes, and gives results as bytes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

import msgspec

from rtf.campaigns.errors import CampaignError
from rtf.campaigns.task_run import Status, TaskResult, decode_result

if TYPE_CHECKING:
    from concurrent.futures import Future


class BackendLostError(CampaignError):
    """The backend cannot be reached any more, and what it was running has no result."""


class Backend(ABC):
    """A backend. It may be used by one thread."""

    @property
    @abstractmethod
    def slots(self) -> int:
        """The number of tasks that it wants to have at a time, besides those of real robots."""

    @property
    @abstractmethod
    def described(self) -> str:
        """Its workers, for people."""

    @property
    def dashboard(self) -> str:
        """The address of its own page; empty without one."""
        return ""

    @abstractmethod
    def submit(self, job: bytes, robot: str) -> Future[bytes]:
        """Have a job of :mod:`rtf.campaigns.task_run` done; ``robot`` is the name of its real robot, if it has one."""

    def result(self, future: Future[bytes]) -> TaskResult:
        """Return the result of a future that is done. Raises BackendLostError."""
        try:
            return decode_result(future.result())
        except msgspec.MsgspecError as error:
            return TaskResult(Status.KILLED, f"what the worker sent is no result: {error}")

    @abstractmethod
    def drop(self) -> None:
        """End what is running; its results are not wanted any more."""

    @abstractmethod
    def close(self) -> None:
        """Release everything. Nothing is running any more."""
