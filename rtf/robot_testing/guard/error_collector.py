"""Collecting the errors of several actions, such as the steps of restoring a robot."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.errors import NoAnswerError, RobotError, UnreachableError

if TYPE_CHECKING:
    from collections.abc import Callable

#: Requests without an answer (5 s each) after which a board is given up: in a row, and in total.
_UNANSWERED, _LOST = 3, 5


class ErrorCollector:
    """Runs one action after the other even if some fail, and raises all their errors at the end."""

    def __init__(self) -> None:
        self._texts: list[str] = []
        self._unanswered = self._lost = 0

    def attempt(self, action: Callable[..., object], *arguments: object) -> None:
        """Run an action and keep its RobotError. Raises NoAnswerError for a board that is gone or keeps silent."""
        try:
            action(*arguments)
        except NoAnswerError as error:
            self._note(error)
            self._unanswered += 1
            self._lost += 1
            if isinstance(error, UnreachableError) or self._unanswered == _UNANSWERED or self._lost == _LOST:
                raise
        except RobotError as error:
            self._note(error)
            self._unanswered = 0
        else:
            self._unanswered = 0

    def _note(self, error: RobotError) -> None:
        if str(error) not in self._texts:
            self._texts.append(str(error))

    def raise_all(self, beginning: str) -> None:
        """Raise one RobotError with all texts; do nothing if there was no error."""
        if self._texts:
            raise RobotError(f"{beginning}{'; '.join(self._texts)}")
