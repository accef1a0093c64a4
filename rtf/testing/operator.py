"""The operator: who answers a test's questions. A person at the console, or an answer given beforehand.

The web page answers through the same door. Where nobody is there to answer, a question's default counts at once.
"""

from __future__ import annotations

import contextlib
import sys
import threading
from collections import deque
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.testing.events import Asked

    Answer = Callable[[str | None, str], None]
    Operator = Callable[[Asked, Answer], None]

_YES = frozenset({"y", "yes", "j", "ja", "s", "si", "sì", "true", "1"})
_NO = frozenset({"n", "no", "nein", "false", "0"})


class AnswerError(ValueError):
    """What was typed does not answer the question; the message says what would."""


def interpret(question: Asked, text: str) -> str:
    """Make the answer of what somebody typed: ``yes``/``no``, one of the choices (or its number), a number, a text.

    Raises AnswerError when it is none.
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
        try:
            return repr(float(text.replace(",", ".")))
        except ValueError:
            raise AnswerError(f"a number is wanted{' in ' + question.unit if question.unit else ''}") from None
    return text


def _choice(question: Asked, text: str) -> str:
    for choice in question.choices:
        if choice.lower() == text.lower():
            return choice
    if text.isdigit() and 1 <= int(text) <= len(question.choices):
        return question.choices[int(text) - 1]
    raise AnswerError(f"choose one of {', '.join(question.choices)}")


def automatic(answer: str) -> Operator:
    """An operator who gives one answer to every question it fits, and the question's default otherwise.

    ``default`` as the answer means the default always.
    """

    def give(question: Asked, reply: Answer) -> None:
        text = question.default
        if answer != "default":
            with contextlib.suppress(AnswerError):
                text = interpret(question, answer)
        reply(text, "automatic")

    return give


class Console:
    """A person at the terminal. Questions are shown by the console reporter; lines typed answer the oldest open one."""

    def __init__(self) -> None:
        self._open: deque[tuple[Asked, Answer]] = deque()
        self._lock = threading.Lock()
        self._listener: threading.Thread | None = None

    def __call__(self, question: Asked, reply: Answer) -> None:
        """Take on a question."""
        with self._lock:
            self._open.append((question, reply))
            if self._listener is None:
                self._listener = threading.Thread(target=self._listen, name="rtf-operator", daemon=True)
                self._listener.start()

    def _listen(self) -> None:
        for line in sys.stdin:
            with self._lock:
                if not self._open:
                    continue
                question, reply = self._open[0]
                try:
                    answer = interpret(question, line)
                except AnswerError as error:
                    sys.stderr.write(f"{error}:\n")
                    continue
                self._open.popleft()
            reply(answer, "console")


def make_operator(answer: str | None) -> Operator | None:
    """The operator for a command line: an answer given beforehand, the person at the terminal, or nobody."""
    if answer is not None:
        return automatic(answer)
    if sys.stdin is not None and sys.stdin.isatty():
        return Console()
    return None
