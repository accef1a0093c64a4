"""Putting a robot back: one thing after the other, whatever becomes of each of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.errors import NoAnswerError, RobotError, UnreachableError

if TYPE_CHECKING:
    from collections.abc import Callable

#: Questions without an answer (5 s each) after which a board is not asked any more: in a row, and in all.
_UNANSWERED, _LOST = 3, 5


class Problems:
    """Does one thing after the other whatever becomes of them, and tells all that failed at the end."""

    def __init__(self) -> None:
        self._texts: list[str] = []
        self._unanswered = self._lost = 0

    def attempt(self, action: Callable[..., object], *arguments: object) -> None:
        """Do something. A board that does not answer again and again, or is gone, raises its NoAnswerError."""
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

    def tell(self, beginning: str) -> None:
        """Raise one RobotError for all; nothing when there were none."""
        if self._texts:
            raise RobotError(f"{beginning}{'; '.join(self._texts)}")
