"""``rtf top``: ports and connections while they work."""

from __future__ import annotations

import contextlib
import sys
from typing import TYPE_CHECKING

from rtf import clock
from rtf.cli.network.options import contact, make_network, make_parser
from rtf.cli.network.table import Table, show
from rtf.cli.network.terminal import ENDING
from rtf.cli.parser import seconds
from rtf.middleware.monitor import Flow, Tap, Traffic, survey
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from rtf.middleware.monitor import PortState
    from rtf.middleware.names import Contact
    from rtf.middleware.network import Network

_NUMBERS = ("PING", "IN", "OUT", "MSG/S", "BANDWIDTH")
_UNKNOWN = "-"
_ALIVE = {True: "yes", False: "no", None: _UNKNOWN}


def top(words: Sequence[str]) -> ExitCode:
    """Show tables again and again until a signal; once where nobody looks on."""
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
            _show_live(looks)
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


def _show_live(looks: Iterator[list[Table]]) -> None:
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
    """The connections; what flows is known for one that is the only one of its receiver."""
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
