"""Friction that is not always there: sticky places, and jams that come and go."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING

from rtf.simulator.faults.base import Parameter
from rtf.simulator.faults.mechanics import AddedFriction
from rtf.simulator.faults.moments import RandomMoments

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray


class _Sometimes(AddedFriction):
    """Friction that is there in some steps only."""

    def begin(self) -> None:
        self._adds = 0.0
        super().add(0.0)
        self._update(self.simulation.now)
        self.boards.each_step.append(self._update)

    def end(self) -> None:
        self.boards.each_step.remove(self._update)
        super().end()

    def _update(self, now: float) -> None:
        adds = self.torque if self.holds(now) else 0.0
        if adds != self._adds:  # asked in every step
            self._adds = adds
            self.add(adds)

    @abstractmethod
    def holds(self, now: float) -> bool:
        """Whether the friction is there now."""


class StickyPlace(_Sometimes):
    """Additional dry friction in one place of a joint's range."""

    kind = "sticky_place"
    description = "The joint is hard to move in one place: a damaged tooth, a kinked cable, a dent in a bearing."
    symptom = "In both directions it needs more output there, and nowhere else."
    parameters = (
        Parameter("torque", 5.0, "Nm", "added to the friction there", 0.0, 1e5),
        Parameter("place", 0.5, "", "where it is in the range: 0 the lower limit, 1 the upper one", 0.0, 1.0),
        Parameter("width", 6.0, "deg", "of the place", 0.0, 360.0),
    )
    place: float
    width: float

    def aim(self) -> None:
        super().aim()
        axis = self.robot.model.axes[self.axis]
        self._middle = (axis.minimum + self.place * (axis.maximum - axis.minimum)) * axis.internal
        self._half = 0.5 * self.width * axis.degree
        self._length: FloatArray = self.simulation.data.actuator_length

    def holds(self, now: float) -> bool:
        del now
        return abs(float(self._length[self.axis]) - self._middle) < self._half


class JamAtTimes(_Sometimes):
    """Mechanical block of a joint that comes and goes."""

    kind = "jam_at_times"
    description = (
        "Now and then the joint is blocked for a moment: something loose in the gearbox, or a cable that hooks."
    )
    symptom = "In a move it stops, at any place, and catches up with a jerk."
    parameters = (
        Parameter("length", 0.15, "s", "of a jam", 0.0, 60.0),
        Parameter("rate", 1.0, "1/s", "mean number of jams while it is free", 1e-3, 1e3),
        Parameter("torque", 400.0, "Nm", "the torque that would move it", 0.0, 1e5),
    )
    rate: float
    length: float

    def begin(self) -> None:
        self._jams = RandomMoments(self.own_random(self.axis), self.rate, self.length, self.simulation.now)
        super().begin()

    def holds(self, now: float) -> bool:
        return self._jams.holds(now)


KINDS = (StickyPlace, JamAtTimes)
