"""``rtf list`` and ``rtf top``: ports and connections, as tables of text or, on a terminal, with rules and colours."""

from __future__ import annotations

import contextlib
import sys
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from rtf import clock
from rtf.cli.network.options import contact, make_network, make_parser
from rtf.cli.network.terminal import ENDING, say
from rtf.cli.parser import seconds
from rtf.middleware.tools.monitor import Flow, Tap, Traffic, survey
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from rich.table import Table as RichTable

    from rtf.middleware.ports.network import Network
    from rtf.middleware.tools.monitor import PortState
    from rtf.middleware.wire.contact import Contact

#: Colours of cells that are worth one.
_STYLES = {"yes": "green", "no": "bold red"}


@dataclass
class Table:
    """Rows of text below headings; ``numbers`` are the columns that are aligned on the right."""

    headings: Sequence[str]
    rows: list[Sequence[str]] = field(default_factory=list)
    numbers: Sequence[str] = ()
    title: str = ""

    def to_text(self) -> str:
        """Return aligned columns, two blanks between them."""
        rows = [self.headings, *self.rows]
        widths = [max(len(row[column]) for row in rows) for column in range(len(self.headings))]
        right = [heading in self.numbers for heading in self.headings]
        lines = [
            "  ".join(
                cell.rjust(width) if to_right else cell.ljust(width)
                for cell, width, to_right in zip(row, widths, right, strict=True)
            ).rstrip()
            for row in rows
        ]
        return "\n".join([self.title, *lines] if self.title else lines)

    def to_rich(self) -> RichTable:
        """Return the table for a terminal."""
        from rich import box
        from rich.table import Table as RichTable
        from rich.text import Text

        table = RichTable(title=self.title or None, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
        for heading in self.headings:
            table.add_column(heading, justify="right" if heading in self.numbers else "left", overflow="fold")
        for row in self.rows:
            table.add_row(*(Text(cell, style=_STYLES.get(cell, "")) for cell in row))
        return table


def show(*tables: Table) -> None:
    """Print tables, a blank line between them."""
    if sys.stdout.isatty():
        from rich.console import Console

        Console().print(*(table.to_rich() for table in tables), sep="")
    else:
        print("\n\n".join(table.to_text() for table in tables), flush=True)


_UNKNOWN = "-"
_ALIVE = {True: "yes", False: "no", None: _UNKNOWN}


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


_NUMBERS = ("PING", "IN", "OUT", "MSG/S", "BANDWIDTH")


def top(words: Sequence[str]) -> ExitCode:
    """Show tables again and again until a signal; once where the output is no terminal."""
    parser = make_parser(
        "top",
        "Ports and connections while they work. PING is how long a port takes to answer; MSG/S and BANDWIDTH are what"
        " comes to it, for ports of this machine: bytes over TCP, and messages over tcp. What else a port sends is"
        " measured with --tap, which reads it as any reader would.",
        "rtf top\nrtf top /robot --once\nrtf top --tap /robot/camera",
    )
    parser.add_argument("prefix", nargs="?", default="", metavar="/PREFIX", help="only ports at or below this name")
    parser.add_argument("--once", action="store_true", help="one look, also on a terminal")
    parser.add_argument("--interval", metavar="S", type=seconds, default=1.0, help="time between two looks (default 1)")
    parser.add_argument(
        "--tap", metavar="/PORT", type=contact, action="append", default=[], help="measure what this port sends"
    )
    options = parser.parse_args(words)
    once = options.once or not sys.stdout.isatty()
    network = make_network()
    with contextlib.suppress(KeyboardInterrupt), _tapped(network, options.tap) as taps:
        looks = _looks(network, options.prefix, options.interval, taps)
        if once:
            show(*next(looks))
        else:
            show_live(looks)
    return ExitCode.PASSED


@contextlib.contextmanager
def _tapped(network: Network, sources: Sequence[Contact]) -> Iterator[list[Tap]]:
    taps: list[Tap] = []
    ENDING.hold()
    try:
        try:
            taps.extend(Tap(network, source) for source in sources)
            ENDING.release()
            yield taps
        finally:
            ENDING.hold()
            for tap in taps:
                tap.close()
    finally:
        ENDING.release()


def _looks(network: Network, prefix: str, interval: float, taps: Sequence[Tap]) -> Iterator[list[Table]]:
    traffic = Traffic()
    traffic.flows(())
    while True:
        clock.sleep(interval)
        ports = survey(network, prefix)
        hidden = {tap.name for tap in taps}
        ports = [port for port in ports if port.name not in hidden]
        flows = traffic.flows(ports)
        tables = [_ports(ports, flows), _links(ports, flows, hidden)]
        yield [*tables, _taps(taps)] if taps else tables


def show_live(looks: Iterator[list[Table]]) -> None:
    """Show tables again and again on the whole terminal, until there are no more."""
    from rich.console import Group
    from rich.live import Live

    with Live(screen=True, auto_refresh=False) as live:
        for tables in looks:
            live.update(Group(*(table.to_rich() for table in tables)), refresh=True)


def _ports(ports: Sequence[PortState], flows: dict[str, Flow]) -> Table:
    table = Table(("PORT", "ALIVE", "PING", "IN", "OUT", "MSG/S", "BANDWIDTH"), numbers=_NUMBERS)
    for port in ports:
        ping = _UNKNOWN if port.latency is None else f"{1e3 * port.latency:.2f} ms"
        ends = (str(len(port.inputs)), str(len(port.outputs))) if port.alive else (_UNKNOWN, _UNKNOWN)
        table.rows.append((port.name, _ALIVE[port.alive], ping, *ends, *_texts(flows.get(port.name))))
    return table


def _links(ports: Sequence[PortState], flows: dict[str, Flow], hidden: set[str]) -> Table:
    """Return the table of connections; a flow is known for a connection that is the only one of its receiver."""
    table = Table(("FROM", "TO", "CARRIER", "MSG/S", "BANDWIDTH"), numbers=_NUMBERS)
    inputs = {port.name: len(port.inputs) for port in ports}
    for port in ports:
        for link in port.outputs:
            if link.target not in hidden:
                alone = inputs.get(link.target) == 1
                table.rows.append((*link, *_texts(flows.get(link.target) if alone else None)))
    return table


def _taps(taps: Sequence[Tap]) -> Table:
    table = Table(("TAPPED", "MSG/S", "BANDWIDTH"), numbers=_NUMBERS)
    for tap in taps:
        table.rows.append((tap.source.name, *_texts(tap.flow())))
    return table


def _texts(flow: Flow | None) -> tuple[str, str]:
    if flow is None:
        return _UNKNOWN, _UNKNOWN
    return _UNKNOWN if flow.rate is None else f"{flow.rate:.1f}", _size(flow.bandwidth)


def _size(bytes_per_second: float) -> str:
    value = bytes_per_second
    for unit in ("B/s", "kB/s", "MB/s"):
        if value < _STEP:
            return f"{value:.0f} {unit}" if unit == "B/s" else f"{value:.1f} {unit}"
        value /= _STEP
    return f"{value:.1f} GB/s"


_STEP = 1000.0
