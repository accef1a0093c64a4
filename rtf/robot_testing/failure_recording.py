"""Recording of the last seconds of a part before one of its joints was stopped, or the test failed."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING, NamedTuple

from rtf.recording.errors import MissingPackageError
from rtf.recording.tables import Table
from rtf.robot.extended_state import Field
from rtf.robot_testing.guard.contacts import CHANNELS, NoForcesError, force_rows
from rtf.robot_testing.motion.modes import LEGEND, mode_numbers

if TYPE_CHECKING:
    from rtf.robot_testing.guard.contacts import ForceMessage, Forces
    from rtf.robot_testing.motion.part import Part
    from rtf.robot_testing.motion.trace import Trace
    from rtf.testing import TestCase

#: The recorded quantities of each joint beside its mode, as far as its board sends them.
_KEPT = (
    ("position", Field.JOINT_POSITIONS, "deg"),
    ("current", Field.CURRENTS, "A"),
    ("torque", Field.TORQUES, "Nm"),
    ("duty", Field.DUTY_CYCLES, "%"),
)


class _Taken(NamedTuple):
    """A copy of the history at one moment: the states, and the messages of the force-torque sensor."""

    when: str
    states: Trace
    forces: list[ForceMessage]


class FailureRecording:
    """The last seconds of a part before the guard first stopped a joint, and before the end of a failed test.

    Call ``take`` before the part is restored, so that the recording ends with the failure, and ``write`` afterwards:
    writing files takes time, and the part has to be restored at once. ``forces`` are those of the part's force-torque
    sensor; None if it has none.
    """

    def __init__(self, test: TestCase, part: Part, forces: Forces | None) -> None:
        self._test = test
        self._part = part
        self._forces = forces
        self._taken: list[_Taken] = []

    def take_stop(self, joint: int) -> None:
        """Copy the history at the first stop of a joint: the test may go on with others."""
        if not self._taken:
            self._take(f"before {self._part.names[joint]} was stopped")

    def take(self) -> None:
        """Copy the history if the test has failed."""
        if self._test.failing:
            self._take("before the end")

    def _take(self, when: str) -> None:
        forces = [] if self._forces is None else self._forces.messages()
        self._taken.append(_Taken(when, self._part.history.copy(), forces))

    def write(self) -> None:
        """Attach the copies to the test as recordings."""
        if any(len(taken.states) for taken in self._taken):
            self._test.report(LEGEND)
        for taken in self._taken:
            tables: dict[str, Table] = {}
            if self._forces is not None and taken.forces:
                tables |= self._write_forces(self._forces, taken)
            if len(taken.states):
                tables |= self._write_states(taken)
            if tables:
                self._attach(taken.when, tables)

    def _attach(self, when: str, tables: dict[str, Table]) -> None:
        """Attach the same as one file for Foxglove, if the package for that is installed."""
        with contextlib.suppress(MissingPackageError):
            from rtf.recording.mcap_series import MEDIA_TYPE, write_tables

            self._test.attach(write_tables(tables), f"{when} - {self._part.name}.mcap", MEDIA_TYPE)

    def _write_forces(self, forces: Forces, taken: _Taken) -> dict[str, Table]:
        try:
            numbers, stamps, values = force_rows(taken.forces)
        except NoForcesError as error:
            self._test.report(str(error))
            return {}
        columns = {axis: (values[:, channel], symbol) for channel, (axis, symbol) in enumerate(CHANNELS.items())}
        self._test.record(f"{taken.when}: {forces.source}", time=(stamps, "s"), number=(numbers, "count"), **columns)
        return {forces.source: Table(stamps, {"forces": columns})}

    def _write_states(self, taken: _Taken) -> dict[str, Table]:
        states, valid = taken.states, taken.states.newest[1].valid
        time, modes = states.time, states.control_modes
        fields = {name: (states.column(field), unit) for name, field, unit in _KEPT if valid[field]}
        joints = {}
        for joint, name in enumerate(self._part.names):
            columns = {what: (values[:, joint], unit) for what, (values, unit) in fields.items()}
            if "position" in columns:
                columns["position"] = self._part.column(joint, columns["position"][0])
            columns["mode"] = mode_numbers(modes[:, joint]), ""
            self._test.record(f"{taken.when}: {name}", time=(time, "s"), **columns)
            joints[name] = columns
        return {f"/{self._part.name}": Table(time, joints)}
