"""Positions of joints over the last second, for pictures that are older than the latest state."""

from __future__ import annotations

import threading
from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.errors import StaleStateError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.boards.client import RemoteBoard
    from rtf.robot.extended_state import ExtendedState
    from rtf.robot.interfaces import FloatArray

#: How long states are kept, and how much older than asked for the latest may be (s).
_KEPT, _OLDEST = 1.0, 0.1


class Positions:
    """The positions of all joints of a board (deg), by the stamps of its states. May be used in any thread."""

    def __init__(self, board: RemoteBoard) -> None:
        self.names = board.axis_names()
        self._board = board
        self._lock = threading.Lock()
        self._states: deque[tuple[float, FloatArray]] = deque()
        board.observe(self._keep)

    def _keep(self, time: float, state: ExtendedState) -> None:
        """Called in the thread of the connection."""
        values = state.joint_positions.copy()
        with self._lock:
            if self._states and time < self._states[-1][0]:
                self._states.clear()  # the clock was set back
            self._states.append((time, values))
            while self._states[0][0] < time - _KEPT:
                self._states.popleft()

    @property
    def latest(self) -> float:
        """The time of the latest state; minus infinity before the first."""
        with self._lock:
            return self._states[-1][0] if self._states else -np.inf

    def at(self, time: float) -> dict[str, float]:
        """Return the positions at a time (deg), by the names of the joints, between two states if it is between them.

        Raises StaleStateError if there is no state of about this time.
        """
        with self._lock:
            states = list(self._states)
        if not states or not states[0][0] - _OLDEST <= time <= states[-1][0] + _OLDEST:
            kept = f"from {states[0][0]:.3f} to {states[-1][0]:.3f} s" if states else "none"
            raise StaleStateError(f"{self._board.name}: there is no state of {time:.3f} s; those kept: {kept}")
        times = [one for one, _ in states]
        values = np.array([one for _, one in states])
        joints = [float(np.interp(time, times, column)) for column in values.T]
        return dict(zip(self.names, joints, strict=True))


def positions_of(joints: Sequence[str], parts: Sequence[Positions], time: float) -> FloatArray:
    """Return the positions of joints at a time (deg), 0 for those of no part. Raises StaleStateError."""
    found: dict[str, float] = {}
    for part in parts:
        found |= part.at(time)
    return np.array([found.get(joint, 0.0) for joint in joints])
