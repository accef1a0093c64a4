"""What the tools' command lines share: a help text with examples, and words that are ports."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from rtf.cli.parser import Parser, make_parser, seconds
from rtf.middleware.errors import AddressError
from rtf.middleware.wire.contact import Contact

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network

__all__ = ["add_access", "add_carrier", "add_timeout", "contact", "make_network", "make_parser", "own_name"]


def add_carrier(parser: Parser) -> None:
    """Add the option of the carrier of a connection, for names without one."""
    parser.add_argument("--carrier", metavar="C", default="", help="how it is made: tcp (default), fast_tcp, udp …")


def add_access(parser: Parser) -> None:
    """Add the options of who may command the boards that are served, and who may change connections."""
    for option, what in (("--allow", "send commands to boards"), ("--allow-admin", "change connections")):
        parser.add_argument(
            option,
            action="append",
            default=[],
            metavar="PEER",
            help=f"who may {what}: an address such as 10.0.0.0/24"
            + ("" if "admin" in option else ", or a port's name such as '/tester/*'")
            + "; may be given more than once (default: everyone who can connect)",
        )


def add_timeout(parser: Parser, default: float | None, what: str) -> None:
    """Add the option of a timeout."""
    usual = f" (default {default:g})" if default is not None else ""
    parser.add_argument("--timeout", metavar="S", type=seconds, default=default, help=f"{what}{usual}")


def contact(text: str) -> Contact:
    """Read the name of an existing port: ``/name``, ``carrier://name`` or ``/host:port``."""
    try:
        found = Contact.parse(text)
    except AddressError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    if not found.valid and (found.name.endswith("/") or any(map(str.isspace, found.name))):
        raise argparse.ArgumentTypeError(f"{text!r} is no port: a name does not end with '/' and has no blanks in it")
    return found


def own_name(text: str) -> str:
    """Read the name of a port that is to be opened; ``...`` leaves it to the name server, which is the empty name."""
    if text == "...":
        return ""
    if contact(text) != Contact(text):
        raise argparse.ArgumentTypeError(f"{text!r} cannot be opened: write a name alone, such as /tester/in")
    return text


def make_network(patience: float | None = None) -> Network:
    """Return the network of the user's configuration. Changes of its connections are printed to stderr."""
    from rtf.cli.network.terminal import report
    from rtf.middleware.naming.configuration import find_network

    network = find_network()
    network.report = report
    if patience is not None:
        network.patience = patience
    return network
