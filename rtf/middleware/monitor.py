"""What can be seen of a whole network from outside: which ports answer and how fast, what is connected, what flows.

Everything is asked by the questions that every port of YARP answers, and read from what the kernel counts for the
connections of this machine, so ports of YARP are seen as well as ours and none of them has to help. What cannot be
seen so are the rates of other machines, and of datagrams; for these there is :class:`Tap`.
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
from rtf.middleware import kernel, remote
from rtf.middleware.codecs import RAW
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.names import Contact
from rtf.middleware.port import Port

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from typing import Self

    from rtf.middleware.carriers.text import TextOutput
    from rtf.middleware.delivery import Delivery
    from rtf.middleware.network import Network

#: Entries of a name server that stand for no port that could be asked.
NO_PORT = ("mcast", "topic")
_AT_A_TIME = 16
#: A connection is seen from both ends; this is how the kernel tells an acknowledgement of tcp: its bytes.
_ACK = 8


class Link(NamedTuple):
    """A connection, as its sender tells of it."""

    source: str
    target: str
    carrier: str


@dataclass(frozen=True, slots=True)
class PortState:
    """A port at one moment. ``latency`` is seconds for a question and its answer, None when it did not answer."""

    contact: Contact
    latency: float | None = None
    outputs: tuple[Link, ...] = ()
    inputs: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Its name."""
        return self.contact.name

    @property
    def alive(self) -> bool | None:
        """Whether it answers; None for an entry that is no port."""
        return None if self.contact.carrier in NO_PORT else self.latency is not None


def survey(network: Network, prefix: str = "", *, patience: float = 1.0) -> list[PortState]:
    """Look at all ports, or those at or below a name, many at a time; in the order of their names.

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
        with remote.talk(network, contact) as link:
            before = clock.monotonic()
            _ask(link, "[ver]")
            latency = clock.monotonic() - before
            targets = [*map(as_string, _ask(link, "[list] [out]"))]
            outputs = [Link(contact.name, target, _carrier(link, target)) for target in targets]
            # Whoever asks, as this does now, appears among them under a label that is no name of a port.
            inputs = [source for source in map(as_string, _ask(link, "[list] [in]")) if source.startswith("/")]
    except MiddlewareError:
        return PortState(contact)
    return PortState(contact, latency, tuple(outputs), tuple(inputs))


def _ask(link: TextOutput, question: str) -> Bottle:
    link.send_lines("a", question)
    return Bottle.parse(" ".join(link.receive_lines()))


def _carrier(link: TextOutput, target: str) -> str:
    return as_string(_ask(link, f"[list] [out] {Bottle([target]).to_text()}").find("carrier"))


# What flows ------------------------------------------------------------------------------------------------------


class Flow(NamedTuple):
    """What a port received in a second: bytes, and messages where these can be told."""

    bandwidth: float
    rate: float | None


class Traffic:
    """Rates between two looks at what the kernel has counted for the ports of this machine.

    Messages over ``tcp`` can be counted because a receiver acknowledges each with eight bytes of its own; those over
    other carriers, and questions with their answers, cannot.
    """

    def __init__(self) -> None:
        self._at = 0.0
        self._seen: Mapping[kernel.Ends, kernel.Counted] = {}

    def flows(self, ports: Iterable[PortState]) -> dict[str, Flow]:
        """What came to each port since the last call, by name; ports of which nothing is known are left out."""
        seen, now = kernel.connections(), clock.monotonic()
        before, seconds = self._seen, now - self._at
        self._seen, self._at = seen, now
        coming: dict[tuple[str, int], list[kernel.Counted]] = {}
        for ends, counted in seen.items():
            if ends in before:
                coming.setdefault(ends.near, []).append(counted.since(before[ends]))
        found = {}
        for port in ports:
            counts = coming.get((port.contact.host, port.contact.port))
            if counts and port.inputs:
                found[port.name] = _flow(counts, seconds)
        return found


def _flow(counts: Sequence[kernel.Counted], seconds: float) -> Flow:
    received = sum(one.received for one in counts)
    answered = sum(one.sent for one in counts)
    answers = sum(one.segments_sent for one in counts)
    only_acks = answers > 0 and answered == _ACK * answers
    rate = answers / seconds if only_acks else 0.0 if received == 0 else None
    return Flow(received / seconds, rate)


class Tap:
    """Counts what a port sends, by having it send to a port of ours for as long as the block lasts.

    Raises MiddlewareError when it cannot be connected. It costs the sender as much as any other reader.
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

    def _receive(self, delivery: Delivery) -> None:
        size = len(delivery.read(RAW))
        with self._lock:
            self._messages += 1
            self._bytes += size

    def flow(self) -> Flow:
        """What came since the last call."""
        now = clock.monotonic()
        with self._lock:
            messages, size, seconds = self._messages, self._bytes, now - self._since
            self._messages = self._bytes = 0
            self._since = now
        return Flow(size / seconds, messages / seconds)

    @property
    def name(self) -> str:
        """The name of the port that counts."""
        return self._port.name

    def close(self) -> None:
        """Count no more."""
        with contextlib.suppress(MiddlewareError):  # it is gone, or sends here no more
            remote.disconnect(self._network, self.source, Contact(self.name))
        self._port.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()
