"""The problems of a suite file, collected in one go and each with its place; and limits on what a file unfolds into."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.errors import Location, nearest
from rtf.testing.events import Diagnosed
from rtf.testing.verdict import Severity
from rtf.xml_tree import XmlError

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

MAX_DIAGNOSTICS = 1000
"""Further problems are only counted."""
MAX_COMPARED = 64  # a longer name is no misspelling
_MAX_CANDIDATES = 200  # comparing is slow, and a list this long is generated rather than typed
_MAX_SUGGESTIONS = 100

LIMITS = {"tests": 100_000, "steps": 2_000_000, "characters": 64 * 1024 * 1024, "files": 1000}
"""What the loops and includes of one suite may unfold into."""
_OVER = {
    "tests": "the suite unfolds into more than {} tests",
    "steps": "the loops of the suite take more than {} steps to unfold",
    "characters": "the texts of the suite unfold into more than {} characters",
    "files": "the suite includes more than {} files",
}


class DiagnosticLog:
    """Collects problems; a problem that occurs again, as in every round of a loop, is kept once.

    With ``lenient`` an unknown element or attribute is a warning. The log also counts what loops and includes unfold
    into: a file of a few lines can ask for billions of tests. ``variables`` are those that the file uses.
    """

    def __init__(self, *, lenient: bool = False) -> None:
        self._unknown = Severity.WARNING if lenient else Severity.ERROR
        self._kept: dict[tuple[Severity, str, Location], Diagnosed] = {}
        self._left_out = {Severity.ERROR: 0, Severity.WARNING: 0}
        self._suggestions = _MAX_SUGGESTIONS
        self._left = dict(LIMITS)
        self.variables: set[str] = set()

    def error(self, message: str, location: Location, hint: str = "") -> None:
        """Add a problem of something that cannot be used as it is written."""
        self._add(Severity.ERROR, message, location, hint)

    def warning(self, message: str, location: Location, hint: str = "") -> None:
        """Add a warning of something that is probably not what the author meant."""
        self._add(Severity.WARNING, message, location, hint)

    def unknown(self, message: str, location: Location, hint: str = "") -> None:
        """Add a problem of an unknown name, whose content is lost."""
        self._add(self._unknown, message, location, hint)

    def did_you_mean(self, name: str, candidates: Collection[str]) -> str:
        """Return a hint for an unknown name; empty when nothing resembles it or there is too much to compare."""
        if not 0 < len(candidates) <= _MAX_CANDIDATES or len(name) > MAX_COMPARED or not self._suggestions:
            return ""
        self._suggestions -= 1
        near = nearest(name, candidates)
        return f"did you mean {near!r}?" if near else ""

    def spend(self, location: Location, **amounts: int) -> None:
        """Count what the file unfolds into. Raises XmlError with the limit and the place when a limit is reached."""
        for what, amount in amounts.items():
            self._left[what] -= amount
            if self._left[what] < 0:
                raise XmlError(_OVER[what].format(LIMITS[what]), location, "split the suite")

    def _add(self, severity: Severity, message: str, location: Location, hint: str) -> None:
        key = (severity, message, location)
        if key in self._kept:
            return
        if len(self._kept) < MAX_DIAGNOSTICS:
            self._kept[key] = diagnosed(severity, message, location, hint)
        else:
            self._left_out[severity] += 1

    def __iter__(self) -> Iterator[Diagnosed]:
        """Yield all problems in file order, the files in the order in which they were read."""
        files: dict[str, int] = {}
        for one in self._kept.values():
            files.setdefault(one.file, len(files))
        yield from sorted(self._kept.values(), key=lambda one: (files[one.file], one.line, one.column))
        for severity, count in self._left_out.items():
            if count:
                message = f"{count} more problems of this kind are not listed"
                yield diagnosed(severity, message, Location(next(iter(files), "")))


def diagnosed(severity: Severity, message: str, location: Location, hint: str = "", suite: str = "") -> Diagnosed:
    """Return the event of a problem at a place. With an error nothing is run; a warning leaves what was meant."""
    file, line, column = location.file, location.line, location.column
    return Diagnosed(severity=severity, text=message, file=file, line=line, column=column, hint=hint, suite=suite)
