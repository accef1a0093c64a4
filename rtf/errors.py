"""The base class of RTF's errors, and the file location that an error names."""

from __future__ import annotations

from dataclasses import dataclass


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
