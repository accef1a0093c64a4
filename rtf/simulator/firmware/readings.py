"""What the boards of all buses measure, read once a step for all of them, as the numbers of their messages."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import ControlMode
from rtf.robot.devices.can.codes import BoardMode
from rtf.robot.extended_state import Field
from rtf.simulator.firmware.parameters import FULL_OUTPUT, TORQUE_COUNTS

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray
    from rtf.simulator.boards import Boards

#: mA an ampere, and ms a second.
_THOUSAND = 1e3
_TURN = 360.0
_PER_CENT = FULL_OUTPUT / 100.0
_I16, _I32 = 1 << 15, 1 << 31
#: The modes of boards, and those of the robot.
MODES = {
    BoardMode.IDLE: ControlMode.IDLE,
    BoardMode.FORCE_IDLE: ControlMode.FORCE_IDLE,
    BoardMode.POSITION: ControlMode.POSITION,
    BoardMode.VELOCITY: ControlMode.VELOCITY,
    BoardMode.TORQUE: ControlMode.TORQUE,
    BoardMode.IMPEDANCE_POSITION: ControlMode.IMPEDANCE_POSITION,
    BoardMode.IMPEDANCE_VELOCITY: ControlMode.IMPEDANCE_VELOCITY,
    BoardMode.CURRENT: ControlMode.CURRENT,
    BoardMode.MIXED: ControlMode.MIXED,
    BoardMode.DIRECT: ControlMode.POSITION_DIRECT,
    BoardMode.OPEN_LOOP: ControlMode.PWM,
    BoardMode.CALIBRATING: ControlMode.CALIBRATING,
    BoardMode.HARDWARE_FAULT: ControlMode.HARDWARE_FAULT,
    BoardMode.NOT_CONFIGURED: ControlMode.NOT_CONFIGURED,
    BoardMode.CONFIGURED: ControlMode.CONFIGURED,
}
_SHOWN = {int(mode): int(board) for board, mode in MODES.items()} | {
    int(ControlMode.CALIBRATION_DONE): int(BoardMode.CALIBRATING)
}


def short(number: float) -> int:
    """Return a number rounded, and saturated at 16 bits with a sign."""
    return max(-_I16, min(_I16 - 1, round(number)))


class Readings:
    """The measurements of all axes, as lists in the order of the axes, and a zero at the end, of the place ``none``.

    Each list is computed when it is first asked for in a step. Numbers are saturated, never wrapped. Positions are in
    ticks, speeds in ticks/ms and accelerations in ticks/ms² times two to the power of a shift.
    """

    def __init__(self, boards: Boards) -> None:
        self.none = boards.count
        self.zeros = [0] * (boards.count + 1)
        self._boards = boards
        self._tick = -1
        self._kept: dict[tuple[str, int], list[int]] = {}

    def _known(self, name: str, shift: int = 0) -> list[int] | None:
        if self._tick != self._boards.tick:
            self._tick = self._boards.tick
            self._kept.clear()
        return self._kept.get((name, shift))

    def _keep(self, name: str, values: FloatArray, size: int = _I16, shift: int = 0) -> list[int]:
        if shift:
            values = values * 2.0**shift
        rounded = np.clip(np.rint(values), -size, size - 1)
        kept = self._kept[name, shift] = [*rounded.astype(np.int64).tolist(), 0]
        return kept

    def positions(self) -> list[int]:
        """Return the positions of the joints."""
        return self._known("positions") or self._keep("positions", self._boards.position * self._ticks, _I32)

    def speeds(self, shift: int) -> list[int]:
        """Return the speeds of the joints."""
        return self._known("speeds", shift) or self._keep(
            "speeds", self._boards.velocity * self._ticks / _THOUSAND, shift=shift
        )

    def accelerations(self, shift: int) -> list[int]:
        """Return the accelerations of the joints."""
        return self._known("accelerations", shift) or self._keep(
            "accelerations", self._boards.accelerations_now() * self._ticks / _THOUSAND**2, shift=shift
        )

    def motor_positions(self) -> list[int]:
        """Return the positions of the rotors, in ticks of their encoders."""
        return self._known("motor positions") or self._keep(
            "motor positions", self._of_motors(Field.MOTOR_POSITIONS), _I32
        )

    def motor_speeds(self, shift: int) -> list[int]:
        """Return the speeds of the rotors."""
        return self._known("motor speeds", shift) or self._keep(
            "motor speeds", self._of_motors(Field.MOTOR_VELOCITIES) / _THOUSAND, shift=shift
        )

    def currents(self) -> list[int]:
        """Return the currents of the motors (mA)."""
        return self._known("currents") or self._keep("currents", self._boards.motor_currents() * _THOUSAND)

    def outputs(self) -> list[int]:
        """Return the outputs of the controllers."""
        return self._known("outputs") or self._keep("outputs", self._boards.output * _PER_CENT)

    def duties(self) -> list[int]:
        """Return the duty cycles of the motors."""
        return self._known("duties") or self._keep("duties", self._boards.motor_duties() * _PER_CENT)

    def errors(self) -> list[int]:
        """Return the errors of the positions."""
        return self._known("errors") or self._keep("errors", self._boards.controller_errors() * self._ticks)

    def torques(self) -> list[int]:
        """Return the torques of the joints by their sensors."""
        return self._known("torques") or self._keep("torques", self._boards.measured_torques() * TORQUE_COUNTS, _I32)

    def modes(self) -> list[int]:
        """Return the control modes that the boards show."""
        known = self._known("modes")
        if known is None:
            shown = self._boards.shown_modes()[0].tolist()
            known = [*(_SHOWN.get(mode, int(BoardMode.UNKNOWN)) for mode in shown), int(BoardMode.IDLE)]
            self._kept["modes", 0] = known
        return known

    @property
    def _ticks(self) -> FloatArray:
        return self._boards.resolution

    def _of_motors(self, field: Field) -> FloatArray:
        found: FloatArray = self._boards.measured(field) * self._boards.rotor_resolution / _TURN
        return found
