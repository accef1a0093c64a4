"""How a robot interface tells what it does: a weight and a sentence, to whoever started it."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum


class Weight(StrEnum):
    """How much a sentence weighs."""

    DEBUG = "DEBUG"
    INFO = "INFO"
    WARNING = "WARNING"
    ERROR = "ERROR"


#: Called from the thread that runs the robot; it must be quick.
Tell = Callable[[Weight, str], None]


def say_nothing(_weight: Weight, _sentence: str) -> None:
    """Nobody wants to know."""


def seconds(duration: float) -> str:
    """A duration for people, such as ``12 ms`` or ``3.2 s``."""
    return f"{1e3 * duration:.0f} ms" if duration < 1 else f"{duration:.1f} s"


def printable(text: str) -> str:
    """The text without what could do something to a terminal, and that no XML may contain."""
    return "".join(char if char.isprintable() else "\N{REPLACEMENT CHARACTER}" for char in text)
