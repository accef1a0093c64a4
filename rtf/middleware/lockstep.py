"""The server of lockstep time: it lets time pass when everybody waits. The simulator is built on it.

It knows nothing of what happens in time; ``advance(until)`` does that, and returns how far it came: everything that was
to happen up to then has happened, and everything that was to be published has been delivered. Its port also publishes
the time, as YARP's clocks do, for those who live by it without taking part.

Whoever is the last to wait lets time pass in the thread that serves it, which saves it from being handed to another
thread and back. The server's own thread does so when nobody takes part, and when the time is directed.

Beside what takes part (:mod:`rtf.middleware.time`) it answers those who direct the time: ``pause``, ``continue``,
``step SECONDS`` while it is paused, ``reset``, and ``participants``.
"""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass
from threading import get_ident
from typing import TYPE_CHECKING

from rtf import clock
from rtf.bottle import Bottle, Vocab, as_float, as_int, as_string
from rtf.middleware.port import Port

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.delivery import Delivery
    from rtf.middleware.inputs import Input
    from rtf.middleware.network import Network
    from rtf.middleware.outputs import Output

_OK, _FAIL = Vocab("ok"), Vocab("fail")
_NANOSECONDS = 1_000_000_000
_DIGITS = 9  # nanoseconds are the finest that YARP's clocks tell
_LONGEST_STEP = 3600.0
_LISTENING = 5.0


@dataclass(slots=True)
class Participant:
    """Somebody who takes part: a name for people, the connection that stands for it, and the moment it waits for."""

    name: str
    sender: str
    caller: int  # the thread that serves its connection; names may soon be somebody else's
    until: float | None = None


class LockstepServer:
    """Serves time at the port ``name``. ``advance`` is called in one thread at a time, while all participants wait.

    It returns a time that is not before the one it was given.

    When nobody takes part time stands still, or goes on in steps of ``idle`` seconds. A participant that does not wait
    for ``patience`` seconds of the machine's time, while others do, is told of by ``complain``. ``reset`` is called
    between two of its calls when somebody asks for it; without it that is refused. An error in either ends the time:
    it is kept as ``broken``, and those who wait are told.
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
        self._changed = threading.Condition(lock)  # for those who ask
        self._work = threading.Condition(lock)  # for the thread of the server
        self._passing = False  # time passes now, in some thread
        self._stands_since = clock.monotonic()  # since when nothing has changed
        self._participants: dict[int, Participant] = {}
        self._next = 1
        self._closed = False
        self._paused = False
        self._step_until: float | None = None
        self._reset_wanted = False
        self._questions = {
            "join": self._join,
            "until": self._until,
            "leave": self._leave,
            "now": self._now,
            "pause": self._pause,
            "continue": self._continue,
            "step": self._step,
            "reset": self._ask_for_reset,
            "participants": self._tell_participants,
        }
        self._port = _ClockPort(name, self._answer, self._left, network=network)
        self._thread = threading.Thread(target=self._run, name=f"rtf-lockstep {name}", daemon=True)
        self._thread.start()

    @property
    def name(self) -> str:
        """The name of its port."""
        return self._port.name

    @property
    def participants(self) -> tuple[Participant, ...]:
        """Who takes part."""
        with self._changed:
            return tuple(self._participants.values())

    @property
    def heard(self) -> bool:
        """Whether somebody is connected who wants to be sent the time."""
        return bool(self._port.outputs)

    def publish(self, now: float) -> None:
        """Send the time to those who are connected; to be called while time passes, as often as it is to be heard."""
        seconds, nanoseconds = divmod(round(now * _NANOSECONDS), _NANOSECONDS)
        self._port.write(Bottle([seconds, nanoseconds]))

    def pause(self) -> None:
        """Let no time pass until ``resume``."""
        with self._changed:
            self._paused = True

    def resume(self) -> None:
        """Let time pass again."""
        with self._changed:
            self._paused = False
            self._tell_all()

    def close(self) -> None:
        """Be done; those who wait are refused."""
        with self._changed:
            self._closed = True
            self._tell_all()
            self._changed.wait_for(lambda: not self._passing)
        self._port.close()
        self._thread.join()

    # Time passes ----------------------------------------------------------------------------------------------------

    def _run(self) -> None:
        """In the thread of the server."""
        try:
            while (until := self._wait_for_work()) is not None:
                self._pass(until)
        except BaseException as error:  # noqa: BLE001 - as below
            self._break(error)

    def _wait_for_work(self) -> float | None:
        """Wait until time may pass in the thread of the server; returns up to when, or None at the end."""
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
        """Wait until it is so late, or the end; let time pass meanwhile whenever it may."""
        while True:
            with self._changed:
                until = None
                while self.now < time and not self._closed and (until := self._take_turn()) is None:
                    self._changed.wait()
            if until is None:
                return
            self._pass(until)

    def _take_turn(self) -> float | None:
        """Up to when time may pass now, in the thread that asks, which then has to do it. With the lock."""
        if self._passing or self._reset_wanted:
            return None
        until = self._next_moment()
        self._passing = until is not None
        return until

    def _pass(self, until: float) -> None:
        """Let time pass in this thread, which has taken its turn."""
        try:
            reached = round(self._advance(until), _DIGITS) if until > self.now else self.now
        except BaseException as error:  # noqa: BLE001 - whoever waits must hear of it, and nobody else would
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
        """Time has ended."""
        with self._changed:
            self._passing = False
            self.broken = error
            self._closed = True
            self._tell_all()
        self._complain(f"time ends at {self.now:.6g} s: {type(error).__name__}: {error}")

    def _tell_all(self) -> None:
        """Have everybody look what there is to do. With the lock."""
        self._stands_since = clock.monotonic()
        self._changed.notify_all()
        self._work.notify()

    def _next_moment(self) -> float | None:
        """Up to when time may pass now."""
        if self._paused:
            return self._step_until
        waiting = [one.until for one in self._participants.values()]
        if not waiting:
            return None if self._idle is None else round(self.now + self._idle, _DIGITS)
        wanted = [until for until in waiting if until is not None and until > self.now]
        return min(wanted) if len(wanted) == len(waiting) else None

    def _patience_left(self) -> float:
        """For how long time may still stand (s)."""
        return max(0.0, self._patience - (clock.monotonic() - self._stands_since))

    def _name_the_late(self) -> None:
        if self._passing or self._patience_left():
            return
        late = [one.name for one in self._participants.values() if one.until is None]
        if late and len(late) < len(self._participants):
            self._complain(f"time stands still at {self.now:.6g} s: {', '.join(late)} does not wait for it")

    # Questions, each in the thread of who asks ------------------------------------------------------------------

    def _answer(self, delivery: Delivery) -> None:
        question = delivery.read()
        word = as_string(question.get(0))
        asked = self._questions.get(word)
        if asked is None:
            delivery.reply(Bottle([_FAIL, f"{word!r} is none of {', '.join(self._questions)}"]))
        else:
            delivery.reply(asked(question, delivery.sender))

    def _join(self, question: Bottle, sender: str) -> Bottle:
        with self._changed:
            number, self._next = self._next, self._next + 1
            self._participants[number] = Participant(as_string(question.get(1)) or sender, sender, get_ident())
            return Bottle([_OK, number, self.now])

    def _until(self, question: Bottle, sender: str) -> Bottle:
        # Sums of decimal fractions differ from them in the last bit; nobody means that.
        time = round(as_float(question.get(2)), _DIGITS)
        with self._changed:
            participant = self._participants.get(as_int(question.get(1)))
            if participant is None or participant.sender != sender:
                return Bottle([_FAIL, "join first"])
            if not math.isfinite(time):
                return Bottle([_FAIL, f"{time} is no time"])
            participant.until = time
            self._stands_since = clock.monotonic()
        self._wait_until(time)
        with self._changed:
            participant.until = None
            if self._closed:
                return Bottle([_FAIL, "the clock was closed" if self.broken is None else f"time ended: {self.broken}"])
            return Bottle([_OK, self.now])

    def _leave(self, question: Bottle, sender: str) -> Bottle:
        with self._changed:
            number = as_int(question.get(1))
            participant = self._participants.get(number)
            if participant is not None and participant.sender == sender:
                del self._participants[number]
            self._tell_all()
        return Bottle([_OK])

    def _now(self, _question: Bottle, _sender: str) -> Bottle:
        return Bottle([_OK, self.now])

    def _pause(self, _question: Bottle, _sender: str) -> Bottle:
        self.pause()
        return Bottle([_OK, self.now])

    def _continue(self, _question: Bottle, _sender: str) -> Bottle:
        self.resume()
        return Bottle([_OK, self.now])

    def _step(self, question: Bottle, _sender: str) -> Bottle:
        """Let so much time pass while it is paused; it need not be waited for."""
        seconds = as_float(question.get(1))
        with self._changed:
            if not self._paused:
                return Bottle([_FAIL, "pause first"])
            if not 0 < seconds <= _LONGEST_STEP:
                return Bottle([_FAIL, f"a step is from 0 to {_LONGEST_STEP:g} seconds, not {seconds:g}"])
            until = self._step_until = round(self.now + seconds, _DIGITS)
            self._tell_all()
            self._changed.wait_for(lambda: self.now >= until or self._closed or not self._paused)
            return Bottle([_OK, self.now])

    def _ask_for_reset(self, _question: Bottle, _sender: str) -> Bottle:
        if self._reset is None:
            return Bottle([_FAIL, "there is nothing to reset"])
        with self._changed:
            self._reset_wanted = True
            self._tell_all()
            self._changed.wait_for(lambda: not self._reset_wanted or self._closed)
            return Bottle([_OK, self.now])

    def _tell_participants(self, _question: Bottle, _sender: str) -> Bottle:
        """The name of each, and what it waits for: a time, or the word ``works``."""
        with self._changed:
            people = [Bottle([one.name, "works" if one.until is None else one.until]) for one in self.participants]
            return Bottle([_OK, *people])

    def _left(self) -> None:
        """A connection is gone, and with it whoever it stood for. In the thread that served it."""
        with self._changed:
            self._participants = {key: one for key, one in self._participants.items() if one.caller != get_ident()}
            self._tell_all()


class _ClockPort(Port):
    """The port of the server: it notices who hangs up."""

    def __init__(
        self, name: str, answer: Callable[[Delivery], None], gone: Callable[[], None], *, network: Network
    ) -> None:
        self._gone = gone
        super().__init__(name, answer, network=network)

    def connected(self, output: Output) -> None:
        """See Port: time does not wait long for who listens to it."""
        output.link.limit_waiting(_LISTENING)

    def left(self, caller: Input) -> None:
        super().left(caller)
        self._gone()
