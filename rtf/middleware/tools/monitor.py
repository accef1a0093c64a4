"""The state of a whole network: which ports answer and how fast, what is connected, and the data rates.

It is collected with admin requests that every YARP port answers, and from the kernel's counters of this machine's
connections, so YARP's own ports are covered and no program has to cooperate. Rates on other machines and of datagrams
are not visible this way; :class:`Tap` measures those.
"""

from __future__ import annotations

import contextlib
import copy
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from rtf import clock
from rtf.bottle import Bottle, as_string
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.ports import remote
from rtf.middleware.ports.port import Port
from rtf.middleware.tools import tcp_counters
from rtf.middleware.types.codecs import RAW
from rtf.middleware.wire.contact import Contact

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from typing import Self

    from rtf.middleware.ports.network import Network
    from rtf.middleware.wire.incoming_message import IncomingMessage

#: Carriers of name server entries that are not ports and cannot be queried.
NO_PORT = ("mcast", "topic")
_AT_A_TIME = 16
#: Bytes of an acknowledgement of ``tcp``, by which the kernel's counters show messages.
_ACK = 8


class Link(NamedTuple):
    """A connection, as reported by its source."""

    source: str
    target: str
    carrier: str


@dataclass(frozen=True, slots=True)
class PortState:
    """The state of a port at one moment. ``latency`` is a request's round trip in seconds, None without a reply."""

    contact: Contact
    latency: float | None = None
    outputs: tuple[Link, ...] = ()
    inputs: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """The name of the port."""
        return self.contact.name

    @property
    def alive(self) -> bool | None:
        """Whether the port answers; None for an entry that is not a port."""
        return None if self.contact.carrier in NO_PORT else self.latency is not None


def survey(network: Network, prefix: str = "", *, patience: float = 1.0) -> list[PortState]:
    """Query all ports, or those at or below ``prefix``, in parallel. Return their states sorted by name.

    A port that takes more than ``patience`` seconds counts as silent. Raises ConnectError without a name server.
    """
    hasty = copy.copy(network)
    hasty.patience = patience
    with ThreadPoolExecutor(_AT_A_TIME) as pool:
        return [*pool.map(partial(_look_at, hasty), network.names.list(prefix))]


def _look_at(network: Network, contact: Contact) -> PortState:
    if contact.carrier in NO_PORT or not contact.valid:
        return PortState(contact)
    try:
        with remote.talk(network, contact) as ask:
            before = clock.monotonic()
            remote.admin_request(ask, "[ver]")
            latency = clock.monotonic() - before
            targets = [*map(as_string, remote.admin_request(ask, "[list] [out]"))]
            outputs = [Link(contact.name, target, _carrier(ask, target)) for target in targets]
            # The connection of this query is listed too, under a label that does not begin with a slash.
            inputs = [
                source for source in map(as_string, remote.admin_request(ask, "[list] [in]")) if source.startswith("/")
            ]
    except MiddlewareError:
        return PortState(contact)
    return PortState(contact, latency, tuple(outputs), tuple(inputs))


def _carrier(ask: remote.Ask, target: str) -> str:
    return as_string(remote.admin_request(ask, f"[list] [out] {Bottle([target]).to_text()}").find("carrier"))


# Data rates ------------------------------------------------------------------------------------------------------


class Flow(NamedTuple):
    """The data rate of a port: bytes per second, and messages per second or None if they cannot be counted."""

    bandwidth: float
    rate: float | None


class Traffic:
    """Measures the data rates of this machine's ports, from the kernel's counters at two times.

    Messages over ``tcp`` can be counted because a receiver acknowledges each with eight bytes. Messages of other
    carriers, and requests with their replies, cannot.
    """

    def __init__(self) -> None:
        self._at = 0.0
        self._seen: Mapping[tcp_counters.Endpoints, tcp_counters.TcpCounters] = {}

    def flows(self, ports: Iterable[PortState]) -> dict[str, Flow]:
        """Return the data rate of each port since the last call, by name; ports without counters are left out."""
        seen, now = tcp_counters.connections(), clock.monotonic()
        before, seconds = self._seen, now - self._at
        self._seen, self._at = seen, now
        coming: dict[tuple[str, int], list[tcp_counters.TcpCounters]] = {}
        for ends, counted in seen.items():
            if ends in before:
                coming.setdefault(ends.near, []).append(counted.since(before[ends]))
        found = {}
        for port in ports:
            counts = coming.get((port.contact.host, port.contact.port))
            if counts and port.inputs:
                found[port.name] = _flow(counts, seconds)
        return found


def _flow(counts: Sequence[tcp_counters.TcpCounters], seconds: float) -> Flow:
    received = sum(one.received for one in counts)
    answered = sum(one.sent for one in counts)
    answers = sum(one.segments_sent for one in counts)
    only_acks = answers > 0 and answered == _ACK * answers
    rate = answers / seconds if only_acks else 0.0 if received == 0 else None
    return Flow(received / seconds, rate)


class Tap:
    """Measures what a port sends, by connecting it to a port of this process. A context manager.

    Raises MiddlewareError if the connection fails. A tap costs the sender as much as any other reader.
    """

    def __init__(self, network: Network, source: Contact, carrier: str = "fast_tcp") -> None:
        self.source = source
        self._network = network
        self._lock = threading.Lock()
        self._messages = 0
        self._bytes = 0
        self._since = clock.monotonic()
        self._port = Port("", self._receive, network=network, outputs=False)
        try:
            remote.connect(network, source.by(""), Contact(self.name), source.carrier or carrier)
        except MiddlewareError:
            self._port.close()
            raise

    def _receive(self, delivery: IncomingMessage) -> None:
        size = len(delivery.read(RAW))
        with self._lock:
            self._messages += 1
            self._bytes += size

    def flow(self) -> Flow:
        """Return the data rate since the last call."""
        now = clock.monotonic()
        with self._lock:
            messages, size, seconds = self._messages, self._bytes, now - self._since
            self._messages = self._bytes = 0
            self._since = now
        return Flow(size / seconds, messages / seconds)

    @property
    def name(self) -> str:
        """The name of the port that receives."""
        return self._port.name

    def close(self) -> None:
        """Disconnect and close the port."""
        with contextlib.suppress(MiddlewareError):  # the source is gone or no longer connected
            remote.disconnect(self._network, self.source, Contact(self.name))
        self._port.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()
