"""Everything that is wrong with a suite file, collected in one go and each with its place."""

from __future__ import annotations

from dataclasses import dataclass
from difflib import get_close_matches
from enum import StrEnum
from typing import TYPE_CHECKING

from rtf.errors import Location

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

MAX_DIAGNOSTICS = 1000
"""More than anybody reads; what is beyond is counted."""
_MAX_COMPARED = 64  # names longer than this are no misspelling of ours
_MAX_CANDIDATES = 200  # comparing is slow, and a list this long is generated rather than typed
_MAX_SUGGESTIONS = 100


class Severity(StrEnum):
    """With an error the suite is not what its author meant, and is not run; a warning leaves it as it is."""

    ERROR = "error"
    WARNING = "warning"


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """One problem: what it is, where it is, and what would fix it (``hint`` may be empty)."""

    severity: Severity
    message: str
    location: Location
    hint: str = ""

    def __str__(self) -> str:
        """Write the problem the way compilers do, such as ``suite.xml:12:5: error: … (hint)``."""
        hint = f" ({self.hint})" if self.hint else ""
        return f"{self.location}: {self.severity}: {self.message}{hint}"


class DiagnosticLog:
    """Collects problems; a problem met again, as in every round of a loop, is kept once.

    With ``lenient`` an element or attribute that nobody knows is a warning.
    """

    def __init__(self, *, lenient: bool = False) -> None:
        self._lenient = lenient
        self._kept: dict[Diagnostic, None] = {}
        self._left_out = dict.fromkeys(Severity, 0)
        self._suggestions = _MAX_SUGGESTIONS

    def error(self, message: str, location: Location, hint: str = "") -> None:
        """Note something that cannot be used as it is written."""
        self._add(Diagnostic(Severity.ERROR, message, location, hint))

    def warning(self, message: str, location: Location, hint: str = "") -> None:
        """Note something that probably is not what the author meant."""
        self._add(Diagnostic(Severity.WARNING, message, location, hint))

    def unknown(self, message: str, location: Location, hint: str = "") -> None:
        """Note a name that is not in the vocabulary: what it says is lost."""
        self._add(Diagnostic(Severity.WARNING if self._lenient else Severity.ERROR, message, location, hint))

    def did_you_mean(self, name: str, candidates: Collection[str]) -> str:
        """A hint for a name that is not known; empty when nothing resembles it or there is too much to compare."""
        if not 0 < len(candidates) <= _MAX_CANDIDATES or len(name) > _MAX_COMPARED or not self._suggestions:
            return ""
        self._suggestions -= 1
        folded = {candidate.casefold(): candidate for candidate in sorted(candidates)}
        close = get_close_matches(name.casefold(), folded, n=1)
        return f"did you mean {folded[close[0]]!r}?" if close else ""

    def _add(self, diagnostic: Diagnostic) -> None:
        if diagnostic in self._kept:
            return
        if len(self._kept) < MAX_DIAGNOSTICS:
            self._kept[diagnostic] = None
        else:
            self._left_out[diagnostic.severity] += 1

    def __iter__(self) -> Iterator[Diagnostic]:
        """All problems in file order, the files in the order in which they were met."""
        files: dict[str, int] = {}
        for diagnostic in self._kept:
            files.setdefault(diagnostic.location.file, len(files))
        yield from sorted(self._kept, key=lambda d: (files[d.location.file], d.location.line, d.location.column))
        for severity, count in self._left_out.items():
            if count:
                message = f"{count} more problems of this kind are not listed"
                yield Diagnostic(severity, message, Location(next(iter(files), "")))
