"""``rtf name`` and ``rtf clean``: what the name server knows, and that it forgets what is not there any more."""

from __future__ import annotations

import socket
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import TYPE_CHECKING

from rtf.cli.network.options import add_timeout, make_network, make_parser
from rtf.cli.network.terminal import complain, say
from rtf.middleware.naming.configuration import namespaces
from rtf.middleware.naming.line_protocol import END, command, read_registration, registration
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.names import Contact

#: Entries that stand for no program.
_NO_PROGRAM = ("mcast", "topic")
_AT_A_TIME = 32


def name(words: Sequence[str]) -> ExitCode:
    """Give the name server a command and print what it answers."""
    parser = make_parser(
        "name",
        "Give the name server a command: list, query, register, unregister, set, get, check, route … help lists all.",
        "rtf name list /robot\nrtf name query /camera\nrtf name register /device tcp 10.0.0.7 5000",
    )
    parser.add_argument("command", nargs="+", metavar="WORD", help="the command and its words")
    options = parser.parse_args(words)
    verb, *rest = options.command
    answer = make_network().names.command(command(*options.command))
    if verb == "unregister":
        say("Unregistered name.")
    elif verb in ("query", "register"):
        found = next(filter(None, map(read_registration, answer)), None)
        if found is None:
            complain(f"{' '.join(rest)} not known.", "'rtf list' shows what is registered")
            return ExitCode.FAILURES
        say(f"{registration(found)}\n")
    else:
        say("\n".join(answer))
    return ExitCode.PASSED


def clean(words: Sequence[str]) -> ExitCode:
    """Unregister the ports that cannot be reached."""
    parser = make_parser(
        "clean",
        "Forget the names of ports that cannot be connected to: programs that crashed.",
        "rtf clean --timeout 1",
    )
    add_timeout(parser, 5.0, "how long a port may take to accept a connection")
    options = parser.parse_args(words)
    names = make_network().names
    say("Requesting list of ports from name server... ")
    ports = names.list()
    say(f"got {len(ports)} ports")
    say(f"Using a timeout of {options.timeout:g} seconds")
    spared = {*namespaces(), "fallback"}
    looked_at = [port for port in ports if port.name not in spared and port.carrier not in _NO_PROGRAM]
    with ThreadPoolExecutor(_AT_A_TIME) as pool:
        answers = iter(pool.map(partial(_accepts, patience=options.timeout), looked_at))
        for port in ports:
            if port not in looked_at:
                say(f"Ignoring {port.name}")
                continue
            say(f"Testing {port.name} at {port}")
            # Another program may have taken the name meanwhile, and that one is there.
            if not next(answers) and names.query(port.name) == port:
                say(f"* No response, removing port {port.name}")
                names.unregister(port.name)
    say("Giving name server a chance to do garbage collection.")
    answer = [line for line in names.command("gc") if line != END]
    say(f"Name server says: {' '.join(answer)}")
    return ExitCode.PASSED


def _accepts(port: Contact, patience: float) -> bool:
    """Whether somebody listens there. A program that is only stopped has its connections taken by the kernel."""
    try:
        socket.create_connection((port.host, port.port), patience).close()
    except OSError:
        return False
    return True
