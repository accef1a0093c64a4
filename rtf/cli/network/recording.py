"""``rtf record`` and ``rtf play``: keep what ports send, and send it again."""

from __future__ import annotations

import argparse
import contextlib
import math
import threading
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rtf import clock
from rtf.cli.network.options import contact, make_network, make_parser, own_name
from rtf.cli.network.terminal import Bell, complain, opened, progress, report, say
from rtf.cli.parser import seconds
from rtf.middleware.ports import remote
from rtf.recording.files import FORMATS, create_store, format_of, open_recording
from rtf.recording.player import Player, check_free, choose
from rtf.recording.recorder import Recorder
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence


def record(words: Sequence[str]) -> ExitCode:
    """Record ports until a signal, or for a time."""
    parser = make_parser(
        "record",
        "Record what ports send, until Ctrl-C. In a folder as YARP's yarpdatadumper writes it: a folder a port, with"
        " data.log, info.log and images as files; or in a file .mcap, which opens in Foxglove. Both have the sender's"
        " stamps and the times of arrival, and can be played by 'rtf play'. A port that ends and comes back is recorded"
        " again.",
        "rtf record /icub/head/state:o /icub/cam/left\n"
        "rtf record /icub/head/state:o -o run.mcap --time 30\n"
        "rtf record /icub/cam/left -o run --carrier udp",
    )
    parser.add_argument("sources", type=contact, nargs="+", metavar="/PORT", help="the ports to record")
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="FOLDER",
        help="a folder that is new, or a file .mcap (default: by the time)",
    )
    parser.add_argument(
        "--format", choices=FORMATS, help="dumper or mcap (default: mcap if the output ends with .mcap)"
    )
    parser.add_argument(
        "--port", type=own_name, default="...", metavar="/PORT", help="the recorder's own port (default: any name)"
    )
    parser.add_argument("--time", type=seconds, metavar="S", help="end after a time, such as 30, 10min")
    parser.add_argument(
        "--carrier", metavar="C", default="fast_tcp", help="how: fast_tcp (default), by which no port waits, tcp, udp …"
    )
    options = parser.parse_args(words)
    kind = options.format or (format_of(options.output) if options.output else FORMATS[0])
    place = options.output or Path(f"recording-{clock.local_stamp(clock.now())}{'.mcap' if kind == 'mcap' else ''}")
    network = make_network()
    for source in options.sources:
        if not remote.exists(network, source):  # before anything is written
            complain(f"There is no port {source.name}.", "'rtf list' shows what is registered")
            return ExitCode.FAILURES
    bell = Bell()
    with create_store(place, kind) as store:
        with opened(partial(Recorder, store, name=options.port, network=network, failed=bell.ring)) as recorder:
            for source in options.sources:
                recorder.connect(source, options.carrier)
            say(f"recording {len(options.sources)} ports into {place}")
            with contextlib.suppress(KeyboardInterrupt), _ringing(bell, options.time):
                bell.wait()
        if recorder.failure is not None:
            raise recorder.failure
    return _summary(recorder, [source.name for source in options.sources])


@contextlib.contextmanager
def _ringing(bell: Bell, after: float | None) -> Iterator[None]:
    """Ring a bell after a time, if the block still runs."""
    timer = threading.Timer(after or 0.0, bell.ring)
    if after is not None:
        timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _summary(recorder: Recorder, sources: Sequence[str]) -> ExitCode:
    skipped = recorder.skipped
    for source in sources:
        lost = "".join(
            f", {counts[source]} {what}"
            for counts, what in (
                (recorder.dropped, "dropped"),
                (recorder.refused, "not recorded"),
                (skipped, "skipped by its sender"),
            )
            if counts[source]
        )
        say(f"{recorder.written[source]:8} messages of {source}{lost}")
    if recorder.dropped:
        complain("Messages were dropped: they came faster than they can be written.", "record fewer ports, or as MCAP")
    return ExitCode.FAILURES if recorder.dropped or recorder.refused else ExitCode.PASSED


def play(words: Sequence[str]) -> ExitCode:
    """Send what was recorded."""
    parser = make_parser(
        "play",
        "Send what was recorded, at its times and with its stamps, from ports of the same names. It reads what 'rtf"
        " record' and YARP's yarpdatadumper write. Every reader gets every message.",
        "rtf play recording-20261127-101500 --await-reader 30\n"
        "rtf play run.mcap --rate 0.5 --loop --only /icub/head/state:o\n"
        "rtf play run.mcap --prefix /replay --only '/icub/cam/*'",
    )
    parser.add_argument(
        "recording", type=Path, metavar="FOLDER|FILE", help="a folder with info.log in or below it, or a .mcap"
    )
    parser.add_argument("--rate", type=_rate, default=1.0, metavar="X", help="how many times as fast (default 1)")
    parser.add_argument("--loop", action="store_true", help="begin again at the end, until Ctrl-C")
    parser.add_argument(
        "--only",
        action="append",
        default=[],
        metavar="NAME",
        help="a port, a folder of the recording, or a pattern; may be given more than once (default: all)",
    )
    parser.add_argument("--prefix", default="", metavar="/NAME", help="what to put before the names of the ports")
    parser.add_argument(
        "--await-reader", metavar="S", type=seconds, help="begin when a port reads from each; give up after S seconds"
    )
    options = parser.parse_args(words)
    recording = open_recording(options.recording)
    prefix = own_name(options.prefix) if options.prefix else ""
    network = make_network()
    check_free(network, [f"{prefix}{source}" for source in choose(recording, options.only)])
    make = partial(Player, recording, only=options.only, prefix=prefix, network=network)
    try:
        with contextlib.suppress(KeyboardInterrupt), opened(make) as player:
            for port in player.ports:
                progress(f"Port {port.name} active at {port.contact}")
            return _play(player, options)
    finally:
        for note in recording.notes:
            report(note)
    return ExitCode.PASSED


def _play(player: Player, options: argparse.Namespace) -> ExitCode:
    if options.await_reader is not None and (unread := player.await_readers(options.await_reader)):
        complain(f"{unread[0]} has no reader after {options.await_reader:g} s", f"rtf connect {unread[0]} /READER")
        return ExitCode.FAILURES
    say(f"playing {len(player.ports)} ports")
    player.play(options.rate)
    while options.loop:
        player.play(options.rate)
    say(f"{player.sent} messages were sent, at most {player.latest:.3f} s late")
    return ExitCode.PASSED


def _rate(text: str) -> float:
    try:
        rate = float(text)
    except ValueError:
        rate = 0.0
    if not 0 < rate < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is no rate; write a number above 0, such as 0.5")
    return rate
