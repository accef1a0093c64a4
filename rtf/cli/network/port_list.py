"""``rtf list``: the ports of the network, as a table or as a tree of what they send to."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.cli.network.options import make_network, make_parser
from rtf.cli.network.table import Table, show
from rtf.cli.network.terminal import say
from rtf.middleware.monitor import survey
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.monitor import PortState

_ALIVE = {True: "yes", False: "no", None: "-"}


def list_ports(words: Sequence[str]) -> ExitCode:
    """Print all ports."""
    parser = make_parser(
        "list",
        "The ports of the network: where each is, and whether it answers.",
        "rtf list /robot\nrtf list --tree    # which port sends to which, and how",
    )
    parser.add_argument("prefix", nargs="?", default="", metavar="/PREFIX", help="only ports at or below this name")
    parser.add_argument("--tree", action="store_true", help="what each port sends to, below its name")
    parser.add_argument("--names", action="store_true", help="the names alone, without asking the ports")
    options = parser.parse_args(words)
    network = make_network()
    if options.names:
        names = [contact.name for contact in network.names.list(options.prefix)]
        if names:
            say("\n".join(names))
        return ExitCode.PASSED
    ports = survey(network, options.prefix)
    if options.tree:
        for line in _tree(ports):
            say(line)
    else:
        show(_table(ports))
    return ExitCode.PASSED


def _table(ports: Sequence[PortState]) -> Table:
    table = Table(("PORT", "ADDRESS", "CARRIER", "ALIVE", "IN", "OUT"), numbers=("IN", "OUT"))
    for port in ports:
        contact = port.contact
        ends = (str(len(port.inputs)), str(len(port.outputs))) if port.alive else ("-", "-")
        table.rows.append((port.name, f"{contact.host}:{contact.port}", contact.carrier, _ALIVE[port.alive], *ends))
    return table


def _tree(ports: Sequence[PortState]) -> list[str]:
    lines = []
    for port in ports:
        lines.append(port.name if port.alive is not False else f"{port.name}  (does not answer)")
        last = len(port.outputs) - 1
        lines += [
            f"{'└──' if index == last else '├──'} {link.target}  ({link.carrier})"
            for index, link in enumerate(port.outputs)
        ]
    return lines
