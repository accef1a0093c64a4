"""The control of a run: people and signals stop it, and people answer the questions of its tests.

The console, the live page and any reporter that shows buttons use it; a reporter has it in its options. All of it may
be used from any thread, and before the run has begun. Each accepted request becomes an event, like everything else.
"""

from __future__ import annotations

import contextlib
import io
import math
import signal
import sys
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rtf import clock
from rtf.testing.events import Answered, Event, Interrupted, RunEnded, TestEnded
from rtf.testing.isolation import processes
from rtf.testing.isolation.messages import STOP_LIMIT
from rtf.testing.verdict import TestingError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rtf.testing.events import Asked
    from rtf.testing.isolation.reactor import Reactor

    #: Takes the answer, or None where there is none, and its source.
    Reply = Callable[[str | None, str], None]
    Key = tuple[str, str]

#: The stage at which the running test is stopped, and the stage at which the run waits for nothing any more.
NOW_STAGE, KILL_STAGE = 2, 3
#: Seconds that the running test, with its teardown, has to end after SIGTERM or SIGHUP. The fixtures come after it, and
#: the reports, before the sender kills, which is ten seconds later as a rule.
TEST_LIMIT = 2.5

_YES = frozenset({"y", "yes", "j", "ja", "s", "si", "sì", "true", "1"})
_NO = frozenset({"n", "no", "nein", "false", "0"})


class AnswerError(ValueError):
    """A text that does not answer the question; the message has the valid answers."""


class TooLateError(TestingError, RuntimeError):
    """The run is over, or the question is not open any more: it has an answer, or its time is up."""


class Control:
    """The control of one run.

    ``stage`` says how strongly the run was asked to stop: 0 not at all, 1 after the running test, 2 now, 3 by force.
    Each suite worker notices at its next turn. ``test_deadline`` is the moment at which the running test is killed,
    since a signal asked the run to end at once.

    ``answer`` is given to every question that it fits, and others get their default; ``default`` means the default
    always. Without it a question goes to all who called :meth:`attend`, and the first valid answer counts.
    """

    def __init__(self, answer: str | None = None) -> None:
        self.stage = 0
        self.test_deadline = clock.Deadline()
        self._requests: list[Interrupted] = []
        self._announced = 0
        self._announcing = threading.Lock()
        self._reactors: list[Reactor] = []
        self._over = False
        self._automatic = answer
        self._lock = threading.Lock()
        self._open: dict[Key, tuple[Asked, Reply]] = {}
        self._answered: dict[Key, str] = {}
        self._listeners: list[Callable[[Asked], None]] = []

    # Stopping ----------------------------------------------------------------------------------------------------

    @property
    def count(self) -> int:
        """How often the run was asked to stop."""
        return len(self._requests)

    @property
    def in_a_hurry(self) -> bool:
        """Whether the run has to end at once, within the time limits of a signal."""
        return self.test_deadline.at != clock.FOREVER

    def stop(self, source: str, stage: int) -> None:
        """Stop the run: 1 after the running test, 2 now. ``source`` names the requester. Raises TooLateError."""
        if self._over:
            raise TooLateError("the run is over")
        self.request(source, stage=stage)

    def signalled(self, signum: int) -> None:
        """Handle a signal. SIGINT requests the next stage; SIGTERM and SIGHUP end the run at once, and in time."""
        stage = 0
        if signum != signal.SIGINT:
            if not self.in_a_hurry:
                self.test_deadline = clock.Deadline.after(TEST_LIMIT)
            stage = 0 if self.stage >= NOW_STAGE else NOW_STAGE
        self.request(processes.signal_name(signum), stage=stage)

    def request(self, source: str, *, stage: int = 0) -> None:
        """Request the next stage, or at least a given stage. Takes no lock: signal handlers call it."""
        self.stage = min(KILL_STAGE, max(self.stage + 1 if stage == 0 else self.stage, stage))
        self._requests.append(Interrupted(source=source, stage=self.stage))
        for reactor in [*self._reactors]:
            reactor.wake()

    def announce(self, emit: Callable[[Event], None]) -> None:
        """Emit an event for each request since the last time."""
        with self._announcing:
            while self._announced < len(self._requests):
                self._announced += 1
                emit(self._requests[self._announced - 1])

    def fixtures_deadline(self, more: float) -> clock.Deadline:
        """Return when fixtures that are not down are killed; ``more`` is their time beyond the limit, in seconds."""
        limit = STOP_LIMIT + more
        return clock.Deadline(self.test_deadline.at + limit, TEST_LIMIT + limit)

    def add_reactor(self, reactor: Reactor) -> None:
        """Wake this reactor at each request from now on."""
        self._reactors.append(reactor)

    def remove_reactor(self, reactor: Reactor) -> None:
        """Stop waking it."""
        self._reactors.remove(reactor)

    # Questions ---------------------------------------------------------------------------------------------------

    @property
    def attended(self) -> bool:
        """Whether questions can be answered."""
        return self._automatic is not None or bool(self._listeners)

    def attend(self, listener: Callable[[Asked], None] = lambda _: None) -> None:
        """Register a listener that can answer. It is called with each question, and must be quick."""
        self._listeners.append(listener)

    def attend_terminal(self) -> None:
        """Take lines that are typed at this terminal as answers to the oldest open question.

        Nothing is read before the first question: what was typed until then is no answer.
        """
        reading = threading.Thread(target=self._read_terminal, name="rtf-operator", daemon=True)
        first = threading.Lock()

        def asked(_question: Asked) -> None:
            if first.acquire(blocking=False):
                reading.start()

        self.attend(asked)

    def _read_terminal(self) -> None:
        if isinstance(sys.stdin, io.TextIOWrapper):
            sys.stdin.reconfigure(errors="replace")  # a letter of another encoding is no reason to read no more
        for line in sys.stdin:
            for question in self.questions()[:1]:
                try:
                    self.answer(question.test, question.question, line, "console")
                except AnswerError as error:
                    sys.stderr.write(f"{error}:\n")
                except TooLateError as error:  # another answer was quicker
                    sys.stderr.write(f"{error}\n")

    def ask(self, question: Asked, reply: Reply) -> None:
        """Put a question to all registered listeners. For the run."""
        if self._automatic is not None:
            reply(_answer_beforehand(question, self._automatic), "automatic")
            return
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
        """Answer a question with a typed text; the first valid answer counts. Returns the answer as it was understood.

        Raises AnswerError when the text is no answer, TooLateError when the question is not open.
        """
        key = (test, question)
        with self._lock:
            if key not in self._open:
                by = self._answered.get(key)
                raise TooLateError(f"it is answered already ({by})" if by else f"no question {question!r} is open")
            asked, reply = self._open[key]
            understood = interpret(asked, text)
            del self._open[key]
            self._answered[key] = source
        reply(understood, source)
        return understood

    def note(self, event: Event) -> None:
        """Take an event of the run, which may close questions. For the run."""
        if isinstance(event, Answered):
            with self._lock:
                if self._open.pop((event.test, event.question), None) is not None:
                    self._answered[event.test, event.question] = event.source
        elif isinstance(event, TestEnded):
            with self._lock:
                for key in [key for key in self._open if key[0] == event.test]:
                    del self._open[key]
        elif isinstance(event, RunEnded):
            self._over = True


def _key(question: Asked) -> Key:
    return question.test, question.question


def _answer_beforehand(question: Asked, answer: str) -> str | None:
    if answer != "default":
        with contextlib.suppress(AnswerError):
            return interpret(question, answer)
    return question.default


def interpret(question: Asked, text: str) -> str:
    """Return the answer in a typed text: ``yes``/``no``, one of the choices (or its number), a number, a text.

    Raises AnswerError when there is none.
    """
    text = text.strip()
    if not text and question.default is not None:
        return question.default
    if question.form == "confirm":
        if text.lower() in _YES:
            return "yes"
        if text.lower() in _NO:
            return "no"
        raise AnswerError("answer yes or no")
    if question.form == "choice":
        return _choice(question, text)
    if question.form == "number":
        return _number(question, text)
    return text


def _number(question: Asked, text: str) -> str:
    with contextlib.suppress(ValueError):
        value = float(text.replace(",", "."))
        if math.isfinite(value):
            return repr(value)
    raise AnswerError(f"a number is wanted{' in ' + question.unit if question.unit else ''}")


def _choice(question: Asked, text: str) -> str:
    known = {str(number): choice for number, choice in enumerate(question.choices, 1)}
    known |= {choice.lower(): choice for choice in reversed(question.choices)}  # the first of two that look the same
    try:
        return known[text.lower()]
    except KeyError:
        raise AnswerError(f"choose one of {', '.join(question.choices)}") from None


@contextmanager
def alarm(seconds: float | None, ring: Callable[[], None]) -> Iterator[None]:
    """Call ``ring`` from a thread of its own when the body takes longer than ``seconds`` (None: never)."""
    if seconds is None:
        yield
        return
    timer = threading.Timer(seconds, ring)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()
