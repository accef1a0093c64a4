"""What the boards that drive motors measure, read once a step for all of them, as the numbers of their messages."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.simulator.firmware.parameters import FULL_OUTPUT

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray
    from rtf.simulator.boards import Boards

_TURN, _THOUSAND = 360.0, 1e3
#: Degrees of a rotor in a part of its turn, as such boards count them.
PART = _TURN / 65536


class Rotors:
    """The rotors of all motors, as lists with a number for each; each is read when it is first asked for in a step."""

    def __init__(self, boards: Boards) -> None:
        self._boards = boards
        self._moved = self._fed = -1  # the steps of what is kept
        self._positions: list[float] = []
        self._speeds: list[float] = []
        self._currents: list[float] = []
        self._duties: list[float] = []

    @property
    def positions(self) -> list[float]:
        """The positions of the rotors, in parts of a turn."""
        self._read_encoders()
        return self._positions

    @property
    def speeds(self) -> list[float]:
        """The speeds of the rotors, in parts of a turn a millisecond."""
        self._read_encoders()
        return self._speeds

    @property
    def currents(self) -> list[float]:
        """The currents of the motors (mA)."""
        self._read_amplifiers()
        return self._currents

    @property
    def duties(self) -> list[float]:
        """The duty cycles of the motors, in parts of 32000."""
        self._read_amplifiers()
        return self._duties

    def _read_encoders(self) -> None:
        if self._moved != self._boards.tick:
            self._moved = self._boards.tick
            turns, speeds = self._boards.motor_motion()
            self._positions, self._speeds = _listed(turns, 1 / PART), _listed(speeds, 1 / (PART * _THOUSAND))

    def _read_amplifiers(self) -> None:
        if self._fed != self._boards.tick:
            self._fed = self._boards.tick
            self._currents = _listed(self._boards.motor_currents(), _THOUSAND)
            self._duties = _listed(self._boards.motor_duties(), FULL_OUTPUT / 100.0)


def _listed(values: FloatArray, factor: float) -> list[float]:
    found: list[float] = (values * factor).tolist()
    return found
