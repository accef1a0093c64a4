"""The server of lockstep time: it lets time pass when everybody waits. The simulator is built on it.

It knows nothing of what happens in time; ``advance(until)`` does that, and returns how far it came: everything that was
to happen up to then has happened, and everything that was to be published has been delivered.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Vocab, as_float, as_int, as_string
from rtf.middleware.port import Port

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.bottle import Value
    from rtf.middleware.delivery import Delivery
    from rtf.middleware.inputs import Input
    from rtf.middleware.network import Network

_OK, _FAIL = Vocab("ok"), Vocab("fail")


@dataclass(slots=True)
class Participant:
    """Somebody who takes part: a name for people, the connection that stands for it, and the moment it waits for."""

    name: str
    sender: str
    until: float | None = None


class LockstepServer:
    """Serves time at the port ``name``. ``advance`` is called in one thread at a time, while all participants wait.

    A participant that does not wait for ``patience`` seconds of the machine's time, while others do, is told of by
    ``complain``.
    """

    def __init__(
        self,
        name: str,
        advance: Callable[[float], float],
        *,
        network: Network,
        start: float = 0.0,
        patience: float = 10.0,
        complain: Callable[[str], None] | None = None,
    ) -> None:
        self.now = start
        self._advance = advance
        self._patience = patience
        self._complain = complain or network.report
        self._changed = threading.Condition()
        self._participants: dict[int, Participant] = {}
        self._next = 1
        self._closed = False
        self._paused = False
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

    def pause(self) -> None:
        """Let no time pass until ``resume``."""
        with self._changed:
            self._paused = True

    def resume(self) -> None:
        """Let time pass again."""
        with self._changed:
            self._paused = False
            self._changed.notify_all()

    def close(self) -> None:
        """Be done; those who wait are refused."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self._port.close()
        self._thread.join()

    def _run(self) -> None:
        while True:
            with self._changed:
                while not self._closed and not self._everybody_waits():
                    if not self._changed.wait(self._patience):
                        self._name_the_late()
                if self._closed:
                    return
                until = min(one.until for one in self._participants.values() if one.until is not None)
            reached = self._advance(until)
            with self._changed:
                self.now = reached
                self._changed.notify_all()

    def _everybody_waits(self) -> bool:
        waiting = [one.until for one in self._participants.values()]
        return bool(waiting) and not self._paused and all(until is not None and until > self.now for until in waiting)

    def _name_the_late(self) -> None:
        late = [one.name for one in self._participants.values() if one.until is None]
        if late and len(late) < len(self._participants):
            self._complain(f"time stands still at {self.now:.6g} s: {', '.join(late)} does not wait for it")

    def _answer(self, delivery: Delivery) -> None:
        question = delivery.read()
        word = as_string(question.get(0))
        if word == "join":
            delivery.reply(self._join(as_string(question.get(1)), delivery.sender))
        elif word == "until":
            delivery.reply(self._until(question.get(1), as_float(question.get(2))))
        elif word == "leave":
            delivery.reply(self._leave(as_int(question.get(1))))
        elif word == "now":
            delivery.reply(Bottle([_OK, self.now]))
        else:
            delivery.reply(Bottle([_FAIL, f"{word!r} is none of join, until, leave, now"]))

    def _join(self, name: str, sender: str) -> Bottle:
        with self._changed:
            number, self._next = self._next, self._next + 1
            self._participants[number] = Participant(name or sender, sender)
            return Bottle([_OK, number, self.now])

    def _until(self, number: Value | None, time: float) -> Bottle:
        with self._changed:
            participant = self._participants.get(as_int(number))
            if participant is None:
                return Bottle([_FAIL, "join first"])
            participant.until = time
            self._changed.notify_all()
            self._changed.wait_for(lambda: self.now >= time or self._closed)
            participant.until = None
            return Bottle([_FAIL, "the clock was closed"]) if self._closed else Bottle([_OK, self.now])

    def _leave(self, number: int) -> Bottle:
        with self._changed:
            self._participants.pop(number, None)
            self._changed.notify_all()
        return Bottle([_OK])

    def _left(self, sender: str) -> None:
        """A connection is gone, and with it whoever it stood for."""
        with self._changed:
            self._participants = {key: one for key, one in self._participants.items() if one.sender != sender}
            self._changed.notify_all()


class _ClockPort(Port):
    """The port of the server: it notices who hangs up."""

    def __init__(
        self, name: str, answer: Callable[[Delivery], None], gone: Callable[[str], None], *, network: Network
    ) -> None:
        self._gone = gone
        super().__init__(name, answer, network=network, outputs=False, rpc=True)

    def left(self, caller: Input) -> None:
        """See Port."""
        super().left(caller)
        if caller.sender:
            self._gone(caller.sender)
