"""``rtf where``, ``conf``, ``detect`` and ``namespace``: which name server is used, and where it is."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from rtf.cli.network.options import add_timeout, make_parser
from rtf.cli.network.terminal import complain, progress, say
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.names import Contact
from rtf.middleware.naming import configuration
from rtf.middleware.naming.authentication import find_key
from rtf.middleware.naming.client import RemoteNames
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.cli.parser import Parser

_LINE = "=" * 57
_MOST = 65535


def where(words: Sequence[str]) -> ExitCode:
    """Say where the name server is, and whether it answers."""
    parser = make_parser(
        "where",
        "Where the name server is. With a file instead: where that is looked for as a parameter file.",
        "rtf where\nrtf where left_arm.ini --robot icubSim",
    )
    parser.add_argument("file", nargs="?", metavar="FILE", help="a parameter file; see 'testrunner where --help'")
    parser.parse_args(words)
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
    parser.add_argument("port", nargs="?", metavar="PORT", type=_number, help="its number")
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
    """Where the name server should be; without a contact file the standard place of this machine."""
    place = configuration.read_place()
    if place is not None:
        return place.contact
    return Contact(configuration.namespaces()[0], "127.0.0.1", configuration.base_port(), "tcp")


def _answers(contact: Contact, patience: float) -> bool:
    try:
        return RemoteNames(contact, patience=patience, key=find_key()).query(contact.name) is not None
    except MiddlewareError:
        return False


def _number(text: str) -> int:
    if not text.isdecimal() or not 0 < int(text) <= _MOST:
        raise ValueError(text)
    return int(text)


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
