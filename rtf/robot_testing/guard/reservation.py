"""Reservation of a robot for one run, by a port at the name server that the runs share."""

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
from rtf.middleware.ports.rpc import RpcClient, RpcServer
from rtf.robot.errors import RobotError
from rtf.testing.permission import runner_pid

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.ports.network import Network

_ASKS = "asks for it"
_WORKS = "works with it"
_LEAVES = "is about to leave"
_LOOK_AGAIN = 0.02
#: Seconds between two attempts of a run that waits.
_NEXT_TRY = 0.5


class ReservedError(RobotError):
    """Another run has reserved the robot; the message names it."""


class _OtherRun(NamedTuple):
    """Another run that has reserved the robot or tries to: its port, its description and its stage."""

    port: str
    who: str
    stage: str

    def is_before(self, port: str) -> bool:
        """Return whether this run has precedence over the one with ``port``."""
        return self.stage == _WORKS or (self.stage == _ASKS and self.port < port)


class Reservation:
    """The reservation of a robot, until ``close`` or the end of the process. Raises ReservedError, MiddlewareError.

    Each run opens a port, ``/ROBOT/testrunner/HOST-PID-…``, which answers every request with the description and the
    stage of the run, within ``patience`` seconds. A registered port that cannot be reached belongs to a run that has
    died.

    A run registers its port before it looks for others, so of two simultaneous runs at least one sees the other. A run
    that sees one with precedence (by the order of names) gives up; the first repeats until it is alone.
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
        while others := self._other_runs():
            first = next((one for one in others if one.is_before(self._name)), None)
            if first or deadline.expired:
                who = first or others[0]
                raise ReservedError(f"{who.who} {who.stage} (port {who.port}); wait until it has ended, or use --wait")
            clock.sleep(_LOOK_AGAIN)

    def _other_runs(self) -> list[_OtherRun]:
        names = {contact.name for contact in self._network.names.list(self._all.rstrip("/"))} - {self._name}
        found = [self._ask(name) for name in sorted(names) if name.startswith(self._all)]
        return [run for run in found if run]

    def _ask(self, name: str) -> _OtherRun | None:
        try:
            with RpcClient("", name, network=self._network) as client:
                answer = client.call(Bottle(["who"]), timeout=self._patience)
        except WaitTimeoutError:
            raise ReservedError(
                f"the run with port {name} does not answer; end it, or free the name by `rtf name unregister {name}`"
            ) from None
        except MiddlewareError:
            return None  # a stale registration
        if not answer:
            return _OtherRun(name, "another run", _LEAVES)
        return _OtherRun(name, as_string(answer.get(0)) or "another run", as_string(answer.get(1)) or _WORKS)

    def close(self) -> None:
        """Release the robot."""
        self._port.close()


def reserve_when_free(
    robot: str, *, network: Network, patience: float, wait: float, report: Callable[[str], None]
) -> Reservation:
    """Reserve a robot, and wait at most ``wait`` seconds while another run works with it.

    Raises what :class:`Reservation` raises. ``report`` is called once, with the run that has the robot.
    """
    deadline = clock.Deadline.after(wait)
    reported = False
    while True:
        try:
            return Reservation(robot, network=network, patience=patience)
        except ReservedError as error:
            if deadline.expired:
                raise
            if not reported:
                report(f"waiting for /{robot}: {error}")
                reported = True
        clock.sleep(min(_NEXT_TRY, deadline.remaining()))


def _run_name() -> str:
    return Path(os.environ.get("RTF_RUN_FOLDER", "without a folder")).name


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return f"user {os.getuid()}"
