"""Recording of ports: every message with its stamp, its arrival time, its size and a digest of its content.

A :class:`PortRecorder` records one port and a :class:`Listener` many at once. Each message is recorded in the thread of
its connection, so none is skipped; :mod:`rtf.robot_testing.streams.stream_statistics` evaluates them afterwards.
"""

from __future__ import annotations

import math
import zlib
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING, Protocol, Self

from rtf.errors import RtfError
from rtf.middleware.clocks.network_clock import LockstepClock
from rtf.middleware.ports import remote
from rtf.middleware.ports.port import Port
from rtf.middleware.types import Stamp
from rtf.middleware.types.codecs import BOTTLE, RAW
from rtf.middleware.wire.contact import Contact
from rtf.robot_testing.judging.real_time_checks import CpuPressure
from rtf.robot_testing.streams.message import Message

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.clock import Clock
    from rtf.middleware.ports.network import Network
    from rtf.middleware.wire.incoming_message import IncomingMessage

#: Seconds of the robot's time between two steps. In lockstep this is the resolution of arrival times; otherwise it only
#: measures how late this process is woken.
_STEP_IN_LOCKSTEP, _STEP = 0.002, 0.005
#: The step if arrival times are not needed: in lockstep each step costs machine time.
_LONG_STEP = 0.05
#: A wake-up that is later than this, s, is a stall.
_STALL = 0.02
#: Most bytes that a recorder keeps; the pictures of a camera are not meant to be kept.
_MOST_KEPT = 1 << 28


class PortRecorder:
    """Recorder of one port, from ``connect`` until ``close``.

    ``now`` returns the arrival time. With ``keep`` the bytes of the messages are kept. With ``look`` its results are
    kept instead: it is called with the bytes in the thread of the connection. Its errors (RtfError, ValueError) are
    collected in ``problems``.
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
        """Connect to the port. Raises MiddlewareError if there is no such port."""
        remote.connect(self._network, Contact.parse(self.source), Contact.parse(self._port.name), carrier)

    def _receive(self, delivery: IncomingMessage) -> None:
        data = delivery.read(RAW)
        stamp = Stamp.parse(delivery.envelope) or Stamp(time=math.nan)
        content, now = self._content(data), self._now()
        if self._keep:
            with suppress(RtfError):  # finds out the dialect of the connection; what is wrong shows when it is used
                delivery.read(BOTTLE)
        self.messages.append(
            Message(stamp.count, stamp.time, now, len(data), zlib.crc32(data), content, delivery.dialect)
        )

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
        """Close the connection."""
        self._port.close()


class Recorder(Protocol):
    """The recorder of a stream."""

    messages: list[Message]
    problems: list[str]

    def close(self) -> None:
        """End the recording."""


class Listener:
    """Recorder of many ports at the same time; ``clock`` is the robot's. For one thread, that of the test.

    In lockstep the carrier is tcp, whose sender waits for the acknowledgement: all messages sent before the end of
    ``listen`` have arrived when it returns.
    """

    def __init__(self, network: Network, clock: Clock) -> None:
        self.recorders: dict[str, Recorder] = {}
        #: By how much each sleep of this process was too long, s of the robot's time.
        self.late: list[float] = []
        #: Real-time factor of the robot's clock during ``listen``; 1 in lockstep, where it has no meaning.
        self.factor = 1.0
        #: CPU pressure of this machine during ``listen``, a share of time; 0 in lockstep, where it has no effect.
        self.cpu_pressure = 0.0
        self._network = network
        self._clock = clock
        #: Whether arrival times are exact, as the robot's time stands still while this process works.
        self.exact = isinstance(clock, LockstepClock)
        self._moment: float | None = None
        self._opened = ExitStack()

    def _now(self) -> float:
        # In lockstep a message that arrives during a step belongs to its end, which the clock does not show yet.
        moment = self._moment
        return self._clock.now() if moment is None else moment

    def add(self, source: str, *, keep: bool = False, look: Callable[[bytes], object] | None = None) -> PortRecorder:
        """Record one more port; arguments and errors as for :class:`PortRecorder`."""
        recorder = PortRecorder(source, network=self._network, now=self._now, keep=keep, look=look)
        try:
            recorder.connect("tcp" if self.exact else "fast_tcp")
        except RtfError:
            recorder.close()
            raise
        self._opened.callback(recorder.close)
        self.recorders[source] = recorder
        return recorder

    def add_topic(self, topic: str, report: Callable[[str], None]) -> None:
        """Record a topic of ROS 2 in the domain of ROS_DOMAIN_ID. Raises RtfError."""
        try:
            from rtf.robot_testing.streams.topic_recorder import TopicRecorder
        except ImportError as error:
            raise RtfError(f"topics of ROS 2 need the package cyclonedds: pip install 'rtf[dds]' ({error})") from error
        recorder = TopicRecorder(topic, now=self._now, report=report)
        self._opened.callback(recorder.close)
        self.recorders[topic] = recorder

    def listen(self, seconds: float, *, arrivals: bool = True) -> None:
        """Record for ``seconds`` of the robot's time; without ``arrivals`` arrival times are less exact in lockstep."""
        clock, step = self._clock, _STEP_IN_LOCKSTEP if self.exact else _STEP
        if not arrivals:
            step = _LONG_STEP
        pressure, begin = CpuPressure(), clock.now()
        now, end = begin, begin + seconds
        while now < end - 1e-9:
            wanted = min(step, end - now)
            if self.exact:
                self._moment = now + wanted
            clock.sleep(wanted)
            before, now = now, clock.now()
            self.late.append(now - before - wanted)
        self._moment = None
        took = pressure.seconds
        if not self.exact and took > 0:
            self.factor = (now - begin) / took
            self.cpu_pressure = pressure.share()

    @property
    def stalled(self) -> float:
        """The sum of the stalls of this process, s of the robot's time.

        On a machine with stalls senders skip messages, too.
        """
        return sum(late for late in self.late if late > _STALL)

    def close(self) -> None:
        """Close all connections."""
        self._opened.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
