"""What a monitor is: the base class of those in Python, and the message that it sees."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rtf import clock
from rtf.bottle import Bottle, Property
from rtf.middleware.monitors.events import EVENTS, Constraint
from rtf.middleware.types.codecs import BOTTLE

if TYPE_CHECKING:
    from rtf.middleware.types.codecs import Codec
    from rtf.middleware.wire.incoming_message import IncomingMessage


class MonitoredMessage:
    """A message that a monitor looks at: its sender, its envelope, and its contents, decoded when asked for."""

    __slots__ = ("_found", "_message", "envelope", "sender")

    def __init__(self, message: IncomingMessage) -> None:
        self._message = message
        self._found: Bottle | None = None
        self.sender = message.sender
        self.envelope = message.envelope

    @property
    def bottle(self) -> Bottle:
        """The contents. To change them, return another bottle from ``update``."""
        if self._found is None:
            self._found = self._message.read()
        return self._found

    def read(self, codec: Codec[Any] = BOTTLE) -> Any:
        """Return the contents as another type, such as a picture."""
        return self._message.read(codec)


class PortMonitor:
    """A monitor of one connection, or of all messages of a port. A script defines a subclass of the name ``Monitor``.

    Its methods are called one after the other, in the thread of the connection whose message it is. One that raises,
    returns something else, or does not return within a second ends the monitoring of its connection, which is reported;
    the messages go on.
    """

    def __init__(self) -> None:
        self._constraint = Constraint()
        #: Seconds between calls of ``trig``; 0: only before others decide.
        self.trig_interval = 0.0

    def create(self, info: Property) -> bool:
        """Begin, and return whether it is ready.

        ``info`` has what the connection sets, and filename, type, source, destination, carrier, sender_side and
        receiver_side.
        """
        del info
        return True

    def destroy(self) -> None:
        """End."""

    def accept(self, message: MonitoredMessage) -> bool:
        """Return whether a message is let through, before the constraint is looked at."""
        del message
        return True

    def update(self, message: MonitoredMessage) -> object:
        """Return what is delivered instead: a bottle or any object with a codec, or ``message`` itself."""
        return message

    def update_reply(self, reply: MonitoredMessage) -> object:
        """Return what is answered instead of the reply to a request."""
        return reply

    def trig(self) -> None:
        """Called before another connection of the port decides by its constraint, and every ``trig_interval``."""

    def setparam(self, settings: Bottle) -> None:
        """Take settings of the admin command ``[set]``, a list of lists of name and value."""

    def getparam(self) -> Property:
        """Return settings for the admin command ``[get]``."""
        return Property()

    # For scripts ------------------------------------------------------------------------------------------------------

    @property
    def constraint(self) -> str:
        """The expression of events without which no message passes; setting a wrong one raises ProtocolError."""
        return self._constraint.text

    @constraint.setter
    def constraint(self, text: str) -> None:
        self._constraint = Constraint(text)

    def set_event(self, name: str, lifetime: float | None = None) -> None:
        """Set an event for some seconds, or until it is unset."""
        EVENTS.set(name, self, clock.current().now(), lifetime)

    def unset_event(self, name: str) -> None:
        """End an event that this monitor has set."""
        EVENTS.unset(name, self)

    def holds(self) -> bool:
        """Return whether the constraint is true now."""
        return not self._constraint.text or self._constraint.holds(EVENTS.active(clock.current().now()))


class SettingsMonitor(PortMonitor):
    """A monitor whose connection may set what the admin command ``[set]`` changes."""

    def create(self, info: Property) -> bool:
        self.setparam(info.to_bottle())
        return True
