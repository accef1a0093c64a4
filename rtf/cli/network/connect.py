"""``rtf connect`` and ``rtf disconnect``: connect ports, now or whenever both exist."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import Bottle, as_int, as_string
from rtf.cli.network.options import contact, make_network, make_parser
from rtf.cli.network.terminal import complain, say
from rtf.middleware.errors import ConnectError, MiddlewareError
from rtf.middleware.ports import remote
from rtf.middleware.wire.contact import Contact
from rtf.middleware.wire.name_server_lines import command
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from argparse import Namespace
    from collections.abc import Sequence

    from rtf.cli.parser import Parser
    from rtf.middleware.ports.network import Network

#: Carriers by which the receiver calls the sender.
_PULL = ("mjpeg",)


def connect(words: Sequence[str]) -> ExitCode:
    """Connect two ports, or subscribe them so that they are connected whenever both exist."""
    parser = make_parser(
        "connect",
        "Have one port send to another. The carrier may also stand before a name: fast_tcp://viewer.",
        "rtf connect /camera /viewer fast_tcp\n"
        "rtf connect --persist /camera /viewer    # again whenever both are there\n"
        "rtf connect --list-subs                  # what is to be connected",
    )
    _add_ports(parser)
    parser.add_argument("style", nargs="?", metavar="CARRIER", default="", help="tcp (default), fast_tcp, udp, mcast …")
    parser.add_argument("--carrier", metavar="C", default="", help="the same")
    group = parser.add_mutually_exclusive_group()
    group.add_argument("--persist", action="store_true", help="connect them whenever both are there")
    group.add_argument("--persist-from", action="store_true", help="likewise, until the sender is gone")
    group.add_argument("--persist-to", action="store_true", help="likewise, until the receiver is gone")
    group.add_argument("--list-subs", action="store_true", help="list what is connected whenever it is there")
    options = parser.parse_args(words)
    network = make_network()
    if options.list_subs:
        return _list_subscriptions(network)
    source, target = _both(parser, options)
    carrier = options.style or options.carrier
    if options.persist or options.persist_from or options.persist_to:
        return _subscribe(network, source, target.by(target.carrier or carrier), options)
    place = _find(network, source, "source")
    aim = _find(network, target, "destination")
    if place is None or aim is None:
        return ExitCode.FAILURES
    carrier = target.carrier or source.carrier or carrier or aim.carrier
    try:
        if carrier.partition("+")[0] in _PULL:
            text = remote.connect(network, target.by(""), source.by(""), carrier)
        else:
            text = remote.connect(network, source.by(""), target.by(""), carrier)
    except ConnectError as error:
        complain(
            f"Failure: {error}", f"'rtf ping {source.name}' says whether the port lives and what it is connected to"
        )
        return ExitCode.FAILURES
    say(f"Success: {text}")
    return ExitCode.PASSED


def disconnect(words: Sequence[str]) -> ExitCode:
    """End a connection, or the subscription that would make it again."""
    parser = make_parser("disconnect", "Have one port send to another no more.", "rtf disconnect /camera /viewer")
    _add_ports(parser)
    parser.add_argument("--persist", action="store_true", help="end what 'connect --persist' began, too")
    options = parser.parse_args(words)
    source, target = _both(parser, options)
    network = make_network()
    persistent = options.persist and (source.name, target.name) in _subscriptions(network)
    if options.persist:
        network.names.command(command("unsubscribe", source.name, target.name))
    if persistent and not _connected(network, source, target):
        say(f"Success: {source.name} is no longer connected to {target.name} when both are there")
        return ExitCode.PASSED
    if _find(network, source, "source") is None:
        return ExitCode.FAILURES
    try:
        if remote.connection(network, source, target) is None:
            complain("Failure: no such connection", f"'rtf ping {source.name}' shows those there are")
            return ExitCode.FAILURES
        say(f"Success: {remote.disconnect(network, source, target)}")
    except MiddlewareError as error:
        complain(f"Failure: {error}", "'rtf clean' forgets ports that are gone")
        return ExitCode.FAILURES
    return ExitCode.PASSED


def _add_ports(parser: Parser) -> None:
    parser.add_argument("source", type=contact, nargs="?", metavar="/SOURCE", help="the port that sends")
    parser.add_argument("target", type=contact, nargs="?", metavar="/TARGET", help="the port that receives")


def _both(parser: Parser, options: Namespace) -> tuple[Contact, Contact]:
    if options.source is None or options.target is None:
        parser.error("two ports are needed: /SOURCE /TARGET")
    return options.source, options.target


def _find(network: Network, port: Contact, role: str) -> Contact | None:
    found = network.resolve(port)
    if found is None:
        complain(f"Failure: could not find {role} port {port.name}", "'rtf list' shows what is registered")
    return found


def _subscribe(network: Network, source: Contact, target: Contact, options: Namespace) -> ExitCode:
    mode = ["from"] if options.persist_from else ["to"] if options.persist_to else []
    answer = network.names.command(command("subscribe", str(source), str(target), *mode))
    if not answer or answer[0] != "[ok]":
        complain(f"Failure: the name server keeps no connection from {source.name} to {target.name}: {answer}")
        return ExitCode.FAILURES
    say(f"Success: {source.name} is connected to {target.name} whenever both are there")
    return ExitCode.PASSED


def _subscriptions(network: Network) -> set[tuple[str, str]]:
    """Return the names of source and target of all persistent connections."""
    groups = Bottle.parse(" ".join(network.names.command("subscribe")))
    return {
        (Contact.parse(as_string(group.find("src"))).name, Contact.parse(as_string(group.find("dest"))).name)
        for group in groups
        if isinstance(group, Bottle) and group.check("src") and group.check("dest")
    }


def _connected(network: Network, source: Contact, target: Contact) -> bool:
    """Return whether a port exists and sends to another one."""
    if network.resolve(source) is None:
        return False
    try:
        return remote.connection(network, source, target) is not None
    except MiddlewareError:
        return False


def _list_subscriptions(network: Network) -> ExitCode:
    for group in Bottle.parse(" ".join(network.names.command("subscribe"))):
        if not isinstance(group, Bottle):
            continue
        flags = group.find_group("topic")
        topics = [as_int(flag) for flag in flags.tail()] if flags is not None else []
        ends = [as_string(group.find(key)) for key in ("src", "dest")]
        for index, is_topic in enumerate(topics[: len(ends)]):
            if is_topic:
                ends[index] = f"topic:/{ends[index]}"
        mode = as_string(group.find("mode"))
        say(f"{ends[0]} -> {ends[1]}{f' (until {mode} is gone)' if mode else ''}")
    return ExitCode.PASSED
