"""What frames on a bus say, for people: messages by name, values in their units, codes and flags in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.devices.can import motor_messages as motor
from rtf.robot.devices.can.codec import Decoded, decode, dialect_of
from rtf.robot.devices.can.messages import HOST, Dialect, Frame, MessageClass
from rtf.robot.devices.can.sensor_messages import DISCOVER

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rtf.robot.devices.can.messages import Field

#: The periodic messages of FOC boards that joint boards do not have.
_FOC_ONLY = motor.FOC_FEEDBACK.identifier(0)
_TYPE_AND_CLASS = 0x70F


class Listener:
    """Decodes frames, and learns from them which boards are FOC boards.

    Such boards are known by their feedback, and by their answers about their versions. ``foc`` names some that are
    known before.
    """

    def __init__(self, foc: Iterable[int] = ()) -> None:
        self._foc = set(foc)

    def decode(self, frame: Frame) -> Decoded:
        """Return the message of a frame. Raises MessageError if it is none."""
        source = frame.identifier >> 4 & 0xF
        if frame.identifier & _TYPE_AND_CLASS == _FOC_ONLY:
            self._foc.add(source)
        asked = frame.identifier >> 8 in (MessageClass.MOTOR_POLLING, MessageClass.MANAGEMENT) and source == HOST
        board = frame.identifier & 0xF if asked else source
        got = decode(*frame, Dialect.FOC if board in self._foc else Dialect.JOINT)
        if got.message in (motor.VERSION.value, DISCOVER.value) and dialect_of(int(got.values[0])) is Dialect.FOC:
            self._foc.add(source)
        return got


def described(got: Decoded) -> str:
    """Return a message in words, such as ``board 3 position: position_0 500 tick, position_1 0 tick``."""
    message = got.message
    if message.polled:
        who = f"board {got.board} →" if message.reply else f"→ board {got.board}"
    else:
        who = f"board {got.source}" if got.source else "→ all boards"
    axis = f" axis {got.axis}" if message.kind is MessageClass.MOTOR_POLLING and got.message not in _OF_BOARDS else ""
    values = ", ".join(
        f"{one.name} {_shown(one, value)}" for one, value in zip(message.fields, got.values, strict=True)
    )
    return f"{who}{axis} {message.name}{': ' if values else ''}{values}"


_OF_BOARDS = (*motor.VERSION, *motor.BOARD_ID, motor.BROADCASTS)


def _shown(one: Field, value: float | bytes) -> str:
    """Return a value in words, or in its unit."""
    if isinstance(value, bytes):
        return repr(value.decode("ascii", "replace").rstrip("\0"))
    if one.codes is not None:
        return one.codes(int(value)).name.lower() if value in set(one.codes) else f"{value}"
    if one.flags is not None:
        names = [str(flag.name).lower() for flag in one.flags if int(value) & flag]
        return "|".join(names) or "none"
    number = value if one.factor == 1.0 else value * one.factor
    return f"{number:.10g}{f' {one.unit}' if one.unit else ''}"
