"""The name server: as a program, its address, the choice of the server, and its contents."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import sys
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import TYPE_CHECKING

from rtf.cli.network.options import add_timeout, make_network, make_parser
from rtf.cli.network.terminal import complain, progress, say
from rtf.cli.parser import Parser, port
from rtf.errors import RtfError
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.naming import configuration
from rtf.middleware.naming.client import RemoteNames
from rtf.middleware.naming.configuration import find_key, namespaces
from rtf.middleware.wire.contact import Contact
from rtf.middleware.wire.name_server_lines import END, command, read_registration, registration
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from argparse import Namespace
    from collections.abc import Sequence


_MEMORY = ":memory:"
_SIGNALS = (signal.SIGINT, signal.SIGTERM)


def nameserver(words: Sequence[str]) -> ExitCode:
    """Run a name server until a signal ends it."""
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
    parser.add_argument("--socket", metavar="PORT", type=port, help="the number to serve at (default: 10000, 0: any)")
    parser.add_argument("--namespace", metavar="NAME", help="its name (default: the configured namespace, or /root)")
    parser.add_argument("--read", action="store_true", help="take address and number from the contact file")
    parser.add_argument("--write", action="store_true", help="store address and number in the contact file")
    parser.add_argument("--portdb", metavar="FILE", default="", help="keep the names in a file for the next start")
    parser.add_argument("--no-discovery", action="store_true", help="do not answer multicast questions for it")
    parser.add_argument("--silent", action="store_true", help="do not say what it does")
    return parser


def _serve(options: Namespace) -> ExitCode:
    from rtf.middleware.naming import configuration
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
    with contextlib.suppress(BrokenPipeError):  # the reader of the output is gone; the names are still needed
        print(sentence, flush=True)


_LINE = "=" * 57


def where(_words: Sequence[str]) -> ExitCode:
    """Print where the name server is, and whether it answers."""
    contact = _configured()
    progress(f"Looking for name server on {contact.host}, port number {contact.port}\n{_DELAY}")
    if not _answers(contact, 5.0):
        complain(f"Name server {contact.name} is not available at ip {contact.host} port {contact.port}", _HINT)
        return ExitCode.FAILURES
    say(f"Name server {contact.name} is available at ip {contact.host} port {contact.port}")
    return ExitCode.PASSED


def conf(words: Sequence[str]) -> ExitCode:
    """Show, write or remove the contact file."""
    parser = make_parser(
        "conf",
        "The file that says where the name server is: its path; with HOST and PORT it is written.",
        "rtf conf 10.0.0.7 10000\nrtf conf --clean",
    )
    parser.add_argument("host", nargs="?", metavar="HOST", help="the address of the name server")
    parser.add_argument("port", nargs="?", metavar="PORT", type=port, help="its number")
    parser.add_argument("--clean", action="store_true", help="remove the file")
    options = parser.parse_args(words)
    if options.clean:
        say(f"Cleared out configuration file: {configuration.remove_place()}")
    elif options.host is not None:
        _store(parser, Contact(configuration.namespaces()[0], options.host, options.port or 0))
    else:
        say(str(configuration.contact_file()))
    return ExitCode.PASSED


def detect(words: Sequence[str]) -> ExitCode:
    """Look for a name server: where it is configured, then by multicast."""
    from rtf.middleware.naming import discovery

    parser = make_parser(
        "detect",
        "Look for the name server: at the configured place, then by a question to the whole local network.",
        "rtf detect --write",
    )
    parser.add_argument("--write", action="store_true", help="store where it is")
    add_timeout(parser, 3.0, "how long to look")
    options = parser.parse_args(words)
    place = configuration.read_place()
    found = None
    if place is not None:
        progress(f"Checking for name server at ip {place.contact.host} port {place.contact.port}\n{_DELAY}")
        found = place.contact if _answers(place.contact, options.timeout) else None
    if found is None:
        namespace = configuration.namespaces()[0]
        progress(f"Looking for name server {namespace} by multicast")
        found = discovery.detect(namespace, timeout=options.timeout)
    if found is None:
        say(_banner("NOT FOUND"))
        complain("no name server answers", _HINT)
        return ExitCode.FAILURES
    say(_banner("FOUND", f"{found.name} is available at ip {found.host} port {found.port}"))
    if options.write:
        say(f"Stored in {configuration.write_place(found)}")
    return ExitCode.PASSED


def namespace(words: Sequence[str]) -> ExitCode:
    """Show or store the name of the name server."""
    parser = make_parser(
        "namespace", "The name of the name server that is used; with a name that is stored.", "rtf namespace /lab2"
    )
    parser.add_argument("name", nargs="?", metavar="/NAME", help="use this one from now on")
    options = parser.parse_args(words)
    if options.name is not None:
        if not options.name.startswith("/") or any(map(str.isspace, options.name)):
            parser.error(f"{options.name!r} is no name of a name server: it begins with '/' and has no blanks in it")
        _store_namespace(options.name)
    for name in configuration.namespaces():
        say(f"YARP namespace: {name}")
    return ExitCode.PASSED


_DELAY = "If there is a long delay, try:\n  rtf conf --clean"
_HINT = "start one with 'rtf nameserver --write', or say where it is with 'rtf conf HOST PORT'"


def _configured() -> Contact:
    """Return the contact of the configured name server; without a contact file this machine's default."""
    place = configuration.read_place()
    if place is not None:
        return place.contact
    return Contact(configuration.namespaces()[0], "127.0.0.1", configuration.base_port(), "tcp")


def _answers(contact: Contact, patience: float) -> bool:
    try:
        return RemoteNames(contact, patience=patience, key=find_key()).query(contact.name) is not None
    except MiddlewareError:
        return False


def _store(parser: Parser, contact: Contact) -> None:
    if not contact.port:
        parser.error("a port is needed beside the host, such as 10000")
    say(f"Configuration stored in: {configuration.write_place(contact)}")


def _store_namespace(name: str) -> None:
    file = configuration.config_home() / (os.environ.get("YARP_CONFIG_NAMESPACE_FILENAME") or "yarp_namespace.conf")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f"{name}\n", encoding="utf-8")
    except OSError as error:
        raise MiddlewareError(f"{file} cannot be written: {error.strerror or error}") from None


def _banner(*lines: str) -> str:
    return "\n".join(["", _LINE, "==", *(f"== {line}" for line in lines), "== ", _LINE])


#: Entries that stand for no program.
_NO_PROGRAM = ("mcast", "topic")
_AT_A_TIME = 32


def name(words: Sequence[str]) -> ExitCode:
    """Send a command to the name server and print the answer."""
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
            # Another program may have taken the name meanwhile, and that program is alive.
            if not next(answers) and names.query(port.name) == port:
                say(f"* No response, removing port {port.name}")
                names.unregister(port.name)
    say("Giving name server a chance to do garbage collection.")
    answer = [line for line in names.command("gc") if line != END]
    say(f"Name server says: {' '.join(answer)}")
    return ExitCode.PASSED


def _accepts(port: Contact, patience: float) -> bool:
    """Return whether a program listens there. For one that is stopped, the kernel accepts the connections."""
    try:
        socket.create_connection((port.host, port.port), patience).close()
    except OSError:
        return False
    return True
