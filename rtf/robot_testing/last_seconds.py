"""What a part did in the last seconds before a test failed, for who wants to know what led to it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.extended_state import Field
from rtf.robot_testing.contacts import CHANNELS, NoForcesError
from rtf.robot_testing.mode_numbers import LEGEND, mode_numbers

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.case import RobotTest
    from rtf.robot_testing.contacts import Forces
    from rtf.robot_testing.part import Part

#: What is kept of each joint, as far as its board gives it, beside its mode.
_KEPT = (
    ("position", Field.JOINT_POSITIONS, "deg"),
    ("current", Field.CURRENTS, "A"),
    ("torque", Field.TORQUES, "Nm"),
    ("duty", Field.DUTY_CYCLES, "%"),
)


class LastSeconds:
    """``take`` it before the part is put back, so that it ends with the failure; ``write`` it when that is done.

    Writing files takes its time, during which a part must not be left as it is. ``forces`` are those of the part's
    sensor; None where it has none.
    """

    def __init__(self, test: RobotTest, part: Part, forces: Forces | None) -> None:
        self._test = test
        self._part = part
        self._forces = forces
        self._time: FloatArray | None = None
        self._states: dict[str, tuple[FloatArray, str]] = {}
        self._modes: NDArray[np.int32] | None = None
        self._felt: tuple[FloatArray, FloatArray, FloatArray] | None = None

    def take(self) -> None:
        """Copy it, if the test has failed."""
        history, forces = self._part.history, self._forces
        if not self._test.failing:
            return
        self._part.board.unobserve(history.add)  # so that all of it is of the same states
        if len(history):
            valid = history.newest[1].valid
            self._time = history.time
            self._states = {name: (history.column(field), unit) for name, field, unit in _KEPT if valid[field]}
            self._modes = history.control_modes
        if forces is not None and len(forces):
            try:
                self._felt = forces.rows()
            except NoForcesError as error:
                self._test.report(str(error))

    def write(self) -> None:
        """Attach what was taken to the test."""
        if self._felt is not None and self._forces is not None:
            numbers, stamps, values = self._felt
            self._test.record(
                f"before the end: {self._forces.source}",
                time=(stamps, "s"),
                number=(numbers, "count"),
                **{axis: (values[:, channel], symbol) for channel, (axis, symbol) in enumerate(CHANNELS.items())},
            )
        if self._time is not None and self._modes is not None:
            self._test.report(LEGEND)
            for joint, name in enumerate(self._part.names):
                columns = {what: (values[:, joint], unit) for what, (values, unit) in self._states.items()}
                columns["mode"] = mode_numbers(self._modes[:, joint]), ""
                self._test.record(f"before the end: {name}", time=(self._time, "s"), **columns)
