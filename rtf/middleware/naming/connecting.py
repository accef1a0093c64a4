"""How a name server has two ports connected: it asks the source, as the connect tool does."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from rtf.middleware import remote
from rtf.middleware.names import Contact
from rtf.middleware.naming.asked import Asked
from rtf.middleware.naming.errands import Errands

if TYPE_CHECKING:
    from rtf.errors import RtfError
    from rtf.middleware.network import Network


class Connector:
    """Makes and ends connections between other ports of a network, one after the other, in a thread of its own.

    The network's ``report`` hears what was done or could not be done, its ``patience`` is how long a port may take.
    """

    def __init__(self, network: Network) -> None:
        self._network = network
        self._errands = Errands("rtf-names-connecting", self._failed)

    def settle(self, source: str, target: str, wanted: bool) -> None:
        """Have two ports connected, or not any more. What is asked for last counts."""
        asked = Asked.parse(source), Asked.parse(target)
        key = asked[0].name, asked[1].name
        if wanted:
            self._errands.put(key, partial(self._connect, *asked))
            return
        # It is looked up now, because it may be about to be unregistered.
        place = self._network.names.query(asked[0].name)
        if place is not None:
            self._errands.put(key, partial(self._disconnect, place, asked[1].name))

    def close(self) -> None:
        """Do nothing more; waits for what is being done."""
        self._errands.close()

    def _connect(self, source: Asked, target: Asked) -> None:
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
