"""``rtf run --terminal``: the standard streams of a program on another machine, in this terminal.

A node starts it in a window, see :mod:`rtf.applications.run.streams`. It ends with the program.
"""

from __future__ import annotations

import sys
import threading
from functools import partial
from typing import TYPE_CHECKING, Any

from rtf.bottle import Bottle
from rtf.cli.network.options import make_network, make_parser, own_name
from rtf.cli.network.terminal import Bell, opened
from rtf.middleware.errors import MiddlewareError, NameNotFoundError
from rtf.middleware.ports import remote
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.port import Port
from rtf.middleware.wire.contact import Contact
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.ports.buffered import Received
    from rtf.middleware.ports.inputs import Input


def terminal(words: Sequence[str]) -> ExitCode:
    """Show the output of a program and send it what is typed, until it ends."""
    parser = make_parser(
        "run --terminal",
        "Show the output of a program that was started with --stdio, and send it what is typed.",
        "rtf run --terminal /pc104/1234/arm-0",
    )
    parser.add_argument("--terminal", type=own_name, required=True, metavar="/NAME", help="what its ports begin with")
    name = parser.parse_args(words).terminal
    network, bell = make_network(), Bell()
    with (
        opened(partial(_Screen, f"{name}/stdio:i", bell, network=network, callback=_show)),
        opened(partial(Port, f"{name}/stdio:o", network=network)) as keys,
    ):
        source = network.names.query(f"{name}/stdout")
        if source is None:
            raise NameNotFoundError(f"there is no program with the port {name}/stdout; it may have ended")
        keys.add_output(f"{name}/stdin")
        remote.connect(network, source, Contact(f"{name}/stdio:i"))
        threading.Thread(target=_type, args=(keys,), name="rtf-keys", daemon=True).start()
        bell.wait()
    return ExitCode.PASSED


class _Screen(BufferedPort[Bottle]):
    """The port that shows lines; it rings when no more can come."""

    def __init__(self, name: str, bell: Bell, **more: Any) -> None:  # Any: the arguments of the base class
        self._bell = bell
        super().__init__(name, strict=True, outputs=False, **more)

    def input_closed(self, caller: Input) -> None:
        super().input_closed(caller)
        if caller.announced:
            self._bell.ring()


def _show(received: Received[Bottle]) -> None:
    message = received.value
    first = message.get(0)
    text = first if len(message) == 1 and isinstance(first, str) else f"{message.to_text()}\n"
    sys.stdout.write(text)
    sys.stdout.flush()


def _type(keys: Port) -> None:
    """Send lines until there are no more. Runs in a thread of its own."""
    try:
        for line in sys.stdin:
            keys.write(Bottle([line]))
    except MiddlewareError:
        return  # the program has ended, which the other thread notices
