"""What people may do to a run from outside: stop it, and answer its tests' questions.

The console, the web page and any reporter that shows buttons use this one door; a reporter finds it in its options.
Everything here may be called from any thread. What was accepted is told by an event, like everything else.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from rtf.testing.events import Answered, RunEnded, TestEnded
from rtf.testing.operator import interpret
from rtf.testing.outcome import TestingError

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.testing.events import Asked, Event
    from rtf.testing.interrupts import Interrupts
    from rtf.testing.operator import Answer

    Key = tuple[str, str]


class TooLateError(TestingError, RuntimeError):
    """The run is over, or the question is not open: somebody else answered it, or its time is up."""


class Control:
    """The door to one run. It may be used before the run has begun: a stop is remembered."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._interrupts: Interrupts | None = None
        self._stops: list[tuple[str, int]] = []
        self._open: dict[Key, tuple[Asked, Answer]] = {}
        self._answered: dict[Key, str] = {}
        self._listeners: list[Callable[[Asked], None]] = []
        self._over = False

    def bind(self, interrupts: Interrupts) -> None:
        """Connect the door to its run, which hears of stops that came before."""
        with self._lock:
            self._interrupts = interrupts
            for source, stage in self._stops:
                interrupts.request(source, stage=stage)

    def stop(self, source: str, stage: int) -> None:
        """Stop the run: 1 after the running test, 2 now. ``source`` says who wants it. Raises TooLateError."""
        with self._lock:
            if self._over:
                raise TooLateError("the run is over")
            if self._interrupts is None:
                self._stops.append((source, stage))
            else:
                self._interrupts.request(source, stage=stage)

    # Questions ---------------------------------------------------------------------------------------------------

    def attend(self, listener: Callable[[Asked], None]) -> None:
        """Call ``listener`` with each question that is asked from now on. It must be quick."""
        self._listeners.append(listener)

    def ask(self, question: Asked, reply: Answer) -> None:
        """Put a question to everybody who is there. For the run."""
        with self._lock:
            self._answered.pop(_key(question), None)  # another attempt asks what an earlier one asked
            self._open[_key(question)] = (question, reply)
        for listener in self._listeners:
            listener(question)

    def questions(self) -> tuple[Asked, ...]:
        """The questions that wait for an answer, oldest first."""
        with self._lock:
            return tuple(question for question, _ in self._open.values())

    def answer(self, test: str, question: str, text: str, source: str) -> str:
        """Answer a question with what somebody typed; the first valid answer counts. Returns what was understood.

        Raises AnswerError when the text is no answer, TooLateError when the question is not open.
        """
        key = (test, question)
        with self._lock:
            asked, reply = self._find(key)
            understood = interpret(asked, text)
            del self._open[key]
            self._answered[key] = source
        reply(understood, source)
        return understood

    def _find(self, key: Key) -> tuple[Asked, Answer]:
        found = self._open.get(key)
        if found is None:
            by = self._answered.get(key)
            raise TooLateError(f"it is answered already ({by})" if by else f"no question {key[1]!r} is open")
        return found

    def note(self, event: Event) -> None:
        """Hear what happens in the run, which closes questions. For the run."""
        kind = type(event)
        if kind is Answered:
            self._close_question(event.test, event.question, event.source)  # type: ignore[attr-defined]
        elif kind is TestEnded:
            self._close_test(event.test)  # type: ignore[attr-defined]
        elif kind is RunEnded:
            self._over = True

    def _close_question(self, test: str, question: str, source: str) -> None:
        with self._lock:
            if self._open.pop((test, question), None) is not None:
                self._answered[test, question] = source

    def _close_test(self, test: str) -> None:
        with self._lock:
            for key in [key for key in self._open if key[0] == test]:
                del self._open[key]


def _key(question: Asked) -> Key:
    return question.test, question.question
