"""``rtf terminate``: ask the program of a port to end."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf import clock
from rtf.cli.network.options import add_timeout, contact, make_network, make_parser
from rtf.cli.network.terminal import complain, progress, say
from rtf.middleware import remote
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.names import Contact
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Sequence

_QUIT = "/quit"
_LOOK_AGAIN = 0.05


def terminate(words: Sequence[str]) -> ExitCode:
    """Ask by the port that programs have for it, and see whether the port goes."""
    parser = make_parser(
        "terminate",
        "Ask the program of a port to end: by its port .../quit where there is one, which nearly all programs obey,"
        " else by a command to the port that only programs built for debugging obey.",
        "rtf terminate /camera/quit",
    )
    parser.add_argument("port", type=contact, metavar="/PORT", help="the port")
    add_timeout(parser, 5.0, "how long the program may take to end")
    options = parser.parse_args(words)
    network = make_network()
    port: Contact = options.port
    if _QUIT not in port.name and network.resolve(Contact(port.name + _QUIT)) is not None:
        port = Contact(port.name + _QUIT)
    if network.resolve(port) is None:
        complain(f"{port.name} not known.", "'rtf list' shows what is registered")
        return ExitCode.FAILURES
    try:
        with remote.talk(network, port) as link:
            link.send_lines(*(("d", "quit") if _QUIT in port.name else ("i",)))
            link.receive_lines()
    except MiddlewareError as error:
        progress(f"{port.name}: {error}")  # it may end before it answers
    deadline = clock.Deadline.after(options.timeout)
    while remote.exists(network, port):
        if deadline.expired:
            complain(f"{port.name} is still there after {options.timeout:g} s", "end its program where it was started")
            return ExitCode.FAILURES
        clock.sleep(_LOOK_AGAIN)
    say(f"{port.name} is gone")
    return ExitCode.PASSED
