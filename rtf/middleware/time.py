"""Clocks that come over the network: one that is listened to, and one that is asked.

*The network clock* is YARP's: a port, ``/clock`` by custom, publishes seconds and nanoseconds, and whoever lives by it
waits for its messages. *Lockstep* is ours: time stands still until everybody who takes part waits, and then goes
straight to the earliest moment that somebody waits for. The simulator is its server; it is an RPC port like any other:

=============== =====================================================================================================
``join NAME``   take part; the reply is ``[ok] id now``. The connection is the membership: when it ends, the
                participant has left
``until ID T``  wait until the time is T; the reply is ``[ok] now``, and time goes on while it is awaited
``leave ID``    take part no more
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
from rtf.middleware import remote
from rtf.middleware.buffered import BufferedPort, Received
from rtf.middleware.errors import AddressError, ConnectError, MiddlewareError, PortClosedError
from rtf.middleware.names import Contact
from rtf.middleware.rpc import RpcClient

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.middleware.network import Network

_NANO = 1e-9
_DIGITS = 9
CLOCK_PORT = "/clock"
#: Which clock the robot of this process lives by: ``lockstep:/clock``, or the name of a port that publishes the time.
CLOCK_VARIABLE, YARP_CLOCK_VARIABLE = "RTF_CLOCK", "YARP_CLOCK"
_LOCKSTEP = "lockstep:"
#: How the time is sent: a thousand messages a second for which nobody need wait, each of which says all.
_CARRIER = "fast_tcp"


def clock_from_environment(network: Network, environment: Mapping[str, str] | None = None) -> Clock:
    """The clock that ``RTF_CLOCK`` says, else the port that ``YARP_CLOCK`` says, else the machine's own.

    ``lockstep:/clock`` takes part in a simulator's time, which stands still whenever this process works; to be closed
    when that is over. Raises AddressError for what names no clock, and ConnectError when it is not there.
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
    """The time that a port publishes. Until its first message has come, everybody who asks for the time waits.

    When the time jumps back, as after a restart of a simulator, those who sleep still sleep as long as they wanted to.
    """

    def __init__(self, source: str = CLOCK_PORT, *, network: Network) -> None:
        self.source = source
        self._changed = threading.Condition()
        self._now: float | None = None
        self._jumped = 0.0  # how far the time has jumped back in all
        self._earliest = math.inf  # when the first of those who sleep has to be woken, all jumps counted
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
        """Ask the name server for a connection that lasts: it is made whenever the publisher appears."""
        network.names.command(f'subscribe "tcp:/{self.source}" "{_CARRIER}:/{self._port.name}"')
        if network.names.query(self.source) is not None:
            remote.connect(network, Contact.parse(self.source), Contact.parse(self._port.name), _CARRIER)

    def _heard(self, received: Received[Bottle]) -> None:
        # To the nanosecond: a sum of fractions that is a bit more than the time would let somebody wake up too late.
        time = round(as_int(received.value.get(0)) + as_int(received.value.get(1)) * _NANO, _DIGITS)
        with self._changed:
            if self._now is not None and time < self._now:
                self._jumped += self._now - time
            first = self._now is None
            self._now = time
            # A thousand times a second: nobody is woken only to find that it is too early.
            if first or time + self._jumped >= self._earliest:
                self._earliest = math.inf
                self._changed.notify_all()

    def now(self) -> float:
        with self._changed:
            return self._wait_for_time()

    def _wait_for_time(self) -> float:
        self._changed.wait_for(lambda: self._now is not None or self._closed)
        if self._now is None:
            raise PortClosedError(f"the clock {self.source} was closed before it said what time it is")
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
    """A simulator's time: it goes on while all who take part sleep, as fast as the simulator can.

    The thread that makes it takes part, and each other one that sleeps, on its own. A thread that takes part and
    neither sleeps nor ends keeps the time standing still; it has to ``leave`` when it is done with the robot. Others
    may ask for the time, and are told the latest that somebody here knows.
    """

    def __init__(self, server: str, name: str, *, network: Network) -> None:
        self.server = server
        self.name = name
        self._network = network
        self._local = threading.local()
        self._members: list[_Member] = []
        self._lock = threading.Lock()
        self._left_at = 0.0  # the latest time of those who have left
        self._member()

    def _member(self) -> _Member:
        member: _Member | None = getattr(self._local, "member", None)
        if member is not None and not member.connected:  # a wait was broken off
            self.leave()
            member = None
        if member is None:
            member = self._local.member = _Member(self.server, self.name, self._network)
            with self._lock:
                self._members.append(member)
        return member

    def now(self) -> float:
        """See Clock. It needs no question: the time changes only while those who take part sleep."""
        member: _Member | None = getattr(self._local, "member", None)
        if member is not None:
            return member.now
        with self._lock:
            return max([self._left_at, *(member.now for member in self._members)])

    def sleep(self, seconds: float) -> None:
        """See Clock; messages that were sent before the end of the sleep have been delivered when it returns."""
        if seconds > 0:
            member = self._member()
            member.wait_until(member.now + seconds)

    def leave(self) -> None:
        """Take part no more in this thread; the next sleep joins again."""
        member: _Member | None = getattr(self._local, "member", None)
        if member is not None:
            self._local.member = None
            with self._lock:
                self._members.remove(member)
                self._left_at = max(self._left_at, member.now)
            member.close()

    def close(self) -> None:
        """See Clock: all threads leave."""
        with self._lock:
            members, self._members = self._members, []
        for member in members:
            member.close()


class _Member:
    """One thread that takes part."""

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
    """Why it was refused, by an answer that need not be a clock's; never empty."""
    if not reply:
        return "it gave no answer; has its simulator ended?"
    return as_string(reply.get(1)) or f"it answered {reply.to_text()}, which no clock does"
