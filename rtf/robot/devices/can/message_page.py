"""The table of messages as a page of the documentation, in Markdown."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.devices.can.codec import MESSAGES
from rtf.robot.devices.can.messages import Dialect, Message, MessageClass

if TYPE_CHECKING:
    from collections.abc import Iterator

_HEADING = """\
# Messages on the CAN buses

Written by `rtf can messages`; see [CAN](can.md). An identifier is `class << 8 | source << 4 | destination`, in periodic
classes `class << 8 | board << 4 | type`. A polled message begins with its command; the highest bit of a command to
motors is the axis. Numbers are little-endian unless `BE` says otherwise. A number times the factor of its unit is
the value.
"""
_BOARDS = {Dialect.JOINT: "joint", Dialect.FOC: "FOC", Dialect.BOTH: "all"}
_TYPES = {"b": "i8", "B": "u8", "h": "i16", "H": "u16", "i": "i32", "I": "u32", "f": "f32", "e": "f16", "s": "text"}


def message_page() -> str:
    """Return the page."""
    return _HEADING + "".join(_section(kind) for kind in MessageClass if _of(kind))


def _of(kind: MessageClass) -> list[Message]:
    return sorted((one for one in MESSAGES if one.kind is kind), key=lambda one: (one.code, one.reply, one.name))


def _section(kind: MessageClass) -> str:
    """Return the table of a class."""
    code = "command" if _of(kind)[0].polled else "type"
    lines = [
        f"\n## Class {kind.value}: {kind.name.lower().replace('_', ' ')}\n",
        f"| {code} | message | from | boards | bytes | fields | note |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    return "\n".join([*lines, *map(_row, _of(kind))]) + "\n"


def _row(message: Message) -> str:
    sizes = sorted(message.structs)
    size = f"{sizes[0]} to {sizes[-1]}" if len(sizes) > 1 else f"{sizes[0]}"
    host = (message.polled and not message.reply) or message.name.startswith("setpoints")
    cells = (
        f"{message.code:#04x}",
        f"`{message.name}`",
        "host" if host else "board",
        _BOARDS[message.dialect],
        size,
        ", ".join(_fields(message)),
        message.about.replace("|", "\\|"),
    )
    return "| " + " | ".join(cells) + " |"


def _fields(message: Message) -> Iterator[str]:
    for one in message.layout:
        if not one.name:
            yield f"{one.size} unused"
            continue
        unit = f" ({'' if one.factor == 1 else f'{one.factor:.6g} '}{one.unit})" if one.unit else ""
        yield f"{_TYPES[one.layout]}{' BE' if one.big_endian else ''} {one.name}{unit}"
