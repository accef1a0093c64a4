"""What a message on a CAN bus of the iCub is made of: its identifier, its fields, and how both become a frame.

An identifier has eleven bits: three of the class, four of the source address, four of the destination address or, in
the periodic classes, of the type. A polled message begins with its command; in the motor class, the highest bit of
this byte is the axis. The messages themselves are in :mod:`motor_messages` and :mod:`sensor_messages`.
Source: the identifiers and layouts of the firmware's public headers, as facts; see ``docs/can.md``.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from enum import Flag, IntEnum, auto
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from rtf.robot.errors import MessageError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from enum import IntFlag

#: The address of the host, and the destination of messages to all boards.
HOST, EVERYONE = 0, 15
#: The addresses that a board may have.
ADDRESSES = range(1, 15)
#: The greatest number of data bytes of a frame.
MAX_DATA = 8
#: Of the eleven bits of an identifier.
GREATEST_IDENTIFIER = 0x7FF
#: The bit of a motor command that stands for the second axis of a board.
AXIS_BIT = 0x80


class MessageClass(IntEnum):
    """The class of a message: the three highest bits of its identifier, which also have it win the arbitration."""

    MOTOR_POLLING = 0
    MOTOR_PERIODIC = 1
    SENSOR_POLLING = 2
    SENSOR_PERIODIC = 3
    SKIN_PERIODIC = 4
    INERTIAL_PERIODIC = 5
    BATTERY_PERIODIC = 6
    MANAGEMENT = 7


#: The classes whose messages have a destination and begin with a command.
POLLING = frozenset({MessageClass.MOTOR_POLLING, MessageClass.SENSOR_POLLING, MessageClass.MANAGEMENT})


class Dialect(Flag):
    """The two kinds of motor boards, which give some commands and types different meanings.

    A ``JOINT`` board controls the positions of two joints; a ``FOC`` board is the drive of one motor, and gets a new
    setpoint every millisecond.
    """

    JOINT = auto()
    FOC = auto()
    BOTH = JOINT | FOC


class Frame(NamedTuple):
    """A data frame: its identifier of eleven bits, and up to eight bytes."""

    identifier: int
    data: bytes


#: Makes a frame of a pair, in a third of the time: for the loops that run for every frame.
make_frame: Callable[[tuple[int, bytes]], Frame] = partial(tuple.__new__, Frame)


@dataclass(frozen=True, slots=True)
class Field:
    """A number, or a text of up to ``size`` bytes, in the data of a message.

    A number times ``factor`` is a value in ``unit``. What a tick is, and other such units, is a matter of
    configuration. ``flags`` names the bits, ``codes`` the values, of numbers that have such; others may arrive. A field
    without a name is padding of ``size`` bytes: sent as zeros, and not read.
    """

    name: str
    layout: str  # a letter of struct: s for a text, which is the last field of its message, x for padding
    unit: str = ""
    factor: float = 1.0
    flags: type[IntFlag] | None = None
    codes: type[IntEnum] | None = None
    big_endian: bool = False
    least_size: int = 0
    size: int = 0

    @property
    def bytes(self) -> int:
        """The greatest number of bytes of the field."""
        return self.size or struct.calcsize("<" + self.layout)

    @property
    def range(self) -> tuple[int, int] | None:
        """The least and greatest integer of the field; None for a text, and a number in floating point."""
        if self.layout not in "bBhHiI":
            return None
        values = 1 << 8 * self.bytes
        return (0, values - 1) if self.layout.isupper() else (-values // 2, values // 2 - 1)


@dataclass(frozen=True, slots=True)
class Message:
    """One kind of message. ``code`` is its command, or in a periodic class its type.

    ``reply``: it is the answer of a board, not the request of the host. The sender of a periodic message is a board;
    only the setpoints of FOC boards come from the host, and their ``board`` is ``HOST``.
    """

    kind: MessageClass
    code: int
    name: str
    layout: tuple[Field, ...] = ()
    reply: bool = False
    dialect: Dialect = Dialect.BOTH
    about: str = ""
    #: The fields that have a value, in the order of the values.
    fields: tuple[Field, ...] = field(init=False, repr=False, compare=False)
    #: The structs of the data, the command included, by the length of the data: one, or one for each length of a text.
    structs: dict[int, struct.Struct] = field(init=False, repr=False, compare=False)
    _pack: Callable[..., bytes] | None = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        text = self.layout[-1] if self.layout and self.layout[-1].layout == "s" else None
        order = ">" if any(one.big_endian for one in self.layout) else "<"
        start = order + "B" * self.polled + "".join(_letter(one) for one in self.layout if one is not text)
        formats = [f"{start}{n}s" for n in range(text.least_size, text.size + 1)] if text else [start]
        structs = [struct.Struct(one) for one in formats]
        object.__setattr__(self, "fields", tuple(one for one in self.layout if one.name))
        object.__setattr__(self, "structs", {one.size: one for one in structs})
        object.__setattr__(self, "_pack", None if text else structs[0].pack)

    @property
    def polled(self) -> bool:
        """Whether the message has a destination and begins with its command."""
        return self.kind in POLLING

    def identifier(self, board: int) -> int:
        """Return the identifier of this message to, or from, a board."""
        if not self.polled:
            return self.kind << 8 | board << 4 | self.code
        return self.kind << 8 | (board << 4 if self.reply else board)

    def frame(self, board: int, *values: float | bytes, axis: int = 0) -> Frame:
        """Return the frame with these values of the fields, in their order.

        ``board`` is the address of the board that gets or sends it, 0 to 15; ``axis`` is 0 or 1, and counts for
        polled messages of motors and sensors. Raises MessageError for a value that does not fit: nothing is cut off,
        and no integer wraps.
        """
        kind = self.kind
        if not 0 <= board <= EVERYONE or not 0 <= axis <= 1:
            raise MessageError(f"{self.name}: there is no board {board} with an axis {axis}; use 0 to 15, and 0 or 1")
        try:
            pack = self._pack or self._pack_text(values)
            if kind not in POLLING:
                return Frame(kind << 8 | board << 4 | self.code, pack(*values))
            command = self.code | AXIS_BIT if axis and kind is not MessageClass.MANAGEMENT else self.code
            return Frame(kind << 8 | (board << 4 if self.reply else board), pack(command, *values))
        except (struct.error, OverflowError, TypeError) as error:
            raise MessageError(self._unsuitable(values)) from error

    def _pack_text(self, values: tuple[float | bytes, ...]) -> Callable[..., bytes]:
        """Return what packs a text of the length of the last value. Raises TypeError without such a text."""
        text = self.fields[-1]
        last = values[-1] if values else None
        if not isinstance(last, bytes) or not text.least_size <= len(last) <= text.size:
            raise TypeError
        return self.structs[max(self.structs) - text.size + len(last)].pack

    def _unsuitable(self, values: tuple[float | bytes, ...]) -> str:
        """Return what is wrong with the values of a frame."""
        if len(values) != len(self.fields):
            named = ", ".join(one.name for one in self.fields) or "none"
            return f"{self.name} has {len(self.fields)} values ({named}), not {len(values)}"
        for one, value in zip(self.fields, values, strict=True):
            span = one.range
            if span is not None and not (isinstance(value, int) and span[0] <= value <= span[1]):
                return f"{self.name}: {one.name} is an integer from {span[0]} to {span[1]}, not {value!r}"
            if one.layout == "s" and not (isinstance(value, bytes) and one.least_size <= len(value) <= one.size):
                return f"{self.name}: {one.name} has {one.least_size} to {one.size} bytes, not {value!r}"
        return f"{self.name}: {values} do not fit into its fields"


def _letter(one: Field) -> str:
    return f"{one.size}x" if one.layout == "x" else one.layout


# Fields ----------------------------------------------------------------------------------------------------------


def u8(name: str, unit: str = "", factor: float = 1.0) -> Field:
    """Return a field of 8 bits without a sign."""
    return Field(name, "B", unit, factor)


def i16(name: str, unit: str = "", factor: float = 1.0) -> Field:
    """Return a field of 16 bits with a sign."""
    return Field(name, "h", unit, factor)


def u16(name: str, unit: str = "", factor: float = 1.0, *, big_endian: bool = False) -> Field:
    """Return a field of 16 bits without a sign."""
    return Field(name, "H", unit, factor, big_endian=big_endian)


def i32(name: str, unit: str = "", factor: float = 1.0) -> Field:
    """Return a field of 32 bits with a sign."""
    return Field(name, "i", unit, factor)


def f32(name: str, unit: str = "") -> Field:
    """Return a field of a floating-point number of 32 bits."""
    return Field(name, "f", unit)


def f16(name: str, unit: str = "") -> Field:
    """Return a field of a floating-point number of 16 bits."""
    return Field(name, "e", unit)


def code(name: str, codes: type[IntEnum]) -> Field:
    """Return a field of 8 bits that is one of some codes; others may arrive."""
    return Field(name, "B", codes=codes)


def flags(name: str, names: type[IntFlag], layout: str = "B") -> Field:
    """Return a field of bits."""
    return Field(name, layout, flags=names)


def text(name: str, least: int, most: int) -> Field:
    """Return a field of some bytes, the last one of its message."""
    return Field(name, "s", least_size=least, size=most)


def pad(size: int = 1) -> Field:
    """Return some bytes without a meaning."""
    return Field("", "x", size=size)


# Kinds of messages -----------------------------------------------------------------------------------------------


class Question(NamedTuple):
    """A request that a board answers once, and the answer."""

    get: Message
    value: Message

    @property
    def repeats(self) -> bool:
        """Whether the answer begins with the values of the request."""
        return _repeats(self.get, self.value)


class Setting(NamedTuple):
    """A command that sets something, which a board does not answer; the request of its value, and the answer."""

    set: Message
    get: Message
    value: Message

    @property
    def repeats(self) -> bool:
        """Whether the answer begins with the values of the request."""
        return _repeats(self.get, self.value)


def _repeats(request: Message, answer: Message) -> bool:
    return bool(request.fields) and request.fields == answer.fields[: len(request.fields)]


def question(
    kind: MessageClass,
    code: int,
    name: str,
    *reply: Field,
    request: tuple[Field, ...] = (),
    dialect: Dialect = Dialect.BOTH,
    about: str = "",
) -> Question:
    """Return a request, ``get_`` and the name, and the answer, which has the name."""
    return Question(
        Message(kind, code, f"get_{name}", request, dialect=dialect, about=about),
        Message(kind, code, name, reply, reply=True, dialect=dialect, about=about),
    )


def setting(
    kind: MessageClass,
    codes: tuple[int, int],
    name: str,
    *layout: Field,
    request: tuple[Field, ...] = (),
    dialect: Dialect = Dialect.BOTH,
    about: str = "",
) -> Setting:
    """Return a command, ``set_`` and the name, and the question for the same fields; ``codes`` are of both, in turn."""
    made = Message(kind, codes[0], f"set_{name}", layout, dialect=dialect, about=about)
    return Setting(made, *question(kind, codes[1], name, *layout, request=request, dialect=dialect, about=about))


def messages_of(names: Mapping[str, object]) -> tuple[Message, ...]:
    """Return the messages among the values of a module's names, those of questions, settings and rows included."""
    found: list[Message] = []
    for value in names.values():
        found += [one for one in (value if isinstance(value, tuple) else (value,)) if isinstance(one, Message)]
    return tuple(found)
