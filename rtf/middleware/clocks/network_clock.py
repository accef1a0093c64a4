"""Clocks over the network: one that receives published time, and one that takes part in lockstep.

*The network clock* is YARP's: a port, ``/clock`` by convention, publishes seconds and nanoseconds, and its receivers
follow them. *Lockstep* is ours: time stands still until all participants wait, and then goes straight to the earliest
moment that one of them waits for. The simulator is its server, on an RPC port with these commands:

=============== =====================================================================================================
``join NAME``   take part; the reply is ``[ok] id now``. The membership lasts as long as the connection: when that
                ends, the participant has left
``until ID T``  wait until the time is T; the reply is ``[ok] now``, and time advances while the reply is awaited
``leave ID``    stop taking part
``now``         ``[ok] now``
=============== =====================================================================================================
"""

from __future__ import annotations

import math
import os
import socket
import sys
import threading
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Vocab, as_float, as_int, as_string
from rtf.clock import Clock, SystemClock
from rtf.middleware.errors import AddressError, ConnectError, MiddlewareError, PortClosedError
from rtf.middleware.ports import remote
from rtf.middleware.ports.buffered import BufferedPort, Received
from rtf.middleware.ports.rpc import RpcClient
from rtf.middleware.wire.contact import Contact

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.middleware.ports.network import Network

_NANO = 1e-9
_DIGITS = 9
CLOCK_PORT = "/clock"
#: The clock of this process's robot: ``lockstep:/clock``, or the name of a port that publishes the time.
CLOCK_VARIABLE, YARP_CLOCK_VARIABLE = "RTF_CLOCK", "YARP_CLOCK"
_LOCKSTEP = "lockstep:"
#: The carrier of the time: a thousand messages a second, each complete, for which no one has to wait.
_CARRIER = "fast_tcp"


def clock_from_environment(network: Network, environment: Mapping[str, str] | None = None) -> Clock:
    """Return the clock of ``RTF_CLOCK``, else of the port in ``YARP_CLOCK``, else the machine's own.

    ``lockstep:/clock`` takes part in a simulator's time, which stands still while this process works; the caller closes
    the clock at the end. Raises AddressError for an invalid value, and ConnectError if the clock is not there.
    """
    given = os.environ if environment is None else environment
    text = given.get(CLOCK_VARIABLE) or given.get(YARP_CLOCK_VARIABLE, "")
    if not text:
        return SystemClock()
    name = text.removeprefix(_LOCKSTEP)
    if not name.startswith("/"):
        raise AddressError(f"{CLOCK_VARIABLE} is {text!r}; write lockstep:/clock, or /clock, or nothing")
    if name == text:
        return NetworkClock(name, network=network)
    return LockstepClock(name, f"process {os.getpid()}", network=network)


class NetworkClock(Clock):
    """The time that a port publishes. Until its first message arrives, every call waits.

    When the time jumps back, as after a restart of a simulator, a sleep still lasts as long as requested.
    """

    def __init__(self, source: str = CLOCK_PORT, *, network: Network) -> None:
        self.source = source
        self._changed = threading.Condition()
        self._now: float | None = None
        self._jumped = 0.0  # the sum of all backward jumps
        self._earliest = math.inf  # the first wake-up time of all sleepers, jumps included
        self._closed = False
        program = sys.argv[0] if sys.argv else ""
        name = f"/{socket.gethostname()}/{program}/{os.getpid()}/clock:i"
        self._port = BufferedPort(name, callback=self._heard, network=network, outputs=False)
        try:
            self._subscribe(network)
        except MiddlewareError:
            self._port.close()
            raise

    def _subscribe(self, network: Network) -> None:
        """Ask the name server for a persistent connection: it is made whenever the publisher appears."""
        network.names.command(f'subscribe "tcp:/{self.source}" "{_CARRIER}:/{self._port.name}"')
        if network.names.query(self.source) is not None:
            remote.connect(network, Contact.parse(self.source), Contact.parse(self._port.name), _CARRIER)

    def _heard(self, received: Received[Bottle]) -> None:
        # Rounded to the nanosecond: a rounding error above the exact time would wake a sleeper one message late.
        time = round(as_int(received.value.get(0)) + as_int(received.value.get(1)) * _NANO, _DIGITS)
        with self._changed:
            if self._now is not None and time < self._now:
                self._jumped += self._now - time
            first = self._now is None
            self._now = time
            # A thousand times a second: sleepers are woken only when one of them is due.
            if first or time + self._jumped >= self._earliest:
                self._earliest = math.inf
                self._changed.notify_all()

    def now(self) -> float:
        with self._changed:
            return self._wait_for_time()

    def _wait_for_time(self) -> float:
        self._changed.wait_for(lambda: self._now is not None or self._closed)
        if self._now is None:
            raise PortClosedError(f"the clock {self.source} was closed before its first message")
        return self._now

    def sleep(self, seconds: float) -> None:
        if seconds <= 0:
            return
        with self._changed:
            end = self._wait_for_time() + self._jumped + seconds
            while not self._closed and self._wait_for_time() + self._jumped < end:
                self._earliest = min(self._earliest, end)
                self._changed.wait()

    def close(self) -> None:
        with self._changed:
            if self._closed:
                return
            self._closed = True
            self._changed.notify_all()
        self._port.close()


class LockstepClock(Clock):
    """A simulator's time: it advances while all participants sleep, as fast as the simulator can.

    The thread that creates the clock takes part, and so does every other thread that sleeps. A participating thread
    that neither sleeps nor ends stops the time; it has to ``leave`` when it is done with the robot. Other threads may
    read the time, and get the latest that any thread of this clock knows.
    """

    def __init__(self, server: str, name: str, *, network: Network) -> None:
        self.server = server
        self.name = name
        self._network = network
        self._local = threading.local()
        self._members: list[_Member] = []
        self._lock = threading.Lock()
        self._left_at = 0.0  # the latest time of threads that have left
        self._closed = False
        self._member()

    def _member(self) -> _Member:
        member: _Member | None = getattr(self._local, "member", None)
        if member is not None and not member.connected:  # a wait was interrupted
            self.leave()
            member = None
        if member is None:
            member = self._local.member = _Member(self.server, self.name, self._network)
            with self._lock:
                self._members.append(member)
                closed = self._closed
            if closed:
                self.leave()
                raise PortClosedError(f"the clock {self.server} is closed")
        return member

    def now(self) -> float:
        """Return the time. It needs no request: the time changes only while all participants sleep."""
        member: _Member | None = getattr(self._local, "member", None)
        if member is not None:
            return member.now
        with self._lock:
            return max([self._left_at, *(member.now for member in self._members)])

    def sleep(self, seconds: float) -> None:
        """Sleep. When it returns, messages sent before the end of the sleep have been delivered."""
        if seconds > 0:
            member = self._member()
            member.wait_until(member.now + seconds)

    def leave(self) -> None:
        """Stop taking part in this thread; the next sleep joins again."""
        member: _Member | None = getattr(self._local, "member", None)
        if member is not None:
            self._local.member = None
            with self._lock:
                if member in self._members:  # as long as the clock is not closed
                    self._members.remove(member)
                self._left_at = max(self._left_at, member.now)
            member.close()

    def close(self) -> None:
        """End the participation of all threads."""
        with self._lock:
            self._closed = True
            members, self._members = self._members, []
        for member in members:
            member.close()


class _Member:
    """The membership of one thread."""

    def __init__(self, server: str, name: str, network: Network) -> None:
        self._client = RpcClient("", server, network=network)
        try:
            reply = self._ask("join", name)
        except MiddlewareError:
            self._client.close()
            raise
        self._id = as_int(reply.get(1))
        self.now = as_float(reply.get(2))

    @property
    def connected(self) -> bool:
        return bool(self._client.outputs)

    def wait_until(self, time: float) -> None:
        self.now = as_float(self._ask("until", self._id, time).get(1))

    def _ask(self, *words: object) -> Bottle:
        reply = self._client.call(Bottle(words))
        if reply is None or reply.get(0) != Vocab("ok"):
            raise ConnectError(f"the clock refused {words[0]!r}: {_reason(reply)}")
        return reply

    def close(self) -> None:
        self._client.close()


def _reason(reply: Bottle | None) -> str:
    """Return the reason of a refusal. The reply may come from something other than a clock. Never empty."""
    if not reply:
        return "there was no reply; has its simulator ended?"
    return as_string(reply.get(1)) or f"{reply.to_text()} is not the reply of a clock"
