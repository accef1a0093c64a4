"""``rtf can monitor`` and ``rtf can load``: what is sent on a bus, as it is sent."""

from __future__ import annotations

import fnmatch
import sys
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING

from rtf import clock
from rtf.cli.can.options import addresses, bus_parser, open_bus
from rtf.cli.network.ports import Table, show, show_live
from rtf.cli.network.terminal import say
from rtf.cli.parser import seconds
from rtf.robot.devices.can.bus import LoadMeter
from rtf.robot.devices.can.frame_bits import frame_bits
from rtf.robot.devices.can.listener import Listener, described
from rtf.robot.devices.can.messages import Frame
from rtf.robot.errors import MessageError
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator, Sequence

    from rtf.robot.devices.can.bus import CanBus

#: Seconds between two looks of a live table.
_LOOK = 0.5
_NUMBERS = ("FRAMES", "FRAMES/S", "BITS", "LOAD")


def monitor(words: Sequence[str]) -> int:
    """Print the messages of a bus, or a live table of them, until a signal."""
    parser = bus_parser(
        "monitor",
        "The messages on a bus, by name. On a terminal as a table with the latest values and rates, else a line each.",
        "rtf can monitor --board 1,2 --message 'position*'",
    )
    parser.add_argument("--board", type=addresses, default=(), metavar="N,M", help="messages to and from these only")
    parser.add_argument("--message", default="*", metavar="PATTERN", help="messages whose names match only")
    parser.add_argument("--foc", type=addresses, default=(), metavar="N,M", help="boards that drive motors, if unknown")
    parser.add_argument("--lines", action="store_true", help="a line each, also on a terminal")
    parser.add_argument("--seconds", type=seconds, help="end after a time (default: with a signal)")
    options = parser.parse_args(words)
    with open_bus(parser, options) as bus:
        deadline = clock.Deadline.after(options.seconds)
        if sys.stdout.isatty() and not options.lines:
            show_live(_tables(bus, options, deadline))
        else:
            _lines(bus, options, deadline)
    return ExitCode.PASSED


def _wanted(options: argparse.Namespace, frame: Frame, listener: Listener) -> str | None:
    """Return a frame in words, if it is asked for; a frame that is no message is, without names to match."""
    try:
        got = listener.decode(frame)
    except MessageError as error:
        return f"[no message] {error}" if options.message == "*" and not options.board else None
    if options.board and got.board not in options.board:
        return None
    return described(got) if fnmatch.fnmatchcase(got.message.name, options.message) else None


def _lines(bus: CanBus, options: argparse.Namespace, deadline: clock.Deadline) -> None:
    """Print each message with its time."""
    arrived: SimpleQueue[tuple[Frame, float]] = SimpleQueue()
    listener = Listener(options.foc)
    bus.subscribe(lambda frame, stamp: arrived.put((frame, stamp)))
    while not deadline.expired:
        try:
            frame, stamp = arrived.get(timeout=min(deadline.remaining(), _LOOK))
        except Empty:
            continue
        text = _wanted(options, frame, listener)
        if text is not None:
            say(f"{stamp:.6f} {frame.identifier:03X} [{len(frame.data)}] {frame.data.hex(' ').upper():<23}  {text}")


def _tables(bus: CanBus, options: argparse.Namespace, deadline: clock.Deadline) -> Iterator[list[Table]]:
    """Yield a table of all identifiers, with the latest message of each, again and again."""
    listener, before = Listener(options.foc), dict[int, int]()
    looked, meter = clock.monotonic(), LoadMeter(bus)
    while not deadline.expired:
        clock.sleep(min(_LOOK, deadline.remaining()))
        now, load = clock.monotonic(), meter.load()
        title = f"{bus.name}: load {load.share:.1%}, {load.rate:.0f} frames/s{', OFF' if bus.off else ''}"
        table = Table(("ID", "FRAMES", "FRAMES/S", "LATEST"), numbers=_NUMBERS, title=title)
        for number, one in sorted(bus.traffic.items()):
            text = _wanted(options, Frame(number, one.data), listener)
            if text is not None:
                rate = (one.frames - before.get(number, 0)) / (now - looked)
                table.rows.append((f"{number:03X}", str(one.frames), f"{rate:.1f}", text))
        before, looked = {number: one.frames for number, one in [*bus.traffic.items()]}, now
        yield [table]


def load(words: Sequence[str]) -> int:
    """Measure the load of a bus, by identifier."""
    parser = bus_parser(
        "load",
        "The load of a bus: the share of its bits, stuffed ones included, that each identifier takes.",
        "rtf can load --interface socketcan --channel can0 --seconds 10",
    )
    parser.add_argument("--seconds", type=seconds, default=2.0, help="how long to listen (default: %(default)s)")
    options = parser.parse_args(words)
    with open_bus(parser, options) as bus:
        began = clock.monotonic()
        clock.sleep(options.seconds)
        took = clock.monotonic() - began
        traffic = [(Frame(number, one.data), one.frames / took) for number, one in sorted(bus.traffic.items())]
    table = Table(("ID", "FRAMES/S", "BITS", "LOAD", "MESSAGE"), numbers=_NUMBERS)
    listener, total = Listener(), 0.0
    for frame, rate in traffic:
        bits = frame_bits(frame)
        share = rate * bits / options.bitrate
        total += share
        table.rows.append((f"{frame.identifier:03X}", f"{rate:.1f}", str(bits), f"{share:.2%}", _name(listener, frame)))
    table.rows.append(("all", f"{sum(rate for _, rate in traffic):.1f}", "", f"{total:.2%}", ""))
    show(table)
    return ExitCode.PASSED


def _name(listener: Listener, frame: Frame) -> str:
    try:
        got = listener.decode(frame)
    except MessageError:
        return "-"
    return f"board {got.board} {got.message.name}" if got.board else got.message.name
