"""One run at a time works with a robot. It is known by a port, to all runs that share the robot's name server."""

from __future__ import annotations

import getpass
import os
import secrets
import socket
from contextlib import ExitStack
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rtf import clock
from rtf.bottle import Bottle, as_string
from rtf.middleware.errors import MiddlewareError, WaitTimeoutError
from rtf.middleware.rpc import RpcClient, RpcServer
from rtf.robot.errors import RobotError
from rtf.testing.permission import runner_pid

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.network import Network

_ASKS = "asks for it"
_WORKS = "works with it"
_LEAVES = "is about to leave"
_LOOK_AGAIN = 0.02
#: Seconds between two tries of a run that waits.
_NEXT_TRY = 0.5


class ReservedError(RobotError):
    """Somebody else works with the robot; the sentence says who."""


class _Rival(NamedTuple):
    """Somebody else who has the robot or wants it: its port, who it is, and how far it is."""

    port: str
    who: str
    stage: str

    def is_before(self, port: str) -> bool:
        """Whether who asks at ``port`` has to give up."""
        return self.stage == _WORKS or (self.stage == _ASKS and self.port < port)


class Reservation:
    """A robot is reserved until it is closed, or this process ends. Raises ReservedError, MiddlewareError.

    A port of its own, ``/ROBOT/testrunner/HOST-PID-…``, answers every question with who has the robot or asks for it,
    within ``patience`` seconds. Where nobody can be reached the one who had it is gone.

    Who wants the robot is known by its port before it looks for others, so of two that want it at once at least one
    sees the other. Who sees somebody before it in the order of the names gives up; the first looks again till it is
    alone.
    """

    def __init__(self, robot: str, *, network: Network, patience: float) -> None:
        since = datetime.fromtimestamp(clock.now(), UTC).astimezone()
        self._who = (
            f"run {_run_name()} (process {runner_pid()} of {_user()} on {socket.gethostname()}, "
            f"since {since:%Y-%m-%d %H:%M:%S})"
        )
        self._all = f"/{robot}/testrunner/"
        self._name = f"{self._all}{socket.gethostname()}-{os.getpid()}-{secrets.token_hex(2)}"
        self._stage = _ASKS
        self._network = network
        self._patience = patience
        with ExitStack() as undo:
            self._port = undo.enter_context(RpcServer(self._name, self._answer, network=network))
            self._wait_to_be_alone()
            undo.pop_all()
        self._stage = _WORKS

    def _answer(self, _: Bottle) -> Bottle:
        return Bottle([self._who, self._stage])

    def _wait_to_be_alone(self) -> None:
        deadline = clock.Deadline.after(self._patience)
        while rivals := self._rivals():
            first = next((one for one in rivals if one.is_before(self._name)), None)
            if first or deadline.expired:
                who = first or rivals[0]
                raise ReservedError(
                    f"{who.who} {who.stage} (port {who.port}); wait until that has ended, or say --wait"
                )
            clock.sleep(_LOOK_AGAIN)

    def _rivals(self) -> list[_Rival]:
        names = {contact.name for contact in self._network.names.list(self._all.rstrip("/"))} - {self._name}
        found = [self._ask(name) for name in sorted(names) if name.startswith(self._all)]
        return [rival for rival in found if rival]

    def _ask(self, name: str) -> _Rival | None:
        try:
            with RpcClient("", name, network=self._network) as client:
                answer = client.call(Bottle(["who"]), timeout=self._patience)
        except WaitTimeoutError:
            raise ReservedError(
                f"who holds port {name} does not answer; end that run, or free its name by `rtf name unregister {name}`"
            ) from None
        except MiddlewareError:
            return None  # its name was left behind
        if not answer:
            return _Rival(name, "somebody", _LEAVES)
        return _Rival(name, as_string(answer.get(0)) or "somebody", as_string(answer.get(1)) or _WORKS)

    def close(self) -> None:
        """Let others have it."""
        self._port.close()


def reserve_when_free(
    robot: str, *, network: Network, patience: float, wait: float, report: Callable[[str], None]
) -> Reservation:
    """Reserve a robot, and wait at most ``wait`` seconds while another run works with it.

    Raises what :class:`Reservation` raises. ``report`` is told once for whom is waited.
    """
    deadline = clock.Deadline.after(wait)
    told = False
    while True:
        try:
            return Reservation(robot, network=network, patience=patience)
        except ReservedError as error:
            if deadline.expired:
                raise
            if not told:
                report(f"waits for /{robot}: {error}")
                told = True
        clock.sleep(min(_NEXT_TRY, deadline.remaining()))


def _run_name() -> str:
    return Path(os.environ.get("RTF_RUN_FOLDER", "without a folder")).name


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return f"user {os.getuid()}"
