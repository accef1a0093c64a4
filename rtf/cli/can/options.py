"""The options of all commands for a bus, and the bus that they name."""

from __future__ import annotations

import argparse
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rtf.bottle import Bottle
from rtf.cli.network.terminal import report
from rtf.cli.parser import Parser, count, key_value, port
from rtf.robot.devices.can.bus_settings import BITRATE, BusSettings
from rtf.robot.devices.can.messages import ADDRESSES

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.robot.devices.can.bus import CanBus

_INTERFACE = "udp_multicast"


def bus_parser(word: str, description: str, example: str) -> Parser:
    """Return the parser of a command for a bus."""
    parser = Parser(prog=f"rtf can {word}", description=description, epilog=f"example:\n  {example}")
    group = parser.add_argument_group("the bus")
    group.add_argument(
        "--interface", default=_INTERFACE, metavar="NAME", help="interface of python-can (default: %(default)s)"
    )
    group.add_argument("--channel", help="its channel, such as can0 (default: the group of udp_multicast)")
    group.add_argument("--bitrate", type=count, default=BITRATE, help="bit/s (default: %(default)s)")
    group.add_argument("--port", type=port, help="udp_multicast, datagrams: the port of the bus (default: 43113)")
    group.add_argument(
        "--option", metavar="NAME=VALUE", type=key_value, action="append", default=[], help="of the interface"
    )
    return parser


def settings_of(parser: Parser, options: argparse.Namespace) -> BusSettings:
    """Return the settings of the bus; ends with a usage error without a channel."""
    from rtf.robot.devices.can.bus_settings import GROUPS, MULTICAST_GROUP, MULTICAST_PORT

    given = {name: _value(text) for name, text in options.option}
    if options.interface in GROUPS:
        options.channel = options.channel or MULTICAST_GROUP
        given.setdefault("port", options.port or MULTICAST_PORT)
    elif options.port is not None:
        parser.error("argument --port: it is of udp_multicast and datagrams; others have --channel and --option")
    if not options.channel:
        parser.error(f"argument --channel: write the channel of {options.interface}, such as can0")
    return BusSettings(options.interface, options.channel, options.bitrate, options=tuple(given.items()))


def _value(text: str) -> str | int | float | bool:
    """Return a number, or true or false, or the text."""
    words = list(Bottle.parse(text))
    return words[0] if len(words) == 1 and isinstance(words[0], str | int | float | bool) else text


@contextmanager
def open_bus(parser: Parser, options: argparse.Namespace) -> Iterator[CanBus]:
    """Yield the bus, which is closed at the end."""
    from rtf.robot.devices.can.bus import CanBus

    bus = CanBus(settings_of(parser, options), report=report)
    try:
        yield bus
    finally:
        bus.close()


def address(text: str) -> int:
    """Read the address of a board."""
    number = count(text)
    if number not in ADDRESSES:
        raise argparse.ArgumentTypeError(f"{text} is no address of a board; these are 1 to 14")
    return number


def addresses(text: str) -> tuple[int, ...]:
    """Read addresses of boards, which are separated by commas."""
    return tuple(address(one.strip()) for one in text.split(","))
