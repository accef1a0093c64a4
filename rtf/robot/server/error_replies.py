"""Error replies: the answer to a request whose handler raises an error."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import BottleError
from rtf.middleware.types import FAIL
from rtf.robot.errors import RobotError

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.bottle import Bottle
    from rtf.middleware.ports.network import Network


def with_error_replies(
    answer: Callable[[Bottle], object], *, port: str, network: Network, failure: object = FAIL
) -> Callable[[Bottle], object]:
    """Wrap a request handler: any exception becomes the reply ``failure``.

    A refusal of the device and an invalid request are errors of the client; all other exceptions are errors of the
    server and are reported.
    """

    def answered(request: Bottle) -> object:
        try:
            return answer(request)
        except (RobotError, BottleError):
            return failure
        except Exception as error:  # noqa: BLE001 - the port must survive errors of a driver; they are reported
            network.report(f"{port}: {request.to_text()[:80]!r} failed: {type(error).__name__}: {error}")
            return failure

    return answered
