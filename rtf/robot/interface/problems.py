"""The problems in the files of a robot, collected to be reported together."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Self

from rtf.robot.errors import ConfigurationError

if TYPE_CHECKING:
    from rtf.errors import Location

#: The number of errors after which reading stops.
MAX_PROBLEMS = 200


@dataclass(frozen=True, slots=True)
class Problem:
    """A problem: its location, a sentence, and a hint."""

    location: Location
    sentence: str
    hint: str = ""

    def __str__(self) -> str:
        """Return a compiler-style message: ``icub.xml:12:5: there is no device 'hed'; known are 'head', 'torso'``."""
        return f"{self.location}: {self.sentence}{f'; {self.hint}' if self.hint else ''}"


class RobotFileError(ConfigurationError):
    """The files of a robot cannot be used. ``problems`` are all that were found, in order."""

    def __init__(self, problems: tuple[Problem, ...]) -> None:
        super().__init__("\n".join(map(str, problems)))
        self.problems = problems

    @classmethod
    def of(cls, location: Location, sentence: str, hint: str = "") -> Self:
        """Return the error of a single problem."""
        return cls((Problem(location, sentence, hint),))


@dataclass(slots=True)
class ProblemLog:
    """Collects errors, which make the files unusable, and warnings, which do not."""

    errors: list[Problem] = field(default_factory=list)
    warnings: list[Problem] = field(default_factory=list)

    def error(self, location: Location, sentence: str, hint: str = "") -> None:
        """Record an error. Raises RobotFileError when there are too many to continue."""
        self.errors.append(Problem(location, sentence, hint))
        if len(self.errors) >= MAX_PROBLEMS:
            raise RobotFileError(tuple(self.errors))

    def warn(self, location: Location, sentence: str, hint: str = "") -> None:
        """Record a warning."""
        if len(self.warnings) < MAX_PROBLEMS:
            self.warnings.append(Problem(location, sentence, hint))

    def judge(self) -> None:
        """Raise RobotFileError if there are errors."""
        if self.errors:
            raise RobotFileError(tuple(self.errors))
