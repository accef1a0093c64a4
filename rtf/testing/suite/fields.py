"""The attributes and texts of one element, read as typed values under the variables that hold there."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, TypeVar

from rtf.testing.suite.values import MAX_TEXT, parse_duration, parse_integer, quote, split_words, substitute

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.errors import Location
    from rtf.testing.suite.diagnostics import DiagnosticLog
    from rtf.testing.suite.scan import Element

MAX_TESTS = 100_000
MAX_STEPS = 2_000_000
MAX_CHARACTERS = 64 * 1024 * 1024
MAX_FILES = 1000

SHORTEST = 0.001
LONGEST = 30 * 24 * 3600.0
"""Thirty days: longer than any endurance test, short enough to catch milliseconds written as seconds."""

_Choice = TypeVar("_Choice", bound=StrEnum)


class OverBudget(Exception):
    """A file unfolds into more than the loader is willing to hold."""

    def __init__(self, message: str, location: Location) -> None:
        super().__init__(message)
        self.message, self.location = message, location


@dataclass(slots=True)
class Budget:
    """What loops and includes may still unfold into; a file of a few lines can ask for billions of tests."""

    tests: int = MAX_TESTS
    steps: int = MAX_STEPS
    characters: int = MAX_CHARACTERS
    files: int = MAX_FILES

    def spend(self, location: Location, *, tests: int = 0, steps: int = 0, characters: int = 0, files: int = 0) -> None:
        """Take from the budget; OverBudget names the limit and the place when it is used up."""
        self.tests -= tests
        self.steps -= steps
        self.characters -= characters
        self.files -= files
        if self.tests < 0:
            raise OverBudget(f"the suite unfolds into more than {MAX_TESTS} tests", location)
        if self.steps < 0:
            raise OverBudget(f"the loops of the suite take more than {MAX_STEPS} steps to unfold", location)
        if self.characters < 0:
            raise OverBudget(f"the texts of the suite unfold into more than {MAX_CHARACTERS} characters", location)
        if self.files < 0:
            raise OverBudget(f"the suite includes more than {MAX_FILES} files", location)


class Fields:
    """Reads one element. A faulty value is noted in the problems, ``ok`` turns False, and reading goes on."""

    def __init__(self, element: Element, bindings: Mapping[str, str], problems: DiagnosticLog, budget: Budget) -> None:
        self.element = element
        self.ok = True
        self._attributes = element.attributes
        self._bindings = bindings
        self._problems = problems
        self._budget = budget

    def fail(self, message: str, attribute: str = "", hint: str = "") -> None:
        """Note an error of this element, at one of its attributes if that is named."""
        self.ok = False
        place = self.element.attribute_location(attribute) if attribute else self.element.location
        self._problems.error(message, place, hint)

    def warn(self, message: str, hint: str = "") -> None:
        """Note something odd about this element that leaves it usable."""
        self._problems.warning(message, self.element.location, hint)

    def body(self) -> str:
        """The element's own text, condensed, variables put in."""
        return self._expand(self.element.text, "")

    def text(self, name: str, default: str = "") -> str:
        """An attribute as it is written, variables put in."""
        raw = self._attributes.get(name)
        return default if raw is None else self._expand(raw, name)

    def optional(self, name: str) -> str | None:
        """An attribute, or None when it is missing or blank."""
        return self.text(name).strip() or None

    def words(self, name: str, *, commas: bool = True) -> tuple[str, ...] | None:
        """An attribute split into words, or None when it is missing."""
        if name not in self._attributes:
            return None
        try:
            return split_words(self.text(name), commas=commas)
        except ValueError as error:
            self._wrong(name, error)
            return None

    def integer(self, name: str, default: int, high: int) -> int:
        """An attribute as a whole number from 0 to ``high``."""
        if name not in self._attributes:
            return default
        try:
            return parse_integer(self.text(name), 0, high)
        except ValueError as error:
            self._wrong(name, error)
            return default

    def seconds(self, name: str, low: float = SHORTEST, high: float = LONGEST) -> float | None:
        """An attribute as a duration in seconds, or None when it is missing or faulty."""
        if name not in self._attributes:
            return None
        try:
            return parse_duration(self.text(name), low, high)
        except ValueError as error:
            self._wrong(name, error)
            return None

    def choice(self, name: str, kind: type[_Choice]) -> _Choice | None:
        """An attribute as a member of an enumeration, or None when it is missing or faulty."""
        raw = self.optional(name)
        if raw is None:
            return None
        try:
            return kind(raw)
        except ValueError:
            allowed = [member.value for member in kind]
            message = f"is {quote(raw)}; it must be one of {', '.join(allowed)}"
            self._wrong(name, ValueError(message), self._problems.did_you_mean(raw, allowed))
            return None

    def _wrong(self, name: str, error: ValueError, hint: str = "") -> None:
        self.fail(f"attribute {name!r} of <{self.element.name}> {error}", name, hint)

    def _expand(self, raw: str, name: str) -> str:
        if len(raw) > MAX_TEXT:
            self._too_long(name, f"is longer than {MAX_TEXT} characters")
            return ""
        try:
            expanded = substitute(raw, self._bindings)
        except ValueError as error:
            self._too_long(name, str(error))
            return ""
        self._budget.spend(self.element.location, characters=len(expanded))
        return expanded

    def _too_long(self, name: str, problem: str) -> None:
        what = f"attribute {name!r}" if name else "the text"
        self.fail(f"{what} of <{self.element.name}> {problem}", name)
