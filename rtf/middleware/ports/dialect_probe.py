"""The question by which a port finds out the dialect of a reader before it sends to it.

YARP 3 and 4 differ in the bytes of numbers, and a port's description of itself does not say which it is. So a property
of the reader is set to a number, as text, and requested in binary: the code in the reply shows the dialect. The
property stays there and has no meaning. Found out with YARP 3.12.3 and 4.0.0.
"""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, BottleError, Dialect, Vocab
from rtf.middleware.carriers.stream_carrier import TCP
from rtf.middleware.errors import MiddlewareError, NameNotFoundError, ProtocolError
from rtf.middleware.ports.remote import administer
from rtf.middleware.types.codecs import BOTTLE
from rtf.middleware.wire.outgoing_message import OutgoingMessage

if TYPE_CHECKING:
    from rtf.middleware.carriers.base import Carrier
    from rtf.middleware.ports.network import Network
    from rtf.middleware.wire.contact import Contact

#: The property, and what a port of this library replies when it is set: its readers understand both dialects.
KEY = "rtf_dialect"
BOTH = "both"
_NUMBER = 1.5
_OK = Vocab("ok")


def dialect_of_reader(network: Network, carrier: Carrier, reader: Contact) -> Dialect | None:
    """Return the dialect in which to send to a port by a carrier; None if it is unknown, which is reported.

    A network whose dialect is set uses it with all ports. Otherwise the port is asked: that takes one round trip with a
    port of this library, two with others, and each wait is limited by the network's patience.
    """
    if network.dialect_is_set or not carrier.has_dialects:
        return network.dialect
    try:
        return _ask(network, reader)
    except (MiddlewareError, BottleError) as error:
        network.report(f"{reader.name or reader} does not tell whether it speaks YARP 3 or 4: {error}")
        return None


def _ask(network: Network, reader: Contact) -> Dialect:
    found = network.resolve(reader)
    if found is None:
        raise NameNotFoundError("its address is not known")
    reply = administer(network, found, Bottle([Vocab("prop"), Vocab("set"), KEY, _NUMBER]))
    if reply.get(1) == BOTH:
        return network.dialect
    with contextlib.closing(network.reach(found)) as stream:
        link = TCP.call(stream, "admin")
        link.send(OutgoingMessage("a", Bottle([Vocab("prop"), Vocab("get"), KEY]), BOTTLE, Dialect.YARP3))
        kept, dialect = link.receive_reply_in_any(BOTTLE, Dialect.YARP3)
    if kept != Bottle([_NUMBER]):
        raise ProtocolError(f"it does not keep a property, but says {kept}")
    return dialect
