"""What is wrong in the files of a robot, collected so that everything can be told at once."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Self

from rtf.robot.errors import ConfigurationError

if TYPE_CHECKING:
    from rtf.errors import Location

#: After so many mistakes a file is not read any further: nobody fixes more at a time.
MAX_PROBLEMS = 200


@dataclass(frozen=True, slots=True)
class Problem:
    """One thing that is wrong, where, and what would fix it."""

    location: Location
    sentence: str
    hint: str = ""

    def __str__(self) -> str:
        """Write it as compilers do, such as ``icub.xml:12:5: there is no device 'hed'; known are 'head', 'torso'``."""
        return f"{self.location}: {self.sentence}{f'; {self.hint}' if self.hint else ''}"


class RobotFileError(ConfigurationError):
    """The files of a robot cannot be used. ``problems`` are all that were found, in the order of the message."""

    def __init__(self, problems: tuple[Problem, ...]) -> None:
        super().__init__("\n".join(map(str, problems)))
        self.problems = problems

    @classmethod
    def of(cls, location: Location, sentence: str, hint: str = "") -> Self:
        """The error for one problem."""
        return cls((Problem(location, sentence, hint),))


@dataclass(slots=True)
class ProblemLog:
    """Errors, which make the files unusable, and warnings, which do not."""

    errors: list[Problem] = field(default_factory=list)
    warnings: list[Problem] = field(default_factory=list)

    def error(self, location: Location, sentence: str, hint: str = "") -> None:
        """Note what makes the files unusable. Raises RobotFileError when there are too many to go on."""
        self.errors.append(Problem(location, sentence, hint))
        if len(self.errors) >= MAX_PROBLEMS:
            raise RobotFileError(tuple(self.errors))

    def warn(self, location: Location, sentence: str, hint: str = "") -> None:
        """Note what somebody should look at."""
        if len(self.warnings) < MAX_PROBLEMS:
            self.warnings.append(Problem(location, sentence, hint))

    def judge(self) -> None:
        """Raise RobotFileError if there was an error."""
        if self.errors:
            raise RobotFileError(tuple(self.errors))
