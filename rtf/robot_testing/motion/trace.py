"""Recorded states of a part: every state that its board published, with the board's stamps."""

from __future__ import annotations

from collections import deque
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np

from rtf import clock
from rtf.robot.extended_state import Field

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.robot.extended_state import ExtendedState
    from rtf.robot.interfaces import FloatArray


#: Clocks whose offset is greater, s, are reported: the transport of a message takes less.
_APART = 0.02


class Trace:
    """Recorded states in the order of their arrival; with ``most`` only the last ones are kept.

    The arrays have shape (states, axes); ``time`` are the stamps, in s. Read a trace when its recording has ended.
    """

    def __init__(self, most: int | None = None) -> None:
        self._states: deque[tuple[float, float, ExtendedState]] = deque(maxlen=most)

    def add(self, stamp: float, state: ExtendedState) -> None:
        """Keep a state with its arrival time. Called in the thread of the connection."""
        time = clock.current()
        # A simulator's clock is that of the stamps. It must not be read here: its time may wait for this thread.
        arrival = time.now() if isinstance(time, clock.SystemClock) else stamp
        self._states.append((stamp, arrival, state))

    def copy(self) -> Trace:
        """Return an independent copy of the states until now."""
        copied = Trace()
        copied._states.extend(list(self._states))  # in one step: states arrive meanwhile
        return copied

    def __len__(self) -> int:
        return len(self._states)

    @property
    def newest(self) -> tuple[float, ExtendedState]:
        """The last state with its stamp (s), both of the same message. Raises IndexError before the first."""
        stamp, _, state = self._states[-1]
        return stamp, state

    @property
    def time(self) -> FloatArray:
        """The stamps (s)."""
        return np.array([stamp for stamp, _, _ in list(self._states)])

    @property
    def offset(self) -> float:
        """The offset of this machine's clock from that of the stamps (s), including the median transport delay.

        0 with a simulator's clock, which is that of the stamps, and before the first state.
        """
        states = list(self._states)
        return float(np.median([arrival - stamp for stamp, arrival, _ in states])) if states else 0.0

    @property
    def local_time(self) -> FloatArray:
        """The stamps converted to the clock of the test (s)."""
        return self.time + self.offset

    @property
    def clocks_apart(self) -> str:
        """The report of a robot's clock offset; "" if it is small."""
        offset = self.offset
        if not abs(offset) > _APART:
            return ""
        return (
            f"the robot's clock is {abs(offset):.3f} s {'behind' if offset > 0 else 'ahead of'} this machine's; "
            "times are judged without this offset; synchronize the clocks"
        )

    def column(self, field: Field) -> NDArray[Any]:
        """Return one field of all states, shape (states, axes)."""
        return np.array([state.values(field) for _, _, state in list(self._states)])

    @property
    def positions(self) -> FloatArray:
        """Joint positions (deg)."""
        return self.column(Field.JOINT_POSITIONS)

    def median_positions(self, count: int = 5) -> FloatArray:
        """Return the medians of the last ``count`` joint positions (deg): a single reading that jumps does not count.

        Raises IndexError before the first state.
        """
        newest = [state.values(Field.JOINT_POSITIONS) for _, _, state in islice(reversed(self._states.copy()), count)]
        if not newest:
            raise IndexError("there is no state yet")
        positions: FloatArray = np.median(newest, axis=0)
        return positions

    @property
    def velocities(self) -> FloatArray:
        """Joint velocities (deg/s)."""
        return self.column(Field.JOINT_VELOCITIES)

    @property
    def motor_positions(self) -> FloatArray:
        """Rotor positions (deg)."""
        return self.column(Field.MOTOR_POSITIONS)

    @property
    def motor_velocities(self) -> FloatArray:
        """Rotor velocities (deg/s)."""
        return self.column(Field.MOTOR_VELOCITIES)

    @property
    def torques(self) -> FloatArray:
        """Joint torques (Nm)."""
        return self.column(Field.TORQUES)

    @property
    def duty_cycles(self) -> FloatArray:
        """Motor duty cycles (per cent)."""
        return self.column(Field.DUTY_CYCLES)

    @property
    def currents(self) -> FloatArray:
        """Motor currents (A)."""
        return self.column(Field.CURRENTS)

    @property
    def efforts(self) -> FloatArray:
        """Motor currents (A), or duty cycles (per cent) if the board measures no currents.

        The torque of a motor has the sign of its current; a duty cycle also has the voltage that its speed induces.
        """
        return self.currents if len(self) and self.newest[1].valid[Field.CURRENTS] else self.duty_cycles

    @property
    def control_modes(self) -> NDArray[np.int32]:
        """Joint control modes, as packed words."""
        return self.column(Field.CONTROL_MODES)


def wrong_stamps(time: FloatArray) -> str:
    """Return the report of states whose stamps (s) repeat or go back: their times are not known; "" without such."""
    wrong = int(np.count_nonzero(np.diff(time) <= 0.0))
    return f"{wrong} of {len(time)} states have time stamps that repeat or go back" if wrong else ""
