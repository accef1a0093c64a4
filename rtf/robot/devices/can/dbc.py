"""The table of messages as a DBC file, by which other tools decode a bus. Needs cantools."""

from __future__ import annotations

from collections import OrderedDict
from typing import TYPE_CHECKING

from rtf.robot.devices.can.codec import MESSAGES, dialect_of
from rtf.robot.devices.can.codes import FOC_BOARDS, JOINT_BOARDS, BoardType
from rtf.robot.devices.can.messages import AXIS_BIT, EVERYONE, HOST, MAX_DATA, Field, Message, MessageClass
from rtf.robot.errors import DeviceError

try:
    from cantools.database import Database, Node, Signal
    from cantools.database import Message as DbcMessage
    from cantools.database.conversion import BaseConversion
except ImportError as error:
    raise DeviceError("DBC files need cantools: pip install 'rtf[can]'") from error

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from cantools.database.namedsignalvalue import NamedSignalValue

_MOTORS = frozenset({MessageClass.MOTOR_POLLING, MessageClass.MOTOR_PERIODIC})
_COMMAND = "command"


def dbc_of(boards: Mapping[int, BoardType]) -> str:
    """Return the text of a DBC file for these boards, by address.

    Commands are multiplexed signals of one message for each identifier: their first byte, which has the axis in its
    highest bit, says which. Where a command has several lengths, the longest one is described.
    """
    made = [message for address, kind in boards.items() for message in _messages(address, kind)]
    if any(kind in FOC_BOARDS for kind in boards.values()):
        setpoints = next(one for one in MESSAGES if one.name == "setpoints_4")
        made.append(_periodic(setpoints, HOST, "host_setpoints"))
    nodes = [Node("host", comment=None), *(Node(_node(address, kind)) for address, kind in boards.items())]
    database = Database(messages=sorted(made, key=lambda one: one.frame_id), nodes=nodes, version="")
    return str(database.as_dbc_string())


def _node(address: int, kind: BoardType) -> str:
    return f"board{address}_{kind.name.lower()}"


def _messages(address: int, kind: BoardType) -> Iterator[DbcMessage]:
    """Yield the messages of a board."""
    polled: dict[int, list[Message]] = {}
    named = f"board{address}"
    for message in MESSAGES:
        if not _sends(kind, message):
            continue
        if message.polled:
            polled.setdefault(message.identifier(address), []).append(message)
        elif (message.kind, message.code) != (MessageClass.MOTOR_PERIODIC, EVERYONE) and message is _longest(message):
            yield _periodic(message, address, f"{named}_{message.name}", _node(address, kind))
    for identifier, messages in polled.items():
        area = MessageClass(identifier >> 8).name.lower()
        way = "replies" if messages[0].reply else "requests"
        yield _multiplexed(identifier, messages, f"{named}_{area}_{way}", _node(address, kind))


def _sends(kind: BoardType, message: Message) -> bool:
    """Whether a type of board has a message."""
    if message.kind in _MOTORS:
        return kind in JOINT_BOARDS | FOC_BOARDS and bool(message.dialect & dialect_of(kind))
    return message.kind is MessageClass.MANAGEMENT or kind not in JOINT_BOARDS | FOC_BOARDS


def _longest(message: Message) -> Message:
    """Return the longest of the messages with the same code."""
    same = [
        one
        for one in MESSAGES
        if (one.kind, one.code, one.reply) == (message.kind, message.code, message.reply)
        and one.dialect & message.dialect
    ]
    return max(same, key=lambda one: max(one.structs))


def _periodic(message: Message, address: int, name: str, sender: str = "host") -> DbcMessage:
    return DbcMessage(
        frame_id=message.identifier(address),
        name=name,
        length=max(message.structs),
        signals=list(_signals(message, 0, "")),
        comment=message.about or None,
        senders=[sender],
    )


def _multiplexed(identifier: int, messages: list[Message], name: str, board: str) -> DbcMessage:
    """Return the message of all commands, or all answers, of one identifier."""
    signals = [Signal(_COMMAND, 0, 8, is_multiplexer=True)]
    for message in messages:
        if message is not _longest(message):
            continue
        axes = (0, 1) if message.kind is MessageClass.MOTOR_POLLING else (0,)
        for axis in axes:
            prefix = f"{message.name}_{axis}_" if len(axes) > 1 else f"{message.name}_"
            signals += _signals(message, 8, prefix, message.code | (AXIS_BIT if axis else 0))
    reply = messages[0].reply
    return DbcMessage(
        frame_id=identifier, name=name, length=MAX_DATA, signals=signals, senders=[board if reply else "host"]
    )


def _signals(message: Message, start: int, prefix: str, multiplexed: int | None = None) -> Iterator[Signal]:
    """Yield the signals of a message from a bit on."""
    for one in message.layout:
        bits = 8 * one.bytes
        if one.name and bits:
            yield from _field(one, start, prefix, multiplexed)
        start += bits


def _field(one: Field, start: int, prefix: str, multiplexed: int | None) -> Iterator[Signal]:
    """Yield the signals of a field: one, or with names of bits one for each."""
    ids, selector = (None, None) if multiplexed is None else ([multiplexed], _COMMAND)
    if one.flags is not None:
        for flag in one.flags:
            name = f"{prefix}{one.name}_{str(flag.name).lower()}"
            yield Signal(name, start + flag.bit_length() - 1, 1, multiplexer_ids=ids, multiplexer_signal=selector)
        return
    choices: OrderedDict[int, str | NamedSignalValue] | None = None
    if one.codes is not None:
        choices = OrderedDict((int(value), value.name) for value in one.codes)
    floating = one.layout == "f"  # a DBC file has no numbers of 16 bits in floating point
    yield Signal(
        f"{prefix}{one.name}",
        start + 7 if one.big_endian else start,  # a big-endian signal is given by its highest bit
        8 * one.bytes,
        byte_order="big_endian" if one.big_endian else "little_endian",
        is_signed=one.layout in "bhi",
        conversion=BaseConversion.factory(one.factor, choices=choices, is_float=floating),
        unit=one.unit or None,
        multiplexer_ids=ids,
        multiplexer_signal=selector,
    )
