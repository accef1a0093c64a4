"""The base class of RTF's errors, the file location that an error names, and the word that was meant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable


class RtfError(Exception):
    """Base class of all errors of the framework. The message names the object, the location and a hint."""


@dataclass(frozen=True, slots=True)
class Location:
    """A place in a file. Lines and columns count from 1; 0 means unknown."""

    file: str = ""
    line: int = 0
    column: int = 0

    def __str__(self) -> str:
        """Return the location as compilers write it, such as ``suite.xml:12:5``."""
        parts = [self.file or "<string>"]
        if self.line:
            parts.append(str(self.line))
            if self.column:
                parts.append(str(self.column))
        return ":".join(parts)


def nearest(word: str, known: Iterable[str]) -> str:
    """Return the known word that this one was probably meant to be, whatever its case; empty if there is none."""
    from difflib import get_close_matches

    folded = {candidate.casefold(): candidate for candidate in sorted(known)}
    found = get_close_matches(word.casefold(), folded, n=1)
    return folded[found[0]] if found else ""


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return the end of a message about a word that is not known, such as ``; did you mean left_arm?``, or nothing."""
    near = nearest(word, known)
    return f"; did you mean {near}?" if near else ""
