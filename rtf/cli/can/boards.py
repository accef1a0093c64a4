"""``rtf can scan``, ``get`` and ``set``: the boards on a bus, and their parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from rtf.cli.can.options import address, bus_parser, open_bus
from rtf.cli.network.ports import Table, show
from rtf.cli.network.terminal import say
from rtf.cli.parser import seconds
from rtf.errors import did_you_mean
from rtf.robot.devices.can import motor_messages, sensor_messages
from rtf.robot.devices.can.codec import Decoded, dialect_of
from rtf.robot.devices.can.codes import BoardType
from rtf.robot.devices.can.exchange import PROTOCOL, Exchange
from rtf.robot.devices.can.listener import described
from rtf.robot.devices.can.messages import ADDRESSES, Dialect, MessageClass, Question, Setting
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rtf.cli.parser import Parser

#: Seconds for answers of a board that somebody waits for.
_PATIENCE = 0.2
#: What can be asked, and set, by the name of the answer.
_KNOWN: dict[str, Question | Setting] = {
    value.value.name: value
    for module in (motor_messages, sensor_messages)
    for value in vars(module).values()
    if isinstance(value, Question | Setting)
}

#: The values of questions that have usual ones.
_USUAL = {name: [str(one) for one in PROTOCOL] for name in ("version", "sensor_version")}
_SETTINGS: dict[str, Setting] = {name: one for name, one in _KNOWN.items() if isinstance(one, Setting)}
K = TypeVar("K")


def scan(words: Sequence[str]) -> int:
    """List the boards on a bus; 1 if there is none, or two have the same address."""
    parser = bus_parser(
        "scan",
        "The boards that answer on a bus. Boards of joints stop their motors and their messages then: not for a robot "
        "that moves.",
        "rtf can scan --interface socketcan --channel can0",
    )
    parser.add_argument("--seconds", type=seconds, default=0.2, help="how long to wait (default: %(default)s)")
    options = parser.parse_args(words)
    with open_bus(parser, options) as bus:
        found = Exchange(bus).discover(options.seconds)
        name = bus.name
    table = Table(("BOARD", "TYPE", "FIRMWARE"), numbers=("BOARD",))
    table.rows += [(str(one.board), one.type_name, one.firmware_text) for one in found]
    if found:
        show(table)
    twice = sorted({one.board for one in found if sum(other.board == one.board for other in found) > 1})
    if twice:
        say(f"two boards have the address {', '.join(map(str, twice))}: disconnect one, and give it another one")
    elif not found:
        say(f"no board on {name} answers within {options.seconds:g} s")
    return ExitCode.PASSED if found and not twice else ExitCode.FAILURES


def get(words: Sequence[str]) -> int:
    """Ask a board for a parameter."""
    parser = _parser("get", "Ask a board for a parameter, such as position_pid, version or control_mode.")
    options = parser.parse_args(words)
    known = _chosen(parser, options.name, _KNOWN)
    request = known.get.fields
    given = options.values or _USUAL.get(options.name, [])
    values = _numbers(parser, given, len(request), [one.name for one in request])
    with open_bus(parser, options) as bus:
        exchange = Exchange(bus, _PATIENCE)
        dialect = _dialect(exchange, options.board, known)
        got = exchange.ask(known, options.board, *values, axis=options.axis, dialect=dialect)
    say(described(Decoded(known.value, options.board, 0, options.axis, got)))
    return ExitCode.PASSED


def set_parameter(words: Sequence[str]) -> int:
    """Set a parameter of a board, and ask for it; 1 if the board has not taken it."""
    parser = _parser("set", "Set a parameter of a board, and read it back. It is lost when the board loses its power.")
    options = parser.parse_args(words)
    known = _chosen(parser, options.name, _SETTINGS)
    fields = known.set.fields
    values = _numbers(parser, options.values, len(fields), [one.name for one in fields])
    with open_bus(parser, options) as bus:
        exchange = Exchange(bus, _PATIENCE)
        dialect = _dialect(exchange, options.board, known)
        bus.send(known.set.frame(options.board, *values, axis=options.axis))
        moved = known is motor_messages.BOARD_ID and values[0] in ADDRESSES
        board = int(values[0]) if moved else options.board  # where it answers now
        got = exchange.ask(known, board, axis=options.axis, dialect=dialect)
    say(described(Decoded(known.value, board, 0, options.axis, got)))
    if tuple(got) == tuple(values):
        return ExitCode.PASSED
    say(f"board {options.board} has not taken it")
    return ExitCode.FAILURES


def _parser(word: str, description: str) -> Parser:
    values = " 100 1 10 4" if word == "set" else ""
    parser = bus_parser(word, description, f"rtf can {word} 3 position_pid{values} --axis 1")
    parser.add_argument("board", type=address, help="its address, 1 to 14")
    parser.add_argument("name", help="name of the parameter; 'rtf can messages' has them all")
    parser.add_argument("values", nargs="*", help="numbers, as the board has them")
    parser.add_argument("--axis", type=int, choices=(0, 1), default=0, help="of a board of joints (default: 0)")
    return parser


def _chosen(parser: Parser, name: str, known: Mapping[str, K]) -> K:
    """Return what can be asked or set by a name."""
    if name not in known:
        parser.error(f"argument name: there is no parameter {name!r}{did_you_mean(name, known)}")
    return known[name]


def _numbers(parser: Parser, given: Sequence[str], count: int, names: Sequence[str]) -> list[float]:
    """Read as many numbers as a message has fields."""
    try:
        numbers = [float(one) if "." in one or "e" in one.lower() else int(one, 0) for one in given]
    except ValueError as error:
        parser.error(f"argument values: {error}")
    if len(numbers) != count:
        parser.error(f"argument values: {count} are needed ({', '.join(names) or 'none'}), not {len(numbers)}")
    return numbers


def _dialect(exchange: Exchange, board: int, known: Question | Setting) -> Dialect:
    """Return the dialect of a board, which boards of motors are asked for."""
    if known.value.dialect is not Dialect.BOTH:
        return known.value.dialect
    if known.value.kind is not MessageClass.MOTOR_POLLING or known is motor_messages.VERSION:
        return Dialect.JOINT
    return dialect_of(BoardType(exchange.version(board).board_type))
