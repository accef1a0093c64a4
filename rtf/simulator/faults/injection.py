"""Injection of faults into a robot, at their times."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf.robot.errors import RefusedError
from rtf.simulator.faults.kinds import find_kind

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.simulator.faults.base import Fault
    from rtf.simulator.robot import SimulatedRobot

#: The greatest number of faults at the same time.
MOST_FAULTS = 1000


@dataclass(slots=True)
class ActiveFault:
    """An injected fault. ``running`` is false until it has begun."""

    number: int
    fault: Fault
    begins: float
    ends: float
    running: bool = False


class FaultInjector:
    """The faults of one robot. Several can be active at the same time, also on the same joint."""

    def __init__(self, robot: SimulatedRobot) -> None:
        self._robot = robot
        self._simulation = robot.simulation
        self._numbers = itertools.count(1)
        self._faults: dict[int, ActiveFault] = {}
        self._running: list[ActiveFault] = []  # in the order in which they began
        self._simulation.on_reset.append(self._clear_all)

    @property
    def active(self) -> tuple[ActiveFault, ...]:
        """The injected faults that have not ended."""
        with self._simulation.lock:
            return tuple(self._faults.values())

    def inject(
        self,
        kind: str,
        target: str = "",
        values: Mapping[str, float] | None = None,
        *,
        delay: float = 0.0,
        duration: float = float("inf"),
    ) -> int:
        """Inject a fault ``delay`` seconds from now for ``duration`` seconds, and return its number.

        Raises RefusedError for a wrong fault, and when there are too many.
        """
        if not (delay >= 0 and math.isfinite(delay) and duration > 0):
            raise RefusedError(f"{kind}: the delay must be 0 s or more, and the duration more than 0 s")
        fault = find_kind(kind)(self._robot, target, values)
        with self._simulation.lock:
            if len(self._faults) >= MOST_FAULTS:
                raise RefusedError(f"{kind}: there are {MOST_FAULTS} faults already; clear one first")
            number = next(self._numbers)
            begins = self._simulation.now + delay
            self._faults[number] = ActiveFault(number, fault, begins, begins + duration)
            if delay > 0:
                self._simulation.after(delay, lambda: self._begin(number))
            else:
                self._begin(number)
            if math.isfinite(duration):
                self._simulation.after(delay + duration, lambda: self._end(number))
            return number

    def clear(self, number: int | None = None) -> int:
        """Clear one fault, or all; return how many. Raises RefusedError for an unknown number."""
        with self._simulation.lock:
            if number is not None and number not in self._faults:
                raise RefusedError(f"there is no fault number {number}; there are {sorted(self._faults)}")
            numbers = sorted(self._faults, reverse=True) if number is None else [number]
            for one in numbers:
                self._end(one)
            return len(numbers)

    def _clear_all(self) -> None:
        self.clear()

    def _begin(self, number: int) -> None:
        found = self._faults.get(number)
        if found is not None:
            found.running = True
            found.fault.start()
            self._running.append(found)

    def _end(self, number: int) -> None:
        """End a fault. Later faults that restore saved values are ended before it and begun again after it.

        Otherwise the second of two faults would save, and restore, the value that the first one had set.
        """
        found = self._faults.pop(number, None)
        if found is None or not found.running:
            return
        place = self._running.index(found)
        later = [one.fault for one in self._running[place + 1 :] if one.fault.restores and found.fault.restores]
        for fault in reversed(later):
            fault.end()
        found.fault.end()
        del self._running[place]
        for fault in later:
            fault.begin()
