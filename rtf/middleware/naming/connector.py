"""The connector of a name server: it asks the source port to connect to a target, as the connect tool does."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from rtf.middleware.naming.port_query import PortQuery
from rtf.middleware.naming.work_queue import WorkQueue
from rtf.middleware.ports import remote
from rtf.middleware.wire.contact import Contact

if TYPE_CHECKING:
    from rtf.errors import RtfError
    from rtf.middleware.ports.network import Network


class Connector:
    """Makes and ends connections between other ports of a network, one at a time, in a thread of its own.

    Results and failures are passed to the network's ``report``; its ``patience`` is the timeout of a request.
    """

    def __init__(self, network: Network) -> None:
        self._network = network
        self._queue = WorkQueue("rtf-names-connecting", self._failed)

    def settle(self, source: str, target: str, wanted: bool) -> None:
        """Request that two ports are connected, or disconnected. The last request for a pair counts."""
        asked = PortQuery.parse(source), PortQuery.parse(target)
        key = asked[0].name, asked[1].name
        if wanted:
            self._queue.put(key, partial(self._connect, *asked))
            return
        # Looked up now, because the source may be about to be unregistered.
        place = self._network.names.query(asked[0].name)
        if place is not None:
            self._queue.put(key, partial(self._disconnect, place, asked[1].name))

    def close(self) -> None:
        """Discard the requests that wait, and wait for the one in progress."""
        self._queue.close()

    def _connect(self, source: PortQuery, target: PortQuery) -> None:
        network = self._network
        place, aim = network.names.query(source.name), network.names.query(target.name)
        if place is None or aim is None or remote.connection(network, place, aim) is not None:
            return
        carrier = target.carrier or source.carrier or aim.carrier
        network.report(remote.connect(network, place.by(""), Contact(target.name), carrier))

    def _disconnect(self, place: Contact, target: str) -> None:
        self._network.report(remote.disconnect(self._network, place, Contact(target)))

    def _failed(self, error: RtfError) -> None:
        self._network.report(str(error))
