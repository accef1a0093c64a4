"""``rtf logger`` and ``rtf log``: collect the logs of a network's programs, and show what was collected."""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rtf import clock
from rtf.cli.network.options import make_network, make_parser
from rtf.cli.network.terminal import Bell, complain, opened, progress, say
from rtf.cli.parser import add_place_options, argument, count
from rtf.logs.collector import Collector
from rtf.logs.query import Query, read_level, read_moment
from rtf.logs.record import COLLECTOR, Level
from rtf.logs.store import MAX_SIZE, LogReader, LogStore, default_place
from rtf.middleware.ports import remote
from rtf.middleware.wire.contact import Contact
from rtf.testing.report.text import shown, wants_colour
from rtf.testing.reporting import ReportError
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from rtf.logs.store import Stored

#: Seconds between two looks for new records.
_LOOK = 0.1
#: Earlier records that ``--follow`` shows.
_TAIL = 10
_UNITS = {"K": 1 << 10, "M": 1 << 20, "G": 1 << 30}
_RED, _YELLOW, _GREEN, _CYAN, _GREY = "31", "33", "32", "36", "90"
_COLOURS = {
    Level.FATAL: f"1;{_RED}",
    Level.ERROR: _RED,
    Level.WARNING: _YELLOW,
    Level.INFO: _GREEN,
    Level.DEBUG: _CYAN,
    Level.TRACE: _GREY,
    Level.UNKNOWN: _GREY,
}


def logger(words: Sequence[str]) -> ExitCode:
    """Collect logs until a signal."""
    parser = make_parser(
        "logger",
        f"Open {COLLECTOR} and store what programs log, until Ctrl-C. A program of YARP forwards its log when"
        " YARP_FORWARD_LOG_ENABLE=1 is in its environment; 'rtf log' shows what was stored.",
        "rtf logger\nrtf logger --file lab.sqlite --max-size 1G\nrtf logger --page",
    )
    _add_file(parser, "where to store it")
    parser.add_argument(
        "--max-size",
        type=_size,
        default=MAX_SIZE,
        metavar="N",
        help="size of the file, such as 64M or 1G; then the oldest records are removed (default 256M)",
    )
    _add_page(parser)
    options = parser.parse_args(words)
    network = make_network()
    if remote.exists(network, Contact(COLLECTOR)):
        complain(f"There is a logger already: {COLLECTOR} answers.", "end it first, or use its log")
        return ExitCode.FAILURES
    bell = Bell()
    with LogStore(options.file, max_size=options.max_size) as store:
        with opened(partial(Collector, store, network=network, failed=bell.ring)) as collector:
            collector.connect_running()
            say(f"{COLLECTOR} is open; records go to {options.file}")
            with _served(options), contextlib.suppress(KeyboardInterrupt):
                bell.wait()
        progress(f"{collector.written} records were written, {collector.dropped} dropped")
        if collector.failure is not None:
            raise collector.failure
    return ExitCode.PASSED


def log(words: Sequence[str]) -> ExitCode:
    """Print records that were stored, and those that come."""
    parser = make_parser(
        "log",
        "Print what 'rtf logger' has stored, a record a line, or as JSON.",
        "rtf log --level warning --since 10min\nrtf log --follow --process yarprobotinterface --component yarp.yri\n"
        "rtf log --page",
    )
    _add_file(parser, "which log")
    parser.add_argument("-f", "--follow", action="store_true", help="go on with the records that come, until Ctrl-C")
    parser.add_argument(
        "--level", type=argument(read_level), default=Level.UNKNOWN, help="trace, debug, info, warning, error, fatal"
    )
    parser.add_argument("--process", default="", metavar="P", help="a program's name, process number or log port")
    parser.add_argument("--host", default="", metavar="H", help="the computer, or the server of yarprun")
    parser.add_argument("--component", default="", metavar="C", help="a component, with those below it")
    parser.add_argument("--text", default="", metavar="T", help="a part of the message")
    parser.add_argument(
        "--since", type=argument(read_moment), metavar="T", help="10min, 2h, or a time such as 2026-11-25T14:00"
    )
    parser.add_argument("--last", type=count, metavar="N", help=f"only the newest (with --follow: {_TAIL})")
    parser.add_argument("--json", action="store_true", help="a JSON object a line")
    parser.add_argument(
        "--color", "--colour", choices=("auto", "always", "never"), default="auto", help="colours (default: a terminal)"
    )
    _add_page(parser)
    options = parser.parse_args(words)
    if options.page:
        with _served(options), contextlib.suppress(KeyboardInterrupt):
            Bell().wait()
        return ExitCode.PASSED
    _print(options)
    return ExitCode.PASSED


def _print(options: argparse.Namespace) -> None:
    query = Query(
        level=options.level,
        process=options.process,
        host=options.host,
        component=options.component,
        text=options.text,
        since=options.since,
    )
    coloured = wants_colour(sys.stdout, {"auto": None, "always": True, "never": False}[options.color])
    write = _as_json if options.json else partial(_as_line, coloured=coloured)
    last = _TAIL if options.follow and options.last is None else options.last
    with LogReader(options.file) as reader, contextlib.suppress(KeyboardInterrupt):
        newest = reader.newest()
        for stored in reader.read(query, last=last):
            newest = max(newest, stored[0])
            print(write(stored))
        while options.follow:
            sys.stdout.flush()
            clock.sleep(_LOOK)
            for stored in reader.read(query, after=newest):
                newest = stored[0]
                print(write(stored))


@contextlib.contextmanager
def _served(options: argparse.Namespace) -> Iterator[None]:
    """Serve the page of the log while the block runs, if ``--page`` asks for it."""
    if not options.page:
        yield
        return
    try:
        from rtf.page.log_page import serve_log
    except ImportError as error:
        raise ReportError(f"the web page needs {error.name}: pip install {error.name}") from None
    with serve_log(options.file, options.web_host, options.web_port) as address:
        say(f"web page: {address}  (Ctrl-C ends it)")
        yield


def _as_line(stored: Stored, *, coloured: bool) -> str:
    _, _, record = stored
    text = shown(record.to_console().rstrip("\n"))
    if record.backtrace:
        text = f"{text}\n{shown(record.backtrace)}"
    if coloured:
        word = f"[{record.level.name}]"
        text = f"\x1b[{_COLOURS[record.level]}m{word}\x1b[0m{text.removeprefix(word)}"
    return f"{_moment(record.time)} {shown(record.sender.removeprefix('/log/'))} {text}"


def _as_json(stored: Stored) -> str:
    number, arrived, record = stored
    named = {**record._asdict(), "level": record.level.name, "details": record.groups()}
    return json.dumps({"number": number, "arrived": arrived, **named})


def _moment(seconds_since_1970: float) -> str:
    """A time of this place; a number that is no time as it is."""
    try:
        there = datetime.fromtimestamp(seconds_since_1970, tz=UTC).astimezone()
    except (OverflowError, ValueError, OSError):
        return f"{seconds_since_1970:.6g}"
    return there.strftime("%Y-%m-%d %H:%M:%S.") + f"{there.microsecond // 1000:03d}"


def _add_page(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--page", action="store_true", help="serve it as a page in a browser, with these filters")
    add_place_options(parser)


def _add_file(parser: argparse.ArgumentParser, what: str) -> None:
    place = default_place()
    parser.add_argument("--file", type=Path, default=place, metavar="FILE", help=f"{what} (default {place})")


def _size(text: str) -> int:
    factor = _UNITS.get(text[-1:].upper(), 1)
    try:
        size = float(text[:-1] if factor > 1 else text) * factor
        return int(size)
    except (ValueError, OverflowError):
        raise argparse.ArgumentTypeError(f"{text!r} is no size; write bytes, or 64M, 1G") from None
