"""``rtf exists``, ``wait``, ``ping`` and ``terminate``: whether ports and connections exist."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf import clock
from rtf.cli.network.options import add_timeout, contact, make_network, make_parser
from rtf.cli.network.terminal import complain, progress, say
from rtf.cli.parser import count
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.ports import remote
from rtf.middleware.wire.contact import Contact
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.cli.parser import Parser
    from rtf.middleware.ports.network import Network

#: Seconds between two checks while waiting: at first, and at most.
_LOOK_AGAIN, _LOOK_AT_MOST = 0.02, 0.5


def exists(words: Sequence[str]) -> ExitCode:
    """Exit with 0 when a port answers, or two are connected."""
    parser = make_parser(
        "exists",
        "Whether a port answers, or one sends to another. The exit code says so: 0 yes, 1 no.",
        "rtf exists /camera && echo it is there\nrtf exists /camera fast_tcp://viewer",
    )
    _add_ports(parser)
    add_timeout(parser, 5.0, "how long the port may take to answer")
    options = parser.parse_args(words)
    network = make_network(options.timeout)
    if options.target is None:
        return ExitCode.PASSED if remote.exists(network, options.port) else ExitCode.FAILURES
    carrier = _carrier_between(network, options.port, options.target)
    if not carrier:
        complain(f"No connection from {options.port.name} to {options.target.name} found.")
        return ExitCode.FAILURES
    say(f"Connection found from {options.port.name} to {options.target.name} using carrier {carrier}")
    return ExitCode.PASSED if carrier == (_wanted(options.port, options.target) or carrier) else ExitCode.FAILURES


def wait(words: Sequence[str]) -> ExitCode:
    """Exit with 0 as soon as a port answers, or two are connected."""
    parser = make_parser(
        "wait",
        "Wait until a port answers, or one sends to another. Exits with 0 then, with 1 when that takes too long.",
        "rtf wait /camera --timeout 20 && rtf connect /camera /viewer",
    )
    _add_ports(parser)
    add_timeout(parser, None, "how long to wait; without it as long as it takes")
    options = parser.parse_args(words)
    deadline = clock.Deadline.after(options.timeout)
    what = options.port.name if options.target is None else f"{options.port.name} to send to {options.target.name}"
    progress(f"Waiting for {what}")
    pause = _LOOK_AGAIN
    # The network is looked for each time: its name server may not be there yet, nor what says where it is.
    while not _is_there(make_network(), options.port, options.target):
        if deadline.expired:
            complain(f"waited {options.timeout:g} s for {what}", "'rtf list' shows what there is")
            return ExitCode.FAILURES
        clock.sleep(min(pause, deadline.remaining()))
        pause = min(1.5 * pause, _LOOK_AT_MOST)
    return ExitCode.PASSED


def ping(words: Sequence[str]) -> ExitCode:
    """Print a port's description of itself, and how long it takes to answer."""
    parser = make_parser(
        "ping", "What a port is connected to, and how fast it answers.", "rtf ping /camera --count 100"
    )
    parser.add_argument("port", type=contact, metavar="/PORT", help="the port")
    parser.add_argument("--count", metavar="N", type=count, default=5, help="measure N answers (default 5, 0: none)")
    add_timeout(parser, 5.0, "how long the port may take to answer")
    options = parser.parse_args(words)
    network = make_network(options.timeout)
    if network.resolve(options.port) is None:
        complain(f"{options.port.name} not known.", "'rtf list' shows what is registered")
        return ExitCode.FAILURES
    try:
        with remote.talk(network, options.port, "<ping>") as ask:
            lines = ask("*")
            times = []
            for _ in range(options.count):
                before = clock.monotonic()
                ask("a", "[ver]")
                times.append(1e3 * (clock.monotonic() - before))
    except MiddlewareError as error:
        complain(f"{options.port.name} is not responding.", f"{error}; 'rtf clean' forgets ports that are gone")
        return ExitCode.FAILURES
    say("\n".join(lines))
    if times:
        from statistics import median as middle

        median = middle(times)
        say(f"Round trip of {len(times)}: min {min(times):.3f} ms, median {median:.3f} ms, max {max(times):.3f} ms")
    return ExitCode.PASSED


def _add_ports(parser: Parser) -> None:
    parser.add_argument("port", type=contact, metavar="/PORT", help="the port; with a second one, that which sends")
    parser.add_argument("target", type=contact, metavar="/TARGET", nargs="?", help="the port it sends to")


def _is_there(network: Network, port: Contact, target: Contact | None) -> bool:
    if target is None:
        return remote.exists(network, port)
    carrier = _carrier_between(network, port, target)
    return bool(carrier) and carrier == (_wanted(port, target) or carrier)


def _wanted(port: Contact, target: Contact) -> str:
    return target.carrier or port.carrier


def _carrier_between(network: Network, port: Contact, target: Contact) -> str:
    """Return the carrier of a connection; empty when there is none, or the port does not answer."""
    from rtf.bottle import as_string

    try:
        found = remote.connection(network, port, target)
    except MiddlewareError:
        return ""
    return "" if found is None else as_string(found.find("carrier"))


_QUIT = "/quit"


def terminate(words: Sequence[str]) -> ExitCode:
    """Ask a program to end, by the port that programs have for it, and check that the port disappears."""
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
    port = options.port
    if _QUIT not in port.name and network.resolve(Contact(port.name + _QUIT)) is not None:
        port = Contact(port.name + _QUIT)
    if network.resolve(port) is None:
        complain(f"{port.name} not known.", "'rtf list' shows what is registered")
        return ExitCode.FAILURES
    try:
        with remote.talk(network, port) as ask:
            ask(*(("d", "quit") if _QUIT in port.name else ("i",)))
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
