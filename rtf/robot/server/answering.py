"""What becomes of a question when the device says no, or fails."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import BottleError
from rtf.middleware.types import FAIL
from rtf.robot.errors import RobotError

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.bottle import Bottle
    from rtf.middleware.network import Network


def guarded(
    answer: Callable[[Bottle], object], *, port: str, network: Network, failure: object = FAIL
) -> Callable[[Bottle], object]:
    """The same answers, but ``failure`` for whatever is raised.

    That a device refuses, and that a question is none, is the asker's business; every other error is a fault here, and
    is reported.
    """

    def answered(question: Bottle) -> object:
        try:
            return answer(question)
        except (RobotError, BottleError):
            return failure
        except Exception as error:  # noqa: BLE001 - whatever a driver does, the port goes on, and it is told
            network.report(f"{port}: {question.to_text()[:80]!r} failed: {type(error).__name__}: {error}")
            return failure

    return answered
