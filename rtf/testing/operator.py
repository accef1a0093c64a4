"""The operator: who answers a test's questions. A person at the console or the page, or an answer given beforehand.

Where nobody is there to answer, a question's default counts at once.
"""

from __future__ import annotations

import contextlib
import math
import sys
import threading
from typing import TYPE_CHECKING

from rtf.testing.outcome import TestingError

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.testing.events import Asked
    from rtf.testing.run_control import Control

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
        return _number(question, text)
    return text


def _number(question: Asked, text: str) -> str:
    with contextlib.suppress(ValueError):
        value = float(text.replace(",", "."))
        if math.isfinite(value):
            return repr(value)
    raise AnswerError(f"a number is wanted{' in ' + question.unit if question.unit else ''}")


def _choice(question: Asked, text: str) -> str:
    for choice in question.choices:
        if choice.lower() == text.lower():
            return choice
    numbers = {str(number): choice for number, choice in enumerate(question.choices, 1)}
    if text in numbers:
        return numbers[text]
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

    def __init__(self, control: Control) -> None:
        self._control = control
        self._lock = threading.Lock()
        self._listener: threading.Thread | None = None
        control.attend(self._asked)

    def _asked(self, _question: Asked) -> None:
        """Read from now on; what was typed before there was any question is nobody's answer."""
        with self._lock:
            if self._listener is None:
                self._listener = threading.Thread(target=self._listen, name="rtf-operator", daemon=True)
                self._listener.start()

    def _listen(self) -> None:
        for line in sys.stdin:
            for question in self._control.questions()[:1]:
                try:
                    self._control.answer(question.test, question.question, line, "console")
                except AnswerError as error:
                    sys.stderr.write(f"{error}:\n")
                except TestingError as error:  # somebody else was quicker
                    sys.stderr.write(f"{error}\n")


def make_operator(answer: str | None, control: Control, *, page: bool = False) -> Operator | None:
    """The operator for a command line: an answer given beforehand, people at terminal and page, or nobody.

    A question goes to all of them, and the first valid answer counts.
    """
    if answer is not None:
        return automatic(answer)
    at_terminal = sys.stdin is not None and sys.stdin.isatty()
    if at_terminal:
        Console(control)
    return control.ask if at_terminal or page else None
