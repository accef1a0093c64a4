"""The units of a board and those of the robot: degrees and ticks, amperes, newton-metres and duty cycles and counts.

A value that a message cannot hold is limited to the nearest one that it can, and reported; it never wraps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from rtf.robot.errors import MessageError
from rtf.robot.interfaces import Pid

if TYPE_CHECKING:
    from collections.abc import Callable


#: The ranges of integers with a sign.
SHORT, LONG = (-(1 << 15), (1 << 15) - 1), (-(1 << 31), (1 << 31) - 1)
#: A board computes with milliseconds.
_MS = 1000.0
#: The greatest shift of a gain of 16 bits.
_MOST_SHIFT = 15


class RawPid(NamedTuple):
    """The numbers of a position or torque controller in the messages of a board."""

    kp: int
    ki: int
    kd: int
    shift: int
    offset: int
    output_limit: int
    integral_limit: int
    stiction_up: int = 0
    stiction_down: int = 0


def _ignore(what: str, value: float, limit: int) -> None:
    """Report nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisScale:
    """The scales of an axis. ``ticks`` a degree is negative where the encoder counts against the joint.

    ``zero`` is added to an angle before it is scaled (deg). The shifts are those of the velocity of moves, of the
    broadcast velocity, and of accelerations. ``saturated`` is called with the name of a value, the value as a board
    would have it, and the limit that is sent.
    """

    ticks: float = 65536 / 360
    zero: float = 0.0
    move_shift: int = 4
    speed_shift: int = 5
    acceleration_shift: int = 5
    full_duty: float = 1333.0  # counts of 100 per cent
    amperes: float = 1000.0  # counts an ampere
    newtons: float = 0.0  # counts a newton-metre; 0: torques are not measured
    saturated: Callable[[str, float, int], None] = field(default=_ignore, compare=False)

    def integer(self, what: str, value: float, limits: tuple[int, int] = SHORT) -> int:
        """Return the nearest integer within limits, and report a value that is outside of them.

        Raises MessageError for what is not a number.
        """
        least, most = limits
        if least <= value <= most:
            return round(value)
        if math.isnan(value):
            raise MessageError(f"the {what} of an axis is not a number")
        limit = most if value > most else least
        self.saturated(what, value, limit)
        return limit

    # Positions and velocities --------------------------------------------------------------------------------------

    def position(self, degrees: float) -> int:
        """Return an angle (deg) in ticks."""
        return self.integer("position", (degrees + self.zero) * self.ticks, LONG)

    def degrees(self, ticks: float) -> float:
        """Return an angle in degrees."""
        return ticks / self.ticks - self.zero

    def move_speed(self, speed: float) -> int:
        """Return the speed of a position move (deg/s) as boards have it, 1 at least."""
        return max(self.integer("speed of a move", abs(speed * self.ticks) / 10), 1)

    def velocity(self, velocity: float) -> int:
        """Return the velocity of a velocity move (deg/s)."""
        return self.integer("velocity", velocity * self.ticks / _MS * 2**self.move_shift)

    def acceleration(self, acceleration: float) -> int:
        """Return the acceleration of a velocity move (deg/s²), 1 at least."""
        return max(self.integer("acceleration", abs(acceleration * self.ticks) / _MS**2 * 2**self.move_shift), 1)

    def broadcast_velocity(self, raw: int) -> float:
        """Return a velocity that a board broadcasts, in deg/s."""
        return float(raw / (1 << self.speed_shift) * _MS / self.ticks)

    def broadcast_acceleration(self, raw: int) -> float:
        """Return an acceleration that a board broadcasts, in deg/s²."""
        return float(raw / (1 << self.speed_shift + self.acceleration_shift) * _MS**2 / self.ticks)

    # Efforts ---------------------------------------------------------------------------------------------------------

    def duty(self, per_cent: float) -> int:
        """Return a duty cycle (per cent) in counts."""
        return self.integer("duty cycle", per_cent * self.full_duty / 100)

    def per_cent(self, duty: float) -> float:
        """Return a duty cycle in per cent."""
        return duty * 100 / self.full_duty

    def current(self, amperes: float, limits: tuple[int, int] = SHORT) -> int:
        """Return a current (A) in counts."""
        return self.integer("current", amperes * self.amperes, limits)

    def torque(self, newton_metres: float) -> int:
        """Return a torque (Nm) in counts."""
        return self.integer("torque", newton_metres * self.newtons, LONG)

    # Controllers -----------------------------------------------------------------------------------------------------

    def raw_pid(self, pid: Pid) -> RawPid:
        """Return the numbers of a position controller: gains of ticks, in a cycle of a millisecond, with a shift."""
        shift = round(min(max(pid.scale, 0.0), _MOST_SHIFT))
        gain = self._gain(shift)
        return RawPid(
            self.integer("kp", pid.kp * gain),
            self.integer("ki", pid.ki * gain / _MS),
            self.integer("kd", pid.kd * gain * _MS),
            shift,
            self.duty(pid.offset),
            self.duty(pid.max_output),
            self.duty(pid.max_integral),
            self.duty(pid.stiction_up),
            self.duty(pid.stiction_down),
        )

    def pid(self, raw: RawPid) -> Pid:
        """Return the gains of a position controller, in per cent and degrees."""
        gain = self._gain(raw.shift)
        return Pid(
            kp=raw.kp / gain,
            kd=raw.kd / gain / _MS,
            ki=raw.ki / gain * _MS,
            max_integral=self.per_cent(raw.integral_limit),
            max_output=self.per_cent(raw.output_limit),
            offset=self.per_cent(raw.offset),
            scale=float(raw.shift),
            stiction_up=self.per_cent(raw.stiction_up),
            stiction_down=self.per_cent(raw.stiction_down),
        )

    def _gain(self, shift: int) -> float:
        """Return the gain of a board, counts a tick, for one per cent a degree."""
        return float(self.full_duty / 100 / self.ticks * 2**shift)
