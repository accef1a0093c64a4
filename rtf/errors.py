"""The base of every error RTF raises, and the place in a file that an error names."""

from __future__ import annotations

from dataclasses import dataclass


class RtfError(Exception):
    """Base of all errors of the framework: a sentence that names the thing, the place and the hint."""


@dataclass(frozen=True, slots=True)
class Location:
    """A place in a file. Lines and columns count from 1; 0 means unknown."""

    file: str = ""
    line: int = 0
    column: int = 0

    def __str__(self) -> str:
        """Write the place the way compilers and editors read it, such as ``suite.xml:12:5``."""
        parts = [self.file or "<string>"]
        if self.line:
            parts.append(str(self.line))
            if self.column:
                parts.append(str(self.column))
        return ":".join(parts)
