"""The lines of the YARP property file format: joining of physical lines, and removal of comments.

As in YARP, lines are joined first and comments are removed afterwards. A comment inside a list that spans lines
therefore removes the rest of the list, and a comment with an unpaired quote or bracket removes the lines after it. Both
are reported.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from rtf.bottle import Balance
from rtf.errors import Location

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

_COMMENT = re.compile(r'"|//|(?:(?<=[ \t])|\A)#')
_DROPPED = str.maketrans("", "", "\r\0")
_APART = frozenset(" \t,(){}[]")


class DiagnosticKind(StrEnum):
    """The kind of a suspicious line that was nevertheless read."""

    UNDEFINED_VARIABLE = "undefined variable"
    REPEATED_KEY = "repeated key"
    UNBALANCED = "unbalanced"
    GLUED_LINES = "glued lines"
    SWALLOWED_LINES = "swallowed lines"


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """Something that YARP silently accepts but that is rarely intended; ``name`` is the variable or key."""

    kind: DiagnosticKind
    message: str
    location: Location
    name: str = ""

    def __str__(self) -> str:
        """Return the location and the message, as compilers do."""
        return f"{self.location}: {self.message}"


@dataclass(frozen=True, slots=True)
class Line:
    """A physical line without its end, and its position; lines count from 1."""

    text: str
    file: str
    number: int


@dataclass(frozen=True, slots=True)
class LogicalLine:
    """Joined lines, including comments; ``starts`` are the offsets of the second and later lines."""

    text: str
    location: Location
    starts: tuple[int, ...] = ()
    balanced: bool = True
    opened: Location | None = None

    def without_comment(self) -> str:
        """Return the text before the comment, without the blank before ``#``."""
        end = comment_start(self.text)
        return self.text if end < 0 else self.text[:end]

    def diagnostics(self) -> Iterator[Diagnostic]:
        """Yield diagnostics about the joining of the line."""
        if not self.balanced:
            where = self.opened or self.location
            message = "a quote or bracket is never closed: the rest of the text is lost"
            yield Diagnostic(DiagnosticKind.UNBALANCED, message, where)
            return
        end = comment_start(self.text)
        if end >= 0:
            lost = sum(start > end for start in self.starts)
            if lost:
                message = f"the comment removes {lost} following line(s), because a quote or bracket is open"
                yield Diagnostic(DiagnosticKind.SWALLOWED_LINES, message, self.location)
        for index, start in enumerate(self.starts):
            beside = self.text[max(start - 1, 0) : start + 1]
            if 0 < start < len(self.text) and not _APART & set(beside) and not 0 <= end < start:
                where = Location(self.location.file, self.location.line + index + 1)
                message = (
                    f"{beside[0]!r} and {beside[1]!r} become one word where the lines are joined; begin with a blank"
                )
                yield Diagnostic(DiagnosticKind.GLUED_LINES, message, where)


def split_lines(text: str, file: str) -> Iterator[Line]:
    """Split text into physical lines, without carriage returns and NULs."""
    for number, line in enumerate(text.translate(_DROPPED).split("\n"), 1):
        yield Line(line, file, number)


def join_lines(lines: Iterable[Line]) -> Iterator[LogicalLine]:
    """Join a line with the next while a quote or bracket is open, or when it ends in a backslash, which is dropped."""
    source = iter(lines)
    for first in source:
        balance = Balance()
        parts: list[str] = []
        starts: list[int] = []
        size = 0
        opened: Location | None = None
        line: Line | None = first
        while line is not None:
            text, goes_on = _without_backslash(line.text)
            parts.append(text)
            size += len(text)
            complete = balance.feed(text)
            opened = None if complete else opened or Location(line.file, line.number)
            if complete and not goes_on:
                break
            starts.append(size)
            line = next(source, None)
        if starts and line is None:
            starts.pop()
        yield LogicalLine("".join(parts), Location(first.file, first.number), tuple(starts), opened is None, opened)


def _without_backslash(text: str) -> tuple[str, bool]:
    """Remove a backslash at the end; return whether there was one. Two backslashes are text."""
    odd = (len(text) - len(text.rstrip("\\"))) % 2 == 1
    return (text[:-1], True) if odd else (text, False)


def comment_start(text: str) -> int:
    """Return the start of the comment: ``//``, or ``#`` at the line start or after a blank; -1 without one."""
    if "//" not in text and "#" not in text:
        return -1
    quoted = False
    for mark in _COMMENT.finditer(text):
        if mark[0] == '"':
            quoted = not quoted
        elif not quoted:
            return max(mark.start() - 1, 0) if mark[0] == "#" else mark.start()
    return -1
