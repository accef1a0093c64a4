"""The settings of an axis as its joint board has them: numbers as they were sent, and what they mean.

Positions are in ticks; a gain is its number divided by two to the power of its shift, in the units of a controller that
is computed every millisecond: counts of output a tick, a tick/ms, and a tick and ms.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rtf.robot.devices.can import motor_messages as m
from rtf.robot.devices.can.messages import Dialect, Setting
from rtf.robot.interfaces import Pid

if TYPE_CHECKING:
    from rtf.robot.devices.can.messages import Message
    from rtf.simulator.firmware.board import Values

#: The output of a controller, or a duty cycle, of 100 %.
FULL_OUTPUT = 32000
#: Counts of a torque a newton metre, and of impedances: a Nm/deg, a Nm s/deg, a Nm.
TORQUE_COUNTS, IMPEDANCE_COUNTS = 256.0, 1000.0
_MOST, _MOST_SHIFT = (1 << 15) - 1, 15
#: The shift of velocities and accelerations until the host sets another one, and those of the estimators.
VELOCITY_SHIFT = 4
ESTIMATOR_SHIFT = 5
#: All settings that are written by one message and read by another one, of boards of joints and of drives.
_ALL = [one for one in vars(m).values() if isinstance(one, Setting)]
SETTINGS, DRIVE_SETTINGS = (
    tuple(one for one in _ALL if one.set.dialect & dialect) for dialect in (Dialect.JOINT, Dialect.FOC)
)
#: The settings of single gains, and where they are in those of controllers.
_PARTS: dict[Setting, tuple[Setting, int]] = {
    m.P_GAIN: (m.POSITION_PID, 0),
    m.I_GAIN: (m.POSITION_PID, 1),
    m.D_GAIN: (m.POSITION_PID, 2),
    m.GAIN_SCALE: (m.POSITION_PID, 3),
    m.OUTPUT_OFFSET: (m.POSITION_LIMITS, 0),
    m.OUTPUT_LIMIT: (m.POSITION_LIMITS, 1),
    m.INTEGRAL_LIMIT: (m.POSITION_LIMITS, 2),
}
#: The settings that the position controller of an axis is made of.
PARTS_OF_PID = (m.POSITION_PID, m.POSITION_LIMITS, m.POSITION_STICTION, m.MODEL_PARAMETERS, *_PARTS)
#: What must have been set before an axis is given power: gains and limits.
_NEEDED = frozenset({"set_position_pid", "set_position_limits", "set_min_position", "set_max_position"})


class Settings:
    """The settings of a board. ``written`` has the values of each by the name of its command.

    Where a request has values, such as the number of a parameter, there is a setting for each of them, with the values
    behind the name.
    """

    def __init__(self) -> None:
        self.written: dict[str, Values] = {}

    def write(self, setting: Setting, values: Values) -> None:
        """Set a setting."""
        self.written[_key(setting, values)] = values

    def value(self, setting: Setting, asked: Values = ()) -> Values:
        """Return the values of a setting, which begin with those of the request; zeros until it was set."""
        found = self.written.get(_key(setting, asked))
        return found or (*asked, *_ZEROS[setting.set.name][len(asked) :])

    def number(self, setting: Setting, place: int = 0) -> float:
        """Return one number of a setting."""
        value = self.value(setting)[place]
        if isinstance(value, bytes):
            raise TypeError(f"{setting.set.name} has no number in place {place}")
        return value


def _key(setting: Setting, values: Values) -> str:
    asked = values[: len(setting.get.fields)] if setting.repeats else ()
    return " ".join(map(str, (setting.set.name, *asked)))


class AxisParameters(Settings):
    """The settings of one axis of a board that controls joints."""

    def __init__(self, ticks: float) -> None:
        super().__init__()
        self.ticks = ticks
        self.velocity_shift = VELOCITY_SHIFT
        self.velocity_timeout: float | None = None

    @property
    def configured(self) -> bool:
        """Whether gains and limits have been received."""
        return self.written.keys() >= _NEEDED

    def write(self, setting: Setting, values: Values) -> None:
        """Set a setting. Those of single gains are parts of the settings of controllers."""
        if setting in _PARTS:
            setting, place = _PARTS[setting]
            whole = self.value(setting)
            values = (*whole[:place], *values, *whole[place + 1 :])
        super().write(setting, values)

    def value(self, setting: Setting, asked: Values = ()) -> Values:
        if setting in _PARTS:
            whole, place = _PARTS[setting]
            return (super().value(whole)[place],)
        return super().value(setting, asked)

    def limits(self) -> tuple[float, float]:
        """Return the limits of the position (deg)."""
        return self.number(m.MIN_POSITION) / self.ticks, self.number(m.MAX_POSITION) / self.ticks

    def speed(self, number: float) -> float:
        """Return the speed (deg/s) of a number in a command."""
        return number / 2.0**self.velocity_shift * 1e3 / self.ticks

    def acceleration(self, number: float) -> float:
        """Return the acceleration (deg/s²) of a number in a command, which is at least 1."""
        return max(number, 1.0) / 2.0**self.velocity_shift * 1e6 / self.ticks

    def pid(self) -> Pid:
        """Return the position controller, in per cent of output, deg and s."""
        kp, ki, kd, shift = (self.number(m.POSITION_PID, place) for place in range(4))
        offset, most, most_integral = (self.number(m.POSITION_LIMITS, place) for place in range(3))
        up, down = self.number(m.POSITION_STICTION, 0), self.number(m.POSITION_STICTION, 1)
        ahead, ahead_shift = self.number(m.MODEL_PARAMETERS, 0), self.number(m.MODEL_PARAMETERS, 1)
        scale, per_cent = 2.0**shift, 100.0 / FULL_OUTPUT
        return Pid(
            kp=kp / scale * self.ticks * per_cent,
            kd=kd / scale * self.ticks * per_cent / 1e3,
            ki=ki / scale * self.ticks * per_cent * 1e3,
            max_integral=most_integral * per_cent,
            max_output=most * per_cent,
            offset=offset * per_cent,
            stiction_up=up * per_cent,
            stiction_down=down * per_cent,
            feedforward=ahead / 2.0**ahead_shift * self.ticks * per_cent / 1e3,
        )

    def impedance(self) -> tuple[float, float, float]:
        """Return stiffness (Nm/deg), damping (Nm s/deg) and offset (Nm)."""
        stiffness, damping, offset = (self.number(m.IMPEDANCE, place) / IMPEDANCE_COUNTS for place in range(3))
        return stiffness, damping, offset


def shift_of(greatest: float) -> int:
    """Return the greatest shift with which a gain of so many counts, not 0, still fits into 16 bits."""
    return min(max(math.floor(math.log2(_MOST / abs(greatest))), 0), _MOST_SHIFT)


def feedforward_of(pid: Pid, ticks: float) -> tuple[int, int]:
    """Return the feedforward of a controller as a number and a shift."""
    counts = pid.feedforward / ticks / 100.0 * FULL_OUTPUT * 1e3
    shift = shift_of(counts) if counts else 0
    return round(counts * 2**shift), shift


def _zeros(message: Message) -> tuple[float | bytes, ...]:
    return tuple(bytes(one.size) if one.layout == "s" else 0 for one in message.fields)


_ZEROS = {one.set.name: _zeros(one.set) for one in _ALL}
