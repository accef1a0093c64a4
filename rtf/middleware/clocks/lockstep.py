"""The server of lockstep time: time advances when all participants wait. The simulator is built on it.

The server does not know what happens in time. ``advance(until)`` does that and returns the time reached: everything due
until then has happened, and everything to be published has been delivered. The server's port also publishes the time,
as YARP's clocks do, for programs that follow the time without taking part.

Time advances in the thread of the participant that starts to wait last, which avoids two thread switches. The server's
own thread advances it when there are no participants, and when the time is controlled by commands.

Beside the commands of participants (:mod:`rtf.middleware.clocks.network_clock`) the port answers commands that control
the time: ``pause``, ``continue``, ``step SECONDS`` while paused, ``reset``, and ``participants``.
"""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass
from threading import get_ident
from typing import TYPE_CHECKING

from rtf import clock
from rtf.bottle import Bottle, Vocab, as_float, as_int, as_string
from rtf.middleware.ports.port import Port

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.ports.inputs import Input
    from rtf.middleware.ports.network import Network
    from rtf.middleware.ports.outputs import Output
    from rtf.middleware.wire.incoming_message import IncomingMessage

_OK, _FAIL = Vocab("ok"), Vocab("fail")
_NANOSECONDS = 1_000_000_000
_DIGITS = 9  # YARP's clocks have a resolution of nanoseconds
_LONGEST_STEP = 3600.0
_LISTENING = 5.0


@dataclass(slots=True)
class Participant:
    """A participant: its name for messages, the connection that it joined by, and the time that it waits for."""

    number: int
    name: str
    sender: str
    caller: int  # the thread that serves its connection, as a port name may be reused; 0 for one of this process
    until: float | None = None


class LockstepServer:
    """Serves time at the port ``name``. ``advance`` runs in one thread at a time, while all participants wait.

    ``advance`` returns a time that is not before its argument.

    Without participants time stands still, or advances in steps of ``idle`` seconds. A participant that does not wait
    for ``patience`` seconds of real time, while others do, is reported to ``complain``. ``reset`` is called between two
    calls of ``advance`` when a client requests it; without it the request is refused. An error in either ends the time:
    it is stored as ``broken``, and all who wait get an error reply.
    """

    def __init__(
        self,
        name: str,
        advance: Callable[[float], float],
        *,
        network: Network,
        start: float = 0.0,
        idle: float | None = None,
        patience: float = 10.0,
        complain: Callable[[str], None] | None = None,
        reset: Callable[[], None] | None = None,
    ) -> None:
        self.now = start
        self.broken: BaseException | None = None
        self._advance = advance
        self._idle = idle
        self._reset = reset
        self._patience = patience
        self._complain = complain or network.report
        lock = threading.RLock()
        self._changed = threading.Condition(lock)  # for threads that serve requests
        self._work = threading.Condition(lock)  # for the server's own thread
        self._passing = False  # ``advance`` is running in some thread
        self._stands_since = clock.monotonic()  # the last change, in monotonic time
        self._participants: dict[int, Participant] = {}
        self._next = 1
        self._closed = False
        self._paused = False
        self._step_until: float | None = None
        self._reset_wanted = False
        self._requests = {
            "join": self._join,
            "until": self._until,
            "leave": self._leave,
            "now": self._now,
            "pause": self._pause,
            "continue": self._continue,
            "step": self._step,
            "reset": self._ask_for_reset,
            "participants": self._list_participants,
        }
        self._port = _ClockPort(name, self._answer, self._left, network=network)
        self._thread = threading.Thread(target=self._run, name=f"rtf-lockstep {name}", daemon=True)
        self._thread.start()

    @property
    def name(self) -> str:
        """The name of the server's port."""
        return self._port.name

    @property
    def participants(self) -> tuple[Participant, ...]:
        """The current participants."""
        with self._changed:
            return tuple(self._participants.values())

    @property
    def heard(self) -> bool:
        """Whether any port is connected that receives the time."""
        return bool(self._port.outputs)

    def publish(self, now: float) -> None:
        """Send the time to all connected ports. ``advance`` calls it as often as the time is to be published."""
        seconds, nanoseconds = divmod(round(now * _NANOSECONDS), _NANOSECONDS)
        self._port.write(Bottle([seconds, nanoseconds]))

    def pause(self) -> None:
        """Stop time until ``resume``."""
        with self._changed:
            self._paused = True

    def resume(self) -> None:
        """Let time advance again."""
        with self._changed:
            self._paused = False
            self._step_until = None
            self._wake_all()

    # Participants of this process -------------------------------------------------------------------------------

    def join(self, name: str, sender: str = "", caller: int = 0) -> Participant:
        """Take part: from now on time advances only while ``wait_until`` is called for the participant."""
        with self._changed:
            number, self._next = self._next, self._next + 1
            participant = self._participants[number] = Participant(number, name or sender, sender, caller)
            return participant

    def wait_until(self, participant: Participant, time: float) -> bool:
        """Wait until ``time``; return False if time has ended before."""
        time = round(time, _DIGITS)  # sums of decimal fractions differ from the intended value in the last bit
        with self._changed:
            participant.until = time
            self._stands_since = clock.monotonic()
        self._wait_until(time)
        with self._changed:
            participant.until = None
            return not self._closed

    def leave(self, participant: Participant) -> None:
        """Stop taking part. A second call has no effect."""
        with self._changed:
            self._participants.pop(participant.number, None)
            self._wake_all()

    def close(self) -> None:
        """Stop the server. Participants that wait get an error reply."""
        with self._changed:
            self._closed = True
            self._wake_all()
            self._changed.wait_for(lambda: not self._passing)
        self._port.close()
        self._thread.join()

    # Advancing time -------------------------------------------------------------------------------------------------

    def _run(self) -> None:
        """Run the server's own thread."""
        try:
            while (until := self._wait_for_work()) is not None:
                self._pass(until)
        except BaseException as error:  # noqa: BLE001 - as below
            self._break(error)

    def _wait_for_work(self) -> float | None:
        """Wait until the server's own thread has to advance time. Return up to when, or None at the end."""
        with self._work:
            while not self._closed:
                if self._reset_wanted and not self._passing:
                    assert self._reset is not None
                    self._reset()
                    self._reset_wanted = False
                    self._changed.notify_all()
                until = self._take_turn()
                if until is not None:
                    return until
                if not self._work.wait(self._patience_left() or self._patience):
                    self._name_the_late()
            return None

    def _wait_until(self, time: float) -> None:
        """Wait until ``time`` is reached or the server ends. Advance time in this thread whenever it may."""
        while True:
            with self._changed:
                until = None
                while self.now < time and not self._closed and (until := self._take_turn()) is None:
                    self._changed.wait()
            if until is None:
                return
            self._pass(until)

    def _take_turn(self) -> float | None:
        """Return up to when this thread has to advance time, or None if it may not. The caller holds the lock."""
        if self._passing or self._reset_wanted:
            return None
        until = self._next_moment()
        self._passing = until is not None
        return until

    def _pass(self, until: float) -> None:
        """Advance time in this thread, after ``_take_turn``."""
        try:
            reached = round(self._advance(until), _DIGITS) if until > self.now else self.now
        except BaseException as error:  # noqa: BLE001 - passed on to all participants that wait
            self._break(error)
            return
        with self._changed:
            self._passing = False
            self._stands_since = clock.monotonic()
            self.now = reached
            if self._step_until is not None and reached >= self._step_until:
                self._step_until = None
            self._changed.notify_all()
            if self._reset_wanted or self._paused or not self._participants:
                self._work.notify()

    def _break(self, error: BaseException) -> None:
        """End the time after an error."""
        with self._changed:
            self._passing = False
            self.broken = error
            self._closed = True
            self._wake_all()
        self._complain(f"time ends at {self.now:.6g} s: {type(error).__name__}: {error}")

    def _wake_all(self) -> None:
        """Wake all threads to check their conditions. The caller holds the lock."""
        self._stands_since = clock.monotonic()
        self._changed.notify_all()
        self._work.notify()

    def _next_moment(self) -> float | None:
        """Return up to when time may advance, or None if it may not."""
        if self._paused:
            return self._step_until
        waiting = [one.until for one in self._participants.values()]
        if not waiting:
            return None if self._idle is None else round(self.now + self._idle, _DIGITS)
        wanted = [until for until in waiting if until is not None and until > self.now]
        return min(wanted) if len(wanted) == len(waiting) else None

    def _patience_left(self) -> float:
        """Return the seconds that are left until a late participant is reported."""
        return max(0.0, self._patience - (clock.monotonic() - self._stands_since))

    def _name_the_late(self) -> None:
        if self._passing or self._patience_left():
            return
        late = [one.name for one in self._participants.values() if one.until is None]
        if late and len(late) < len(self._participants):
            self._complain(f"time stands still at {self.now:.6g} s: {', '.join(late)} does not wait for the time")

    # Requests, each in the thread of its connection -------------------------------------------------------------

    def _answer(self, delivery: IncomingMessage) -> None:
        request = delivery.read()
        word = as_string(request.get(0))
        asked = self._requests.get(word)
        if asked is None:
            delivery.reply(Bottle([_FAIL, f"{word!r} is not one of {', '.join(self._requests)}"]))
        else:
            delivery.reply(asked(request, delivery.sender))

    def _join(self, request: Bottle, sender: str) -> Bottle:
        with self._changed:
            return Bottle([_OK, self.join(as_string(request.get(1)), sender, get_ident()).number, self.now])

    def _until(self, request: Bottle, sender: str) -> Bottle:
        time = as_float(request.get(2))
        with self._changed:
            participant = self._participants.get(as_int(request.get(1)))
            if participant is None or participant.sender != sender:
                return Bottle([_FAIL, "join first"])
        if not math.isfinite(time):
            return Bottle([_FAIL, f"{time} is not a time"])
        if not self.wait_until(participant, time):
            return Bottle([_FAIL, "the clock was closed" if self.broken is None else f"time ended: {self.broken}"])
        return Bottle([_OK, self.now])

    def _leave(self, request: Bottle, sender: str) -> Bottle:
        with self._changed:
            participant = self._participants.get(as_int(request.get(1)))
            if participant is not None and participant.sender == sender:
                self.leave(participant)
        return Bottle([_OK])

    def _now(self, _request: Bottle, _sender: str) -> Bottle:
        return Bottle([_OK, self.now])

    def _pause(self, _request: Bottle, _sender: str) -> Bottle:
        self.pause()
        return Bottle([_OK, self.now])

    def _continue(self, _request: Bottle, _sender: str) -> Bottle:
        self.resume()
        return Bottle([_OK, self.now])

    def _step(self, request: Bottle, _sender: str) -> Bottle:
        """Advance a paused time by a number of seconds, whether or not participants wait for it."""
        seconds = as_float(request.get(1))
        with self._changed:
            if not self._paused:
                return Bottle([_FAIL, "pause first"])
            if not 0 < seconds <= _LONGEST_STEP:
                return Bottle([_FAIL, f"a step is from 0 to {_LONGEST_STEP:g} seconds, not {seconds:g}"])
            until = self._step_until = round(self.now + seconds, _DIGITS)
            self._wake_all()
            self._changed.wait_for(lambda: self.now >= until or self._closed or not self._paused)
            return Bottle([_OK, self.now])

    def _ask_for_reset(self, _request: Bottle, _sender: str) -> Bottle:
        if self._reset is None:
            return Bottle([_FAIL, "there is nothing to reset"])
        with self._changed:
            self._reset_wanted = True
            self._wake_all()
            self._changed.wait_for(lambda: not self._reset_wanted or self._closed)
            return Bottle([_OK, self.now])

    def _list_participants(self, _request: Bottle, _sender: str) -> Bottle:
        """Return the name of each participant and what it waits for: a time, or the word ``works``."""
        with self._changed:
            people = [Bottle([one.name, "works" if one.until is None else one.until]) for one in self.participants]
            return Bottle([_OK, *people])

    def _left(self) -> None:
        """Remove the participants of a connection that ended. Runs in the thread that served it."""
        with self._changed:
            self._participants = {key: one for key, one in self._participants.items() if one.caller != get_ident()}
            self._wake_all()


class _ClockPort(Port):
    """The port of the server, which notices closed connections."""

    def __init__(
        self, name: str, answer: Callable[[IncomingMessage], None], gone: Callable[[], None], *, network: Network
    ) -> None:
        self._gone = gone
        super().__init__(name, answer, network=network)

    def connected(self, output: Output) -> None:
        """Limit how long the server waits for a slow receiver of the time."""
        output.link.limit_waiting(_LISTENING)

    def input_closed(self, caller: Input) -> None:
        super().input_closed(caller)
        self._gone()
