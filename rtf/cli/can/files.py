"""``rtf can log``, ``replay``, ``dbc`` and ``messages``: buses and their messages in files."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from rtf import clock
from rtf.cli.can.options import bus_parser, open_bus, settings_of
from rtf.cli.network.terminal import progress, say
from rtf.cli.parser import Parser, key_value, seconds
from rtf.robot.devices.can.codes import BoardType
from rtf.robot.devices.can.exchange import Exchange
from rtf.robot.devices.can.messages import ADDRESSES, Frame
from rtf.robot.errors import DeviceError
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

_KINDS = ".asc (Vector), .blf (Vector, compact), .log (candump), .csv, .db (SQLite), .trc (PEAK)"
_WAIT = 0.1


def log(words: Sequence[str]) -> int:
    """Record a bus in a file until a signal."""
    parser = bus_parser(
        "log", f"Record a bus. The ending of the file's name says the format: {_KINDS}.", "rtf can log run.blf"
    )
    parser.add_argument("file", type=Path, help="the file to write")
    parser.add_argument("--seconds", type=seconds, help="end after a time (default: with a signal)")
    options = parser.parse_args(words)
    from rtf.robot.devices.can.interfaces import can, open_interface

    settings = settings_of(parser, options)
    try:
        logger = can.Logger(options.file)
    except (ValueError, OSError) as error:
        parser.error(f"argument file: {error}")
    deadline, count = clock.Deadline.after(options.seconds), 0
    with logger, open_interface(settings) as bus:
        progress(f"recording {settings.name}")
        try:
            while not deadline.expired:
                message = bus.recv(min(_WAIT, deadline.remaining()))
                if message is not None:
                    logger(message)
                    count += 1
        except can.CanError as error:
            raise DeviceError(f"the CAN bus {settings.name} cannot be read: {error}") from error
        finally:
            say(f"{count} frames in {options.file}")
    return ExitCode.PASSED


def replay(words: Sequence[str]) -> int:
    """Send the frames of a file to a bus, at the times at which they were recorded."""
    parser = bus_parser(
        "replay",
        f"Send recorded frames to a bus, at their times: {_KINDS}. Only what boards sent, unless --commands lets a "
        "recording move a robot again.",
        "rtf can replay run.blf --interface virtual --channel bench",
    )
    parser.add_argument("file", type=Path, help="the file to read")
    parser.add_argument("--commands", action="store_true", help="send what the host sent, too: motors may move")
    parser.add_argument("--fast", action="store_true", help="without the pauses")
    options = parser.parse_args(words)
    count, skipped = 0, 0
    with open_bus(parser, options) as bus:
        first, began = None, clock.monotonic()
        for frame, stamp in _recorded(options.file):
            if not options.commands and not frame.identifier >> 4 & 0xF:
                skipped += 1
                continue
            first = stamp if first is None else first
            if not options.fast:
                clock.sleep(stamp - first - (clock.monotonic() - began))
            bus.send(frame)
            count += 1
    say(f"{count} frames sent{f'; {skipped} commands of the host were not' if skipped else ''}")
    return ExitCode.PASSED


def _recorded(file: Path) -> Iterator[tuple[Frame, float]]:
    """Yield the data frames of a file with their times. Raises DeviceError for a file that cannot be read."""
    from rtf.robot.devices.can.interfaces import can

    try:
        with can.LogReader(file) as reader:
            for message in reader:
                if not (message.is_error_frame or message.is_extended_id or message.is_remote_frame or message.is_fd):
                    yield Frame(message.arbitration_id, bytes(message.data)), message.timestamp
    except Exception as error:  # readers of formats raise whatever comes of a damaged file
        raise DeviceError(f"{file} cannot be replayed: {error}") from error


def dbc(words: Sequence[str]) -> int:
    """Print, or write, a DBC file for the boards of a bus."""
    parser = bus_parser(
        "dbc",
        "A DBC file, by which other tools decode a bus: for boards that are given, or those that answer on the bus.",
        "rtf can dbc --board 1=MC_4DC --board 13=STRAIN > arm.dbc",
    )
    parser.add_argument("file", type=Path, nargs="?", help="the file to write (default: standard output)")
    parser.add_argument(
        "--board",
        type=_board,
        action="append",
        default=[],
        metavar="N=TYPE",
        help="a board; without one, the bus is asked",
    )
    options = parser.parse_args(words)
    from rtf.robot.devices.can.dbc import dbc_of

    boards = dict(options.board)
    if not boards:
        with open_bus(parser, options) as bus:
            found = Exchange(bus).discover()
        if not found:
            raise DeviceError("no board answers; give the boards by --board N=TYPE")
        boards = {one.board: BoardType(one.board_type) for one in found}
    text = dbc_of(boards)
    if options.file is None:
        say(text.rstrip())
    else:
        options.file.write_text(text, encoding="cp1252", newline="")  # the encoding of DBC files
    return ExitCode.PASSED


def _board(text: str) -> tuple[int, BoardType]:
    """Read ``N=TYPE``."""
    number, name = key_value(text)
    if not number.isdecimal() or int(number) not in ADDRESSES:
        raise argparse.ArgumentTypeError(f"{number} is no address of a board; these are 1 to 14")
    if name.upper() not in BoardType.__members__:
        raise argparse.ArgumentTypeError(f"there is no type {name}; there are {', '.join(BoardType.__members__)}")
    return int(number), BoardType[name.upper()]


def messages(words: Sequence[str]) -> int:
    """Print the table of messages."""
    Parser(prog="rtf can messages", description="Print all messages on the buses, in Markdown.").parse_args(words)
    from rtf.robot.devices.can.message_page import message_page

    say(message_page().rstrip())
    return ExitCode.PASSED
