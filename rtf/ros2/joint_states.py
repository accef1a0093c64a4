"""The latest states of some joints, from messages that may have only some of them, or more."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf import clock
from rtf.ros2.messages import JointState
from rtf.ros2.stamps import StampMapping

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.ros2.node import Node


class States(NamedTuple):
    """Positions, velocities and efforts, a row each, in the units of ROS; a value that was never sent is NaN."""

    values: FloatArray
    time: float  # of the oldest of them, by the clock of this process
    arrived: float  # when the last message of the joint that has waited longest came


class JointStates:
    """Listens to joint states; ``latest`` may be called by any thread. Raises Ros2Error."""

    def __init__(self, node: Node, topic: str, names: Sequence[str]) -> None:
        self._names = {name: place for place, name in enumerate(names)}
        self._values = np.full((3, len(names)), np.nan)
        self._times = np.full((2, len(names)), -np.inf)
        self._mapping = StampMapping()
        self._changed = threading.Condition()  # of a lock that a thread may take twice
        node.subscribe(topic, JointState, self._take)

    def _take(self, message: JointState) -> None:
        pairs = [(self._names[name], at) for at, name in enumerate(message.name) if name in self._names]
        if not pairs:
            return
        into, source = (list(one) for one in zip(*pairs, strict=True))
        now = clock.current().now()
        with self._changed:
            for row, values in enumerate((message.position, message.velocity, message.effort)):
                if len(values) == len(message.name):
                    self._values[row, into] = np.asarray(values)[source]
            self._times[:, into] = [[self._mapping.time_of(message.header.stamp.seconds, now)], [now]]
            self._changed.notify_all()

    def latest(self) -> States:
        """Return the present states."""
        with self._changed:
            return States(self._values.copy(), *self._times.min(axis=1).tolist())

    def missing(self) -> list[str]:
        """Return the joints of which no position has come."""
        values = self.latest().values[0]
        return [name for name, place in self._names.items() if np.isnan(values[place])]

    def await_all(self, timeout: float) -> bool:
        """Wait until every joint has sent a position; False if one has not within ``timeout`` s."""
        with self._changed:
            return self._changed.wait_for(lambda: not np.isnan(self._values[0]).any(), timeout)

    def await_newer(self, arrived: float, timeout: float) -> States:
        """Wait for states that have arrived later, ``timeout`` s at most, and return the present ones."""
        with self._changed:
            self._changed.wait_for(lambda: self._times[1].min() > arrived, timeout)
            return self.latest()
