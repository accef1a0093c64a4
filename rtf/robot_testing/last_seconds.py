"""What a part did in the last seconds before a test failed, for who wants to know what led to it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot_testing.contacts import CHANNELS, NoForcesError

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.case import RobotTest
    from rtf.robot_testing.contacts import Forces
    from rtf.robot_testing.part import Part


class LastSeconds:
    """``take`` it before the part is put back, so that it ends with the failure; ``write`` it when that is done.

    Writing files takes its time, during which a part must not be left as it is. ``forces`` are those of the part's
    sensor; None where it has none.
    """

    def __init__(self, test: RobotTest, part: Part, forces: Forces | None) -> None:
        self._test = test
        self._part = part
        self._forces = forces
        self._states: tuple[FloatArray, FloatArray, FloatArray] | None = None
        self._felt: tuple[FloatArray, FloatArray, FloatArray] | None = None

    def take(self) -> None:
        """Copy it, if the test has failed."""
        history, forces = self._part.history, self._forces
        if not self._test.failing:
            return
        if len(history):
            self._states = history.time, history.positions, history.currents
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
        if self._states is not None:
            time, positions, currents = self._states
            for joint, name in enumerate(self._part.names):
                self._test.record(
                    f"before the end: {name}",
                    time=(time, "s"),
                    position=(positions[:, joint], "deg"),
                    current=(currents[:, joint], "A"),
                )
