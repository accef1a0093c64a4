"""The receiving end of a stream: the newest object that came, and how old it is by the robot's clock.

A robot says a thousand things a second, of which its client wants to know few. What comes is therefore only kept, and
read when somebody asks for it.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Generic, NamedTuple, TypeVar

from rtf import clock
from rtf.errors import RtfError
from rtf.middleware import remote
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.names import Contact
from rtf.middleware.port import Port
from rtf.middleware.types import Stamp
from rtf.robot.errors import DeviceError, StaleStateError

if TYPE_CHECKING:
    from rtf.middleware.codecs import Codec
    from rtf.middleware.incoming_message import IncomingMessage
    from rtf.middleware.network import Network

T = TypeVar("T")


class Came(NamedTuple, Generic[T]):
    """An object that has come: its stamp, if it had one, and when it came (s, robot's clock)."""

    value: T
    stamp: Stamp | None
    at: float


class Newest(Generic[T]):
    """A port that keeps the newest object of a stream. What is no such object costs its sender the connection.

    ``timeout`` is the age, in s of the robot's clock, from which on an object is too old to be acted upon. ``lazily``:
    messages as long as the last that made sense are read when somebody asks for them, all others as they come; it is
    for short ones. Raises DeviceError when the port cannot be opened.
    """

    def __init__(self, name: str, codec: Codec[T], *, timeout: float, network: Network, lazily: bool = False) -> None:
        self.timeout = timeout
        self._codec = codec
        self._network = network
        self._lazily = lazily
        self._usual: int | None = None  # the length of the last message that made sense
        self._came: Came[T] | None = None
        self._unread: tuple[IncomingMessage, float | None] | None = None  # and when it came, see _arrival
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
        """Have a port send here. Raises DeviceError."""
        try:
            remote.connect(self._network, Contact(source), Contact(self.name), carrier)
        except MiddlewareError as error:
            raise DeviceError(f"{source} does not send to {self.name}: {error}; is its robot running?") from error

    def _receive(self, delivery: IncomingMessage) -> None:
        """In the thread of the connection."""
        at = _arrival()
        size = delivery.size
        if self._lazily and size is not None and size == self._usual:
            unread = delivery.kept(), at
            with self._reading:
                self._unread = unread
            return
        came = _came(delivery.read(self._codec), delivery.envelope, at)
        self._usual = size
        with self._reading:
            self._came, self._unread = came, None

    def _read(self) -> Came[T] | None:
        """Read what came last, if nobody has yet. In the thread of whoever asks for it.

        When it is no such object its sender is hung up on, and what came before is the newest.
        """
        with self._reading:
            if self._unread is not None:
                delivery, at = self._unread
                try:
                    self._came = _came(delivery.read(self._codec), delivery.envelope, at)
                except RtfError as error:
                    self._port.remove_input(delivery.sender)
                    self._network.report(f"{self.name}: {delivery.sender} was cut off: {error}")
                self._unread = None
            return self._came

    @property
    def came(self) -> Came[T] | None:
        """What came last."""
        return self._came if self._unread is None else self._read()

    def age(self) -> float | None:
        """How old it is (s); None before the first."""
        came = self.came
        return None if came is None else clock.current().now() - came.at

    def fresh(self) -> Came[T]:
        """What came last. Raises StaleStateError if it is too old, and before the first."""
        came = self.came
        if came is None:
            raise StaleStateError(f"nothing has come to {self.name} yet")
        age = clock.current().now() - came.at
        if age > self.timeout:
            raise StaleStateError(
                f"what came last to {self.name} is {age:.3f} s old, more than the {self.timeout:g} s that are allowed"
            )
        return came

    def close(self) -> None:
        """Close the port."""
        self._port.close()


def _arrival() -> float | None:
    """When a message that arrives now came, by the robot's clock; None where only its stamp can say.

    A simulator's clock is that of the stamps, and asking it here would make this thread one that its time waits for; a
    message without a stamp counts as old there. A real robot's stamps are another machine's time, so there the arrival
    counts.
    """
    time = clock.current()
    return time.now() if isinstance(time, clock.SystemClock) else None


def _came(value: T, envelope: str, at: float | None) -> Came[T]:
    stamp = Stamp.parse(envelope)
    if at is None:
        at = float("-inf") if stamp is None else stamp.time
    return Came(value, stamp, at)
