"""Persistent connections, made whenever both ports exist, and topics, which connect all their sources and targets.

A port is *live* from its announcement until it is unregistered. Whenever two live ports should be connected,
``connect`` is called; this module does not contact ports.
"""

from __future__ import annotations

import threading
from dataclasses import asdict, dataclass
from itertools import product
from typing import TYPE_CHECKING

from rtf import clock
from rtf.bottle import Bottle
from rtf.middleware.naming.port_query import PortQuery
from rtf.middleware.naming.table import check_fit

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rtf.middleware.naming.table import Table

    #: Called with source and destination as written, and whether they should be connected.
    Connect = Callable[[str, str, bool], None]

#: The maximum of connections, topics and types each. A topic connects all sources with all targets, so these multiply.
MAX_SUBSCRIPTIONS = 1_000
#: Seconds after an announcement during which reports that the port is gone are ignored.
_FRESH = 30.0


@dataclass(frozen=True, slots=True)
class Subscription:
    """A persistent connection: the two port names, and the names as written in the request."""

    source: str
    target: str
    asked_source: str
    asked_target: str
    #: ``from`` or ``to``: it is removed when the source or the target is unregistered.
    mode: str = ""


class Subscriptions:
    """The persistent connections, topics and type relations of a network. The owner sets ``connect``."""

    def __init__(self, table: Table) -> None:
        self.connect: Connect = _make_no_connections
        self._table = table
        self._lock = threading.RLock()
        self._live: dict[str, float] = {}
        self._kept: dict[tuple[str, str], Subscription] = {}
        self._topics: dict[str, None] = {}
        self._types: dict[tuple[str, str], str] = {}
        self._load()

    def subscribe(self, source: str, target: str, mode: str = "") -> bool:
        """Connect two ports now and whenever they come back; ``topic:/name`` joins a port to a topic."""
        check_fit(source, target, mode)
        asked = PortQuery.parse(source), PortQuery.parse(target)
        with self._lock:
            pair = asked[0].name, asked[1].name
            if len(self._kept) >= MAX_SUBSCRIPTIONS and pair not in self._kept:
                return False
            for one in asked:
                if one.carrier == "topic" and one.name not in self._topics and not self.set_topic(one.name):
                    return False
            subscription = Subscription(*pair, source, target, mode)
            self._kept[pair] = subscription
            self._put("subscription", " ".join(pair), asdict(subscription))
            self._establish(pair[asked[0].carrier == "topic"])
        return True

    def unsubscribe(self, source: str, target: str) -> bool:
        """Remove a subscription; an existing connection stays."""
        pair = PortQuery.parse(source).name, PortQuery.parse(target).name
        with self._lock:
            if self._kept.pop(pair, None) is not None:
                self._drop("subscription", " ".join(pair))
        return True

    def listed(self, name: str = "") -> Bottle:
        """Return all subscriptions, or those of a port, as the name server's answer."""
        with self._lock:
            kept = [self._kept[pair] for pair in sorted(self._kept) if not name or name in pair]
            return Bottle(["subscriptions", *(self._describe(one) for one in kept)])

    def _describe(self, one: Subscription) -> Bottle:
        described: list[object] = ["subscription", ["src", one.asked_source], ["dest", one.asked_target]]
        if one.mode:
            described.append(["mode", one.mode])
        flags = [int(one.source in self._topics), int(one.target in self._topics)]
        if any(flags):
            described.append(["topic", *flags])
        return Bottle(described)

    # Topics and types --------------------------------------------------------------------------------------------

    def set_topic(self, name: str, *, active: bool = True) -> bool:
        """Make a name a topic; if not ``active``, remove the topic."""
        check_fit(name)
        with self._lock:
            if not active:
                self._topics.pop(name, None)
                self._drop("topic", name)
                return True
            if len(self._topics) >= MAX_SUBSCRIPTIONS and name not in self._topics:
                return False
            self._topics[name] = None
            self._put("topic", name, value=True)
            for source, target in self._through(name):
                self._settle(source, target)
        return True

    @property
    def topics(self) -> list[str]:
        """The names of all topics."""
        with self._lock:
            return [*self._topics]

    def set_type(self, family: str, name: str, value: str) -> bool:
        """Store a relation between names of types."""
        check_fit(family, name, value)
        with self._lock:
            if len(self._types) >= MAX_SUBSCRIPTIONS and (family, name) not in self._types:
                return False
            self._types[family, name] = value
            self._put("type", f"{family} {name}", value)
        return True

    def type_of(self, family: str, name: str) -> str:
        """Return the stored relation, or an empty string."""
        with self._lock:
            return self._types.get((family, name), "")

    # Ports appear and disappear ----------------------------------------------------------------------------------

    def came(self, name: str) -> None:
        """Handle the announcement of a port."""
        with self._lock:
            if self._table.query(name) is not None:
                self._live[name] = clock.monotonic()
                self._establish(name)

    def silent(self, name: str) -> None:
        """Handle a report that a port could not be reached."""
        with self._lock:
            if clock.monotonic() - self._live.get(name, 0.0) > _FRESH:
                self._live.pop(name, None)

    def went(self, name: str) -> None:
        """Handle the coming removal of a port: disconnect its persistent connections."""
        with self._lock:
            self._live.pop(name, None)
            known = self._table.query(name) is not None
            for one in self._of(name):
                if known and not {one.source, one.target} & self._topics.keys():
                    self.connect(one.asked_source, one.asked_target, False)
                if one.mode == ("from" if name == one.source else "to"):
                    self.unsubscribe(one.source, one.target)

    def _of(self, name: str) -> list[Subscription]:
        """Return every connection that a port should have, directly or through a topic."""
        found = [one for one in self._kept.values() if name in (one.source, one.target)]
        topics = {one.target if one.source == name else one.source for one in found} & self._topics.keys()
        for topic in sorted(topics):
            found += [
                Subscription(source.source, target.target, source.asked_source, target.asked_target)
                for source, target in self._through(topic, name)
            ]
        return found

    def _through(self, topic: str, name: str = "") -> Iterator[tuple[Subscription, Subscription]]:
        """Return the pairs that a topic connects, or those that include a port."""
        sources = [one for one in self._kept.values() if one.target == topic]
        targets = [one for one in self._kept.values() if one.source == topic]
        if not name:
            yield from product(sources, targets)
            return
        own = [one for one in sources if one.source == name]
        yield from product(own, targets)
        yield from product([one for one in sources if one not in own], [one for one in targets if one.target == name])

    def _establish(self, name: str) -> None:
        for one in self._of(name):
            self._settle(one, one)

    def _settle(self, source: Subscription, target: Subscription) -> None:
        """Request a connection if both ports are live and neither is a topic."""
        names = source.source, target.target
        places = [self._table.query(name) if name in self._live else None for name in names]
        if all(place is not None and place.carrier != "topic" for place in places):
            self.connect(source.asked_source, target.asked_target, True)

    # Restoring the state of an earlier server --------------------------------------------------------------------

    def _load(self) -> None:
        with self._table.lock:
            store = self._table.store
            for _, value in store.load("subscription"):
                one = Subscription(**value)
                self._kept[one.source, one.target] = one
            self._topics = {name: None for name, _ in store.load("topic")}
            for key, value in store.load("type"):
                family, _, name = key.partition(" ")
                self._types[family, name] = value
            # A restarted server gets no announcements: the ports that it knew count as live.
            self._live = {contact.name: 0.0 for contact in self._table.list()}

    def _put(self, kind: str, key: str, value: object) -> None:
        with self._table.lock:
            self._table.store.put(kind, key, value)

    def _drop(self, kind: str, key: str) -> None:
        with self._table.lock:
            self._table.store.drop(kind, key)


def _make_no_connections(_source: str, _target: str, _wanted: bool) -> None:
    """Make no connections: the default of ``connect``."""
