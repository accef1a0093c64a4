"""One run at a time works with a robot: whoever does so is known by a port, to all who share its name server."""

from __future__ import annotations

import os
import socket
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, as_string
from rtf.middleware.errors import MiddlewareError, WaitTimeoutError
from rtf.middleware.rpc import RpcClient, RpcServer
from rtf.robot.errors import RobotError

if TYPE_CHECKING:
    from rtf.middleware.network import Network


class ReservedError(RobotError):
    """Somebody else works with the robot; the sentence says who."""


class Reservation:
    """A robot is reserved until it is closed, or this process ends. Raises ReservedError, MiddlewareError.

    The port ``/ROBOT/testrunner`` answers every question with who has it, within ``patience`` seconds. Where nobody can
    be reached the one who had it is gone.
    """

    def __init__(self, robot: str, *, network: Network, patience: float) -> None:
        self._name = f"/{robot}/testrunner"
        self._refuse_others(network, patience)
        self._port = RpcServer(self._name, lambda _: Bottle([_me()]), network=network)

    def _refuse_others(self, network: Network, patience: float) -> None:
        if network.names.query(self._name) is None:
            return
        try:
            with RpcClient("", self._name, network=network) as client:
                answer = client.call(Bottle(["who"]), timeout=patience)
        except WaitTimeoutError:
            raise ReservedError(
                f"who holds port {self._name} does not answer; end that run, or free its name by "
                f"`rtf name unregister {self._name}`"
            ) from None
        except MiddlewareError:
            return  # its name was left behind
        who = as_string(answer.get(0)) if answer else "somebody"
        raise ReservedError(f"{who} works with it (port {self._name}); wait until that has ended")

    def close(self) -> None:
        """Let others have it."""
        self._port.close()


def _me() -> str:
    return f"process {os.getpid()} on {socket.gethostname()}"
