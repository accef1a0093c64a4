"""The robot interface as a program: its port, its signals, what it prints, and how it ends."""

from __future__ import annotations

import contextlib
import sys
from typing import TYPE_CHECKING

from rtf import clock
from rtf.middleware.errors import ConnectError, MiddlewareError
from rtf.middleware.names import Contact
from rtf.middleware.remote import exists
from rtf.robot.interface.machine import Outcome, RobotInterface
from rtf.robot.interface.service import open_service
from rtf.robot.interface.signals import heard_signals
from rtf.robot.interface.telling import Weight, printable, seconds

if TYPE_CHECKING:
    import signal
    from typing import TextIO

    from rtf.middleware.network import Network
    from rtf.middleware.rpc import RpcServer
    from rtf.robot.interface.model import Robot
    from rtf.robot.interface.tasks import Patience

FINE, FAILED, WRONG = 0, 1, 4


class Teller:
    """Prints what is told, a line each with what it weighs; nobody who reads it is no reason to end."""

    def __init__(self, stream: TextIO | None = None, *, verbose: bool = False) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._verbose = verbose

    def __call__(self, weight: Weight, sentence: str) -> None:
        """Print it. From any thread."""
        if weight is Weight.DEBUG and not self._verbose:
            return
        text = "\n        ".join(map(printable, sentence.rstrip().splitlines()))
        with contextlib.suppress(OSError, ValueError):
            self._stream.write(f"[{weight}] {text}\n")
            self._stream.flush()


def run_program(
    robot: Robot, *, network: Network, tell: Teller, patience: Patience, autoclose: bool = False
) -> tuple[int, bool]:
    """Run a robot until a signal or a question to its port ends it. For the main thread.

    Returns the exit code, and whether something still hangs in this process, which then can only be left at once.
    """
    interface = RobotInterface(robot, network=network, patience=patience, tell=tell, autoclose=autoclose)
    began = clock.monotonic()

    def on_signal(number: signal.Signals) -> None:
        tell(Weight.WARNING, f"{number.name}: asked to end")
        interface.interrupt()

    with heard_signals(on_signal):
        try:
            port = _open_port(interface, network)
        except MiddlewareError as error:
            tell(Weight.ERROR, f"FAILED: {robot.name} was not started: {error}")
            return FAILED, False
        tell(Weight.INFO, f"port {port.name} answers questions")
        try:
            outcome = interface.run()
        finally:
            port.close()
        _tell_verdict(robot, outcome, clock.monotonic() - began, tell)
    return (FINE if outcome.good else FAILED), bool(outcome.hanging)


def _open_port(interface: RobotInterface, network: Network) -> RpcServer:
    """Open the port, unless there is one: two programs that move one robot do not know of each other."""
    name = interface.robot.port_name
    if exists(network, Contact(name)):
        raise ConnectError(f"there is a port {name} already; end the robot interface that has it, or use --portprefix")
    return open_service(interface, network)


def _tell_verdict(robot: Robot, outcome: Outcome, duration: float, tell: Teller) -> None:
    for name in outcome.hanging:
        tell(Weight.ERROR, f"{name} has not come to an end; the process ends without it")
    how = "ran and was closed in order" if outcome.ready else "was never ready; what was open is closed"
    count = len(outcome.failures)
    failures = f"; {count} {'failure' if count == 1 else 'failures'}, the first: {outcome.failures[0]}" if count else ""
    weight = Weight.INFO if outcome.good else Weight.ERROR
    tell(weight, f"{'FINE' if outcome.good else 'FAILED'}: {robot.name} {how} ({seconds(duration)}){failures}")
