"""``rtf nameserver``: the name server as a program. It takes the options of yarpserver that make sense here."""

from __future__ import annotations

import contextlib
import signal
import sys
from argparse import ArgumentTypeError
from typing import TYPE_CHECKING

from rtf.cli.parser import Parser
from rtf.errors import RtfError
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from argparse import Namespace
    from collections.abc import Sequence

_MEMORY = ":memory:"
_HIGHEST = 65535
_SIGNALS = (signal.SIGINT, signal.SIGTERM)


def nameserver(words: Sequence[str]) -> ExitCode:
    """Keep names until a signal says to stop."""
    options = _parser().parse_args(words)
    # Signals are waited for, in no handler that could meet a lock; the server's threads inherit that they pass by them.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _SIGNALS)
    try:
        return _serve(options)
    except RtfError as error:
        print(f"rtf nameserver: {error}", file=sys.stderr)
        return ExitCode.FAILURES
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _parser() -> Parser:
    parser = Parser(
        prog="rtf nameserver",
        description="Keep the names of a network's ports. Other machines reach it only with --ip.",
    )
    parser.add_argument("--ip", metavar="ADDRESS", help="the address of this machine to serve (default: 127.0.0.1)")
    parser.add_argument(
        "--socket", metavar="PORT", type=_number, help="the number to serve at (default: 10000, 0: any)"
    )
    parser.add_argument("--namespace", metavar="NAME", help="its name (default: the configured namespace, or /root)")
    parser.add_argument("--read", action="store_true", help="take address and number from the contact file")
    parser.add_argument("--write", action="store_true", help="store address and number in the contact file")
    parser.add_argument("--portdb", metavar="FILE", default="", help="keep the names in a file for the next start")
    parser.add_argument("--no-discovery", action="store_true", help="do not answer multicast questions for it")
    parser.add_argument("--silent", action="store_true", help="do not say what it does")
    return parser


def _number(text: str) -> int:
    if not text.isdecimal() or int(text) > _HIGHEST:
        raise ArgumentTypeError(f"{text!r} is no number of a port")
    return int(text)


def _serve(options: Namespace) -> ExitCode:
    from rtf.middleware.naming import configuration
    from rtf.middleware.naming.authentication import find_key
    from rtf.middleware.naming.server import NameServer

    namespace = options.namespace or configuration.namespaces()[0]
    place = configuration.read_place(namespace) if options.read else None
    host = options.ip or (place.contact.host if place else "127.0.0.1")
    number = configuration.base_port() if options.socket is None else options.socket
    if place is not None and options.socket is None:
        number = place.contact.port
    with NameServer(
        host,
        number,
        namespace=namespace,
        portdb="" if options.portdb == _MEMORY else options.portdb,
        discovery=number if number == configuration.base_port() and not options.no_discovery else 0,
        key=find_key(),
        report=None if options.silent else _say,
    ) as server:
        if options.write:
            _say(f"Stored in {configuration.write_place(server.contact)}")
        _say(f"Name server {namespace} is available at ip {host} port {server.contact.port}")
        signal.sigwait(_SIGNALS)
    return ExitCode.PASSED


def _say(sentence: str) -> None:
    with contextlib.suppress(BrokenPipeError):  # whoever listened has gone; the names are still needed
        print(sentence, flush=True)
