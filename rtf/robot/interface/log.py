"""The log of a robot interface: levels, and helpers for messages."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum


class Level(StrEnum):
    """The level of a log message."""

    DEBUG = "DEBUG"
    INFO = "INFO"
    WARNING = "WARNING"
    ERROR = "ERROR"


#: A log function, called from the thread that runs the robot; it must be quick.
Log = Callable[[Level, str], None]


def discard(_level: Level, _sentence: str) -> None:
    """Discard the message."""


def seconds(duration: float) -> str:
    """Return a duration as text, such as ``12 ms`` or ``3.2 s``."""
    return f"{1e3 * duration:.0f} ms" if duration < 1 else f"{duration:.1f} s"


def printable(text: str) -> str:
    """Replace the characters of a text that could control a terminal or are invalid in XML."""
    return "".join(char if char.isprintable() else "\N{REPLACEMENT CHARACTER}" for char in text)
