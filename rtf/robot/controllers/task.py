"""What controllers in space have in common: contexts, checkpoints, and the listeners of events."""

from __future__ import annotations

import threading
from abc import abstractmethod
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import ControllerEvent, FloatArray, ITaskControl

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import EventObserver

S = TypeVar("S")


class TaskController(ITaskControl, Generic[S]):
    """Contexts are settings of a type that cannot be changed; ``start`` are those of context 0.

    ``lock`` is held for moments, also by a period: no board is called while it is held. It may be given.
    """

    def __init__(self, start: S, lock: threading.RLock | None = None) -> None:
        self.lock = lock or threading.RLock()
        self._contexts = {0: start}
        self._next = 1
        self._observers: tuple[EventObserver, ...] = ()
        self._shares: list[float] = []
        self._passed: list[float] = []  # checkpoints of this motion that are still to come

    # Contexts --------------------------------------------------------------------------------------------------------

    @abstractmethod
    def context(self) -> S:
        """Return the present settings."""

    def store_context(self) -> int:
        with self.lock:
            number, self._next = self._next, self._next + 1
            self._contexts[number] = self.context()
            return number

    def stored(self, context: int) -> S:
        """Return the settings of a context; ``lock`` is held. Raises RefusedError for an unknown number."""
        if context not in self._contexts:
            raise RefusedError(f"there is no context {context}")
        return self._contexts[context]

    def delete_contexts(self, contexts: Sequence[int]) -> None:
        with self.lock:
            for context in contexts:
                if context:
                    self._contexts.pop(context, None)

    # Events ----------------------------------------------------------------------------------------------------------

    def add_checkpoint(self, share: float) -> None:
        if not 0.0 <= share <= 1.0:
            raise RefusedError(f"a checkpoint is a share of the way, 0 to 1, not {share}")
        with self.lock:
            self._shares.append(share)

    def remove_checkpoint(self, share: float) -> None:
        with self.lock:
            if share not in self._shares:
                raise RefusedError(f"there is no checkpoint at {share}")
            self._shares.remove(share)

    def checkpoints(self) -> FloatArray:
        return np.array(self._shares)

    def begin_checkpoints(self) -> None:
        """Begin a motion, of which no checkpoint has been passed; ``lock`` is held."""
        self._passed = sorted(self._shares)

    def pass_checkpoints(self, share: float, now: float) -> list[ControllerEvent]:
        """Return the events of the checkpoints up to a share of the way; ``lock`` is held."""
        passed = [one for one in self._passed if one <= share]
        self._passed = self._passed[len(passed) :]
        return [ControllerEvent("motion-ongoing", now, one) for one in passed]

    def observe_events(self, observer: EventObserver) -> None:
        with self.lock:
            self._observers = (*self._observers, observer)

    def unobserve_events(self, observer: EventObserver) -> None:
        with self.lock:
            self._observers = tuple(one for one in self._observers if one != observer)

    def notify(self, events: Sequence[ControllerEvent]) -> None:
        """Call the observers; ``lock`` is not held."""
        for event in events:
            for observer in self._observers:
                observer(event)
