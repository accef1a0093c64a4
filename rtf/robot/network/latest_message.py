"""The receiving end of a stream: the latest message, and its age by the robot's clock.

A robot sends a thousand messages a second, of which its client uses few. Messages are therefore stored undecoded and
decoded on demand.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Generic, NamedTuple, TypeVar

from rtf import clock
from rtf.errors import RtfError
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.ports import remote
from rtf.middleware.ports.port import Port
from rtf.middleware.types import Stamp
from rtf.middleware.wire.contact import Contact
from rtf.robot.errors import DeviceError, StaleStateError

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network
    from rtf.middleware.types.codecs import Codec
    from rtf.middleware.wire.incoming_message import IncomingMessage

T = TypeVar("T")


class ReceivedValue(NamedTuple, Generic[T]):
    """A received object: its stamp, if it had one, and its arrival time in seconds of the robot's clock."""

    value: T
    stamp: Stamp | None
    at: float

    @property
    def time(self) -> float:
        """The time of the stamp; without one, that of the arrival."""
        return self.at if self.stamp is None else self.stamp.time


class LatestMessage(Generic[T]):
    """A port that stores the latest object of a stream. A message that cannot be decoded closes its connection.

    ``timeout`` is the age in seconds of the robot's clock beyond which an object is stale. ``lazily``: a message of the
    same length as the last valid one is decoded on demand, all others on arrival; it is for short messages. Raises
    DeviceError if the port cannot be opened.
    """

    def __init__(self, name: str, codec: Codec[T], *, timeout: float, network: Network, lazily: bool = False) -> None:
        self.timeout = timeout
        self._codec = codec
        self._network = network
        self._lazily = lazily
        self._usual: int | None = None  # the length of the last valid message
        self._latest: ReceivedValue[T] | None = None
        self._unread: tuple[IncomingMessage, float | None] | None = None  # and its arrival time, see _arrival
        self._reading = threading.Lock()
        try:
            self._port = Port(
                name, self._receive, network=network, outputs=False, nonblocking=lazily, promise=codec.promise
            )
        except MiddlewareError as error:
            raise DeviceError(f"the port {name} cannot be opened: {error}") from error

    @property
    def name(self) -> str:
        """The name of the port."""
        return self._port.name

    def connect(self, source: str, carrier: str) -> None:
        """Connect a port to this one. Raises DeviceError."""
        try:
            remote.connect(self._network, Contact(source), Contact(self.name), carrier)
        except MiddlewareError as error:
            raise DeviceError(f"{source} does not send to {self.name}: {error}; is its robot running?") from error

    def _receive(self, delivery: IncomingMessage) -> None:
        """Store a message. Runs in the thread of the connection."""
        at = _arrival()
        size = delivery.size
        if self._lazily and size is not None and size == self._usual:
            unread = delivery.kept(), at
            with self._reading:
                self._unread = unread
            return
        latest = _latest(delivery.read(self._codec), delivery.envelope, at)
        self._usual = size
        with self._reading:
            self._latest, self._unread = latest, None

    def _read(self) -> ReceivedValue[T] | None:
        """Decode the latest message if that is not done yet. Runs in the thread of the caller.

        If it cannot be decoded, its sender is disconnected, and the previous object stays the latest.
        """
        with self._reading:
            if self._unread is not None:
                delivery, at = self._unread
                try:
                    self._latest = _latest(delivery.read(self._codec), delivery.envelope, at)
                except RtfError as error:
                    self._port.remove_input(delivery.sender)
                    self._network.report(f"{self.name}: {delivery.sender} was cut off: {error}")
                self._unread = None
            return self._latest

    @property
    def latest(self) -> ReceivedValue[T] | None:
        """The latest object; None before the first."""
        return self._latest if self._unread is None else self._read()

    def age(self) -> float | None:
        """Return the age of the latest object in seconds; None before the first."""
        latest = self.latest
        return None if latest is None else clock.current().now() - latest.at

    def fresh(self) -> ReceivedValue[T]:
        """Return the latest object. Raises StaleStateError if it is too old, and before the first."""
        latest = self.latest
        if latest is None:
            raise StaleStateError(f"no message has arrived at {self.name} yet")
        age = clock.current().now() - latest.at
        if age > self.timeout:
            raise StaleStateError(
                f"the latest message to {self.name} is {age:.3f} s old, more than the allowed {self.timeout:g} s"
            )
        return latest

    def close(self) -> None:
        """Close the port."""
        self._port.close()


def _arrival() -> float | None:
    """Return the arrival time of a message by the robot's clock; None if its stamp has to be used.

    A simulator's clock is the clock of the stamps, and reading it here would make this thread a participant that its
    time waits for; there a message without a stamp counts as old. The stamps of a real robot are the time of another
    machine, so there the arrival counts.
    """
    time = clock.current()
    return time.now() if isinstance(time, clock.SystemClock) else None


def _latest(value: T, envelope: str, at: float | None) -> ReceivedValue[T]:
    stamp = Stamp.parse(envelope)
    if at is None:
        at = float("-inf") if stamp is None else stamp.time
    return ReceivedValue(value, stamp, at)
