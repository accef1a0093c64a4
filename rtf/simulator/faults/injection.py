"""Putting faults into a robot at their time, and taking them out again."""

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
    from rtf.simulator.icub import SimulatedIcub

#: How many faults may be there at the same time.
MOST_FAULTS = 1000


@dataclass(slots=True)
class ActiveFault:
    """A fault that was put in. ``running`` is false until its time has come."""

    number: int
    fault: Fault
    begins: float
    ends: float
    running: bool = False


class FaultInjector:
    """The faults of one robot. Any number may be there at the same time, on the same joint, too."""

    def __init__(self, robot: SimulatedIcub) -> None:
        self._robot = robot
        self._simulation = robot.simulation
        self._numbers = itertools.count(1)
        self._faults: dict[int, ActiveFault] = {}
        self._running: list[ActiveFault] = []  # in the order in which they began
        self._simulation.on_reset.append(self._clear_all)

    @property
    def active(self) -> tuple[ActiveFault, ...]:
        """What was put in and has not ended."""
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
        """Put a fault in, ``delay`` seconds from now, for ``duration``; returns its number. Raises RefusedError."""
        if not (delay >= 0 and math.isfinite(delay) and duration > 0):
            raise RefusedError(f"{kind}: it begins after 0 s or more, and lasts longer than 0 s")
        fault = find_kind(kind)(self._robot, target, values)
        with self._simulation.lock:
            if len(self._faults) >= MOST_FAULTS:
                raise RefusedError(f"{kind}: there are {MOST_FAULTS} faults already; clear some")
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
        """Take one fault out, or all; returns how many. Raises RefusedError for a number that is not there."""
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
        """End a fault. Those that keep what they found, and began after it, make way meanwhile.

        Otherwise the first of two would put back what was healthy, and the second what the first had made of it.
        """
        found = self._faults.pop(number, None)
        if found is None or not found.running:
            return
        place = self._running.index(found)
        keepers = [one.fault for one in self._running[place + 1 :] if one.fault.keeps and found.fault.keeps]
        for fault in reversed(keepers):
            fault.end()
        found.fault.end()
        del self._running[place]
        for fault in keepers:
            fault.begin()
