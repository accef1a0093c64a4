"""Decoding of frames by the table of messages. Encoding is :meth:`Message.frame`."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from rtf.robot.devices.can import motor_messages, sensor_messages
from rtf.robot.devices.can.codes import FOC_BOARDS
from rtf.robot.devices.can.messages import (
    AXIS_BIT,
    EVERYONE,
    GREATEST_IDENTIFIER,
    HOST,
    MAX_DATA,
    POLLING,
    Dialect,
    Message,
    MessageClass,
)
from rtf.robot.errors import MessageError

if TYPE_CHECKING:
    from collections.abc import Callable

#: All messages of both dialects.
MESSAGES: tuple[Message, ...] = (*motor_messages.MESSAGES, *sensor_messages.MESSAGES)
_POLLED = frozenset(int(kind) for kind in POLLING)
_MANAGEMENT = int(MessageClass.MANAGEMENT)


def dialect_of(board: int) -> Dialect:
    """Return the dialect of a type of board: ``FOC`` of drives of motors, ``JOINT`` of all others."""
    return Dialect.FOC if board in FOC_BOARDS else Dialect.JOINT


class Decoded(NamedTuple):
    """A message that has arrived: who sent it to whom, for which axis, and the values of its fields as they were sent.

    The destination of a periodic message is ``EVERYONE``, and its axis 0.
    """

    message: Message
    source: int
    destination: int
    axis: int
    values: tuple[float | bytes, ...]

    @property
    def board(self) -> int:
        """The address of the board that sent the message, or got it from the host."""
        return self.source or (self.destination if self.message.polled else HOST)

    def scaled(self) -> dict[str, float | bytes]:
        """Return the values by the names of their fields, in their units."""
        return {
            one.name: value if isinstance(value, bytes) or one.factor == 1.0 else value * one.factor
            for one, value in zip(self.message.fields, self.values, strict=True)
        }


#: A message and the function that unpacks its data, by class, direction, code and length of the data.
_Table = dict[int, tuple[Message, "Callable[[bytes], tuple[float | bytes, ...]]"]]


def _key(kind: int, code: int, size: int, *, reply: bool) -> int:
    return kind << 13 | reply << 12 | code << 4 | size


def _table(dialect: Dialect) -> _Table:
    table: _Table = {}
    for message in MESSAGES:
        if message.dialect & dialect:
            for size, layout in message.structs.items():
                key = _key(message.kind, message.code, size, reply=message.reply)
                if key in table:
                    raise AssertionError(f"{message.name} and {table[key][0].name} have the same code and length")
                table[key] = message, layout.unpack
    return table


_TABLES = {dialect: _table(dialect) for dialect in (Dialect.JOINT, Dialect.FOC)}


def decode(identifier: int, data: bytes, dialect: Dialect = Dialect.JOINT) -> Decoded:
    """Return the message of a frame of a board with this dialect, ``JOINT`` or ``FOC``; boards of sensors have either.

    Raises MessageError for an identifier, a command or a type that does not exist, and for a wrong length.
    """
    kind = identifier >> 8
    source, low = identifier >> 4 & 0xF, identifier & 0xF
    size = len(data)
    axis, start = 0, 0
    if kind in _POLLED:
        if not size:
            raise MessageError(f"the frame {identifier:03X} has no data; it begins with a command")
        destination, reply, code, start = low, source != HOST, data[0], 1
        if kind != _MANAGEMENT:
            axis, code = code >> 7, code & ~AXIS_BIT
    else:
        destination, reply, code = EVERYONE, False, low
    found = _TABLES[dialect].get(kind << 13 | reply << 12 | code << 4 | size)
    if found is None or not 0 <= identifier <= GREATEST_IDENTIFIER:
        raise MessageError(_unknown(identifier, data, code, dialect, reply=reply))
    message, unpack = found
    values = unpack(data)
    return Decoded(message, source, destination, axis, values[start:] if start else values)


def _unknown(identifier: int, data: bytes, code: int, dialect: Dialect, *, reply: bool) -> str:
    """Return why a frame is no message."""
    shown = f"the frame {identifier:03X}#{data.hex().upper()}"
    if not 0 <= identifier <= GREATEST_IDENTIFIER:
        return f"{shown} has an identifier of more than 11 bits"
    if len(data) > MAX_DATA:
        return f"{shown} has more than 8 bytes"
    kind = MessageClass(identifier >> 8)
    named = sorted(
        (size, message.name)
        for size in range(MAX_DATA + 1)
        for message, _ in [_TABLES[dialect].get(_key(kind, code, size, reply=reply), (None, None))]
        if message is not None
    )
    if named:
        sizes = " or ".join(str(size) for size, _ in named)
        return f"{shown}: {named[0][1]} has {sizes} bytes of data, not {len(data)}"
    what = "command" if kind in POLLING else "type"
    word = kind.name.lower().replace("_", " ")
    return (
        f"{shown}: there is no {what} {code} in the class {kind.value} ({word}) of {'answers' if reply else 'messages'}"
    )
