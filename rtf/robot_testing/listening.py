"""Listening to ports: every message that comes, with its stamp, its arrival, its size and a digest of what it holds.

A :class:`PortRecorder` listens to one port and a :class:`Listener` to many at once. Nothing is skipped: each message is
taken in the thread of its connection, and what it means is found out afterwards (:mod:`rtf.robot_testing.streams`).
"""

from __future__ import annotations

import math
import zlib
from contextlib import ExitStack
from typing import TYPE_CHECKING, NamedTuple, Self

from rtf.errors import RtfError
from rtf.middleware import remote
from rtf.middleware.codecs import TextCodec
from rtf.middleware.names import Contact
from rtf.middleware.port import Port
from rtf.middleware.time import LockstepClock
from rtf.middleware.types import Stamp
from rtf.robot_testing.lateness import Waiting

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.bottle import Dialect
    from rtf.clock import Clock
    from rtf.middleware.carriers.base import Buffer
    from rtf.middleware.incoming_message import IncomingMessage
    from rtf.middleware.network import Network

#: Seconds of the robot's time between two looks. In lockstep that is how exactly arrivals are known; elsewhere it only
#: shows how late this process itself is woken.
_STEP_IN_LOCKSTEP, _STEP = 0.002, 0.005
#: Likewise, where nobody wants to know about arrivals: in lockstep each look costs machine time.
_LONG_STEP = 0.05
#: Being woken later than this, s, is a hiccup.
_HICCUP = 0.02
#: Bytes that a recorder keeps of what it is told to keep; a camera's pictures are not meant to be kept.
_MOST_KEPT = 1 << 28


class _RawCodec(TextCodec[bytes]):
    """The bytes of a message as they are."""

    def encode(self, value: bytes, dialect: Dialect) -> Sequence[Buffer]:  # noqa: ARG002 - the same in both
        return (value,)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[bytes, int]:  # noqa: ARG002
        return bytes(data), len(data)


_RAW = _RawCodec()


class Message(NamedTuple):
    """A message: its number and the time in its stamp (-1 and NaN without one), when it came, how large it was.

    Times are of the robot's clock, in s. ``digest`` is equal for equal contents. ``content`` is what the recorder's
    ``look`` made of the bytes, or the bytes, or None.
    """

    number: int
    time: float
    arrival: float
    size: int
    digest: int
    content: object

    @property
    def data(self) -> bytes:
        """The bytes; none where they were not kept."""
        return self.content if isinstance(self.content, bytes) else b""

    @property
    def moment(self) -> float:
        """The time of the stamp; without one that of the arrival."""
        return self.arrival if math.isnan(self.time) else self.time


class PortRecorder:
    """Listens to one port, from ``connect`` until ``close``.

    ``now`` says when a message comes. ``keep`` keeps the bytes of the messages; ``look`` is called with them instead,
    in the thread of the connection, and what it returns is kept. What it cannot make sense of (RtfError, ValueError)
    is told in ``problems``.
    """

    def __init__(
        self,
        source: str,
        *,
        network: Network,
        now: Callable[[], float],
        keep: bool = False,
        look: Callable[[bytes], object] | None = None,
    ) -> None:
        self.source = source
        self.messages: list[Message] = []
        self.problems: list[str] = []
        self._network = network
        self._now = now
        self._keep = keep
        self._look = look
        self._kept = 0
        self._port = Port("", self._receive, network=network, outputs=False)

    def connect(self, carrier: str) -> None:
        """Begin. Raises MiddlewareError where nobody publishes under that name."""
        remote.connect(self._network, Contact.parse(self.source), Contact.parse(self._port.name), carrier)

    def _receive(self, delivery: IncomingMessage) -> None:
        data = delivery.read(_RAW)
        stamp = Stamp.parse(delivery.envelope) or Stamp(time=math.nan)
        content = self._content(data)
        self.messages.append(Message(stamp.count, stamp.time, self._now(), len(data), zlib.crc32(data), content))

    def _content(self, data: bytes) -> object:
        if self._look is not None:
            try:
                return self._look(data)
            except (RtfError, ValueError) as error:
                self.problems.append(str(error))
                return None
        self._kept += len(data)
        return data if self._keep and self._kept <= _MOST_KEPT else None

    def close(self) -> None:
        """Hang up."""
        self._port.close()


class Listener:
    """Listens to many ports at the same time; ``clock`` is the robot's. For one thread, that of the test.

    In lockstep connections are made by tcp, whose sender waits until a message has come, so that nothing can be lost on
    the way and everything that was sent before the end of ``listen`` has come when it returns.
    """

    def __init__(self, network: Network, clock: Clock) -> None:
        self.recorders: dict[str, PortRecorder] = {}
        #: By how much longer than wanted this process slept at each step, s of the robot's time.
        self.late: list[float] = []
        #: How fast the robot's time passed meanwhile, in its seconds a second; 1 in lockstep, where it says nothing.
        self.factor = 1.0
        #: The share of that time in which something on this machine waited for a processor; 0 in lockstep, likewise.
        self.waiting = 0.0
        self._network = network
        self._clock = clock
        #: Whether arrivals are known exactly, for nothing passes while this process works.
        self.exact = isinstance(clock, LockstepClock)
        self._moment: float | None = None
        self._opened = ExitStack()

    def _now(self) -> float:
        # In lockstep a message that comes during a step belongs to the step's end, which the clock does not know yet.
        moment = self._moment
        return self._clock.now() if moment is None else moment

    def add(self, source: str, *, keep: bool = False, look: Callable[[bytes], object] | None = None) -> PortRecorder:
        """Listen to one more port; arguments and errors as for :class:`PortRecorder`."""
        recorder = PortRecorder(source, network=self._network, now=self._now, keep=keep, look=look)
        try:
            recorder.connect("tcp" if self.exact else "fast_tcp")
        except RtfError:
            recorder.close()
            raise
        self._opened.callback(recorder.close)
        self.recorders[source] = recorder
        return recorder

    def listen(self, seconds: float, *, arrivals: bool = True) -> None:
        """Let the robot's time pass; without ``arrivals`` it is not known exactly when messages came."""
        clock, step = self._clock, _STEP_IN_LOCKSTEP if self.exact else _STEP
        if not arrivals:
            step = _LONG_STEP
        waiting, begin = Waiting(), clock.now()
        now, end = begin, begin + seconds
        while now < end - 1e-9:
            wanted = min(step, end - now)
            if self.exact:
                self._moment = now + wanted
            clock.sleep(wanted)
            before, now = now, clock.now()
            self.late.append(now - before - wanted)
        self._moment = None
        took = waiting.seconds
        if not self.exact and took > 0:
            self.factor = (now - begin) / took
            self.waiting = waiting.share()

    @property
    def stalled(self) -> float:
        """The seconds of the robot's time in which this process did not run, though it should have: hiccups together.

        On a machine that is so loaded senders skip messages, too.
        """
        return sum(late for late in self.late if late > _HICCUP)

    def close(self) -> None:
        """Hang up everywhere."""
        self._opened.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
