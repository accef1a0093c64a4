"""What a part did: every state that its board published, with the board's own stamps."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

import numpy as np

from rtf import clock
from rtf.robot.extended_state import Field

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.robot.extended_state import ExtendedState
    from rtf.robot.interfaces import FloatArray


#: Clocks that differ by more are told of, s: the way of a message takes less.
_APART = 0.02


class Trace:
    """States in the order in which they came; ``most`` keeps only so many of the last.

    The arrays have a row a state and a column a joint (or motor); ``time`` is of the stamps, in s. To be read
    when it is no longer written to.
    """

    def __init__(self, most: int | None = None) -> None:
        self._states: deque[tuple[float, float, ExtendedState]] = deque(maxlen=most)

    def add(self, stamp: float, state: ExtendedState) -> None:
        """Keep a state, and when it came. From the thread that receives it."""
        time = clock.current()
        # A simulator's clock is that of the stamps, and may not be asked from here: time would wait for this thread.
        arrival = time.now() if isinstance(time, clock.SystemClock) else stamp
        self._states.append((stamp, arrival, state))

    def copy(self) -> Trace:
        """What has come until now, as a trace of its own that nobody writes to."""
        copied = Trace()
        copied._states.extend(list(self._states))  # in one step, for states come meanwhile
        return copied

    def __len__(self) -> int:
        return len(self._states)

    @property
    def newest(self) -> tuple[float, ExtendedState]:
        """The state that came last, with its stamp (s): both of the same message. IndexError before the first."""
        stamp, _, state = self._states[-1]
        return stamp, state

    @property
    def time(self) -> FloatArray:
        """The stamps (s)."""
        return np.array([stamp for stamp, _, _ in list(self._states)])

    @property
    def offset(self) -> float:
        """By how much this machine's clock is ahead of that of the stamps (s), with the usual way of a message.

        0 by a simulator's clock, which is that of the stamps, and before the first state.
        """
        states = list(self._states)
        return float(np.median([arrival - stamp for stamp, arrival, _ in states])) if states else 0.0

    @property
    def local_time(self) -> FloatArray:
        """The stamps by the clock that the test lives by (s): to be compared with what that says."""
        return self.time + self.offset

    @property
    def clocks_apart(self) -> str:
        """What to report of a robot whose clock is not this machine's; "" where they nearly agree."""
        offset = self.offset
        if not abs(offset) > _APART:
            return ""
        return (
            f"the robot's clock is {abs(offset):.3f} s {'behind' if offset > 0 else 'ahead of'} this machine's; "
            "times are judged without that, and synchronizing the clocks fixes it"
        )

    def column(self, field: Field) -> NDArray[Any]:
        """One field of all states, shape (states, axes)."""
        return np.array([state.values(field) for _, _, state in list(self._states)])

    @property
    def positions(self) -> FloatArray:
        """Of the joints (deg)."""
        return self.column(Field.JOINT_POSITIONS)

    @property
    def velocities(self) -> FloatArray:
        """Of the joints (deg/s)."""
        return self.column(Field.JOINT_VELOCITIES)

    @property
    def motor_positions(self) -> FloatArray:
        """Of the rotors (deg)."""
        return self.column(Field.MOTOR_POSITIONS)

    @property
    def motor_velocities(self) -> FloatArray:
        """Of the rotors (deg/s)."""
        return self.column(Field.MOTOR_VELOCITIES)

    @property
    def torques(self) -> FloatArray:
        """At the joints (Nm)."""
        return self.column(Field.TORQUES)

    @property
    def duty_cycles(self) -> FloatArray:
        """Of the motors (per cent)."""
        return self.column(Field.DUTY_CYCLES)

    @property
    def currents(self) -> FloatArray:
        """Of the motors (A)."""
        return self.column(Field.CURRENTS)

    @property
    def control_modes(self) -> NDArray[np.int32]:
        """Of the joints, as packed words."""
        return self.column(Field.CONTROL_MODES)
