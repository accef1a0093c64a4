"""``rtf write``: open a port and send it the lines that are typed."""

from __future__ import annotations

import contextlib
from functools import partial
from typing import TYPE_CHECKING

from rtf import clock
from rtf.bottle import Bottle
from rtf.cli.network.options import add_carrier, contact, make_network, make_parser, own_name
from rtf.cli.network.terminal import complain, opened, progress, typed
from rtf.cli.parser import seconds
from rtf.middleware.port import Port
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Sequence

_LOOK_AGAIN = 0.01


def write(words: Sequence[str]) -> ExitCode:
    """Send each line as a message, until there are no more."""
    parser = make_parser(
        "write",
        'Open a port and send each line of the standard input as a message: words, numbers, "texts", (lists), [vocabs].'
        " A line waits until every reader has got it.",
        "echo '[set] [pos] 0 10.0' | rtf write /tester /robot/command:i",
    )
    parser.add_argument("port", type=own_name, metavar="/PORT", help="the port to open; ... for any name")
    parser.add_argument("targets", type=contact, nargs="*", metavar="/TARGET", help="ports to send to")
    add_carrier(parser)
    parser.add_argument(
        "--await-reader", metavar="S", type=seconds, help="send nothing before somebody reads; give up after S seconds"
    )
    options = parser.parse_args(words)
    network = make_network()
    make = partial(Port, options.port, network=network, inputs=False)
    with contextlib.suppress(KeyboardInterrupt), opened(make) as port:
        progress(f"Port {port.name} active at {port.contact}")
        for target in options.targets:
            found = port.add_output(target, target.carrier or options.carrier)
            progress(f"Added connection from {port.name} to {found.carrier}:/{target.name}")
        if options.await_reader is not None and not _somebody_reads(port, options.await_reader):
            complain(f"nobody reads {port.name} after {options.await_reader:g} s", f"rtf connect {port.name} /READER")
            return ExitCode.FAILURES
        for line in typed():
            port.write(Bottle.parse(line))
    return ExitCode.PASSED


def _somebody_reads(port: Port, patience: float) -> bool:
    deadline = clock.Deadline.after(patience)
    while not port.outputs and not deadline.expired:
        clock.sleep(_LOOK_AGAIN)
    return bool(port.outputs)
