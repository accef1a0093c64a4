"""The robot interface as a program: its port, its signals, its output, and its exit code."""

from __future__ import annotations

import contextlib
import logging
import sys
from typing import TYPE_CHECKING

from rtf import clock
from rtf.middleware.errors import ConnectError, MiddlewareError
from rtf.middleware.ports.remote import exists
from rtf.middleware.ports.rpc import RpcServer
from rtf.middleware.types.service import Function, Service
from rtf.middleware.wire.contact import Contact
from rtf.robot.interface.log import Level, printable, seconds
from rtf.robot.interface.robot_interface import Outcome, RobotInterface
from rtf.robot.interface.signals import signal_listener

if TYPE_CHECKING:
    import signal
    from typing import TextIO

    from rtf.middleware.ports.network import Network
    from rtf.robot.interface.device_thread import Patience
    from rtf.robot.interface.model import Robot

FINE, FAILED, WRONG = 0, 1, 4
_logger = logging.getLogger("rtf.robotinterface")
_logger.addHandler(logging.NullHandler())
_NUMBERS = logging.getLevelNamesMapping()
_CLASS = "yarprobotinterfaceRpc"
#: The wording of YARP's program.
_READY = "Returns true if yarprobotinterface is ready (all startup actions\nperformed and no interrupt called)."
_ENDINGS = ("quit", "bye", "exit")
#: The explanations of the functions.
_PHASE = "The phase it is in: startup, run, interrupt1, interrupt2, interrupt3, shutdown or unknown."
_LEVEL = "The level of the phase whose actions are done."
_ROBOT = "The name of the robot."
_ENDS = "Ends it, as the first signal does; the answer is bye."


class ConsoleLog:
    """Prints log messages, one per line with its level, and logs them. A closed output stream is ignored."""

    def __init__(self, stream: TextIO | None = None, *, verbose: bool = False) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._verbose = verbose

    def __call__(self, level: Level, sentence: str) -> None:
        """Print a message. May be called from any thread."""
        _logger.log(_NUMBERS[level], "%s", sentence)
        if level is Level.DEBUG and not self._verbose:
            return
        text = "\n        ".join(map(printable, sentence.rstrip().splitlines()))
        with contextlib.suppress(OSError, ValueError):
            self._stream.write(f"[{level}] {text}\n")
            self._stream.flush()


def run_program(
    robot: Robot, *, network: Network, log: ConsoleLog, patience: Patience, autoclose: bool = False
) -> tuple[int, bool]:
    """Run a robot until a signal or a request at its port ends it. For the main thread.

    Return the exit code, and whether a call still hangs in this process, which then must be exited without clean-up.
    """
    interface = RobotInterface(robot, network=network, patience=patience, log=log, autoclose=autoclose)
    began = clock.monotonic()

    def on_signal(number: signal.Signals) -> None:
        log(Level.WARNING, f"{number.name}: stop requested")
        interface.interrupt()

    with signal_listener(on_signal):
        try:
            port = _open_port(interface, network)
        except MiddlewareError as error:
            log(Level.ERROR, f"FAILED: {robot.name} was not started: {error}")
            return FAILED, False
        log(Level.INFO, f"port {port.name} answers requests")
        try:
            outcome = interface.run()
        finally:
            port.close()
        _log_result(robot, outcome, clock.monotonic() - began, log)
    return (FINE if outcome.good else FAILED), bool(outcome.hanging)


def _open_port(interface: RobotInterface, network: Network) -> RpcServer:
    """Open the port, unless it exists already: two programs that move one robot do not know of each other."""
    name = interface.robot.port_name
    if exists(network, Contact(name)):
        raise ConnectError(f"the port {name} exists already; end the robot interface that owns it, or use --portprefix")
    return open_service(interface, network)


def _log_result(robot: Robot, outcome: Outcome, duration: float, log: ConsoleLog) -> None:
    for name in outcome.hanging:
        log(Level.ERROR, f"{name} has not returned; the process exits without it")
    how = "ran and was closed in order" if outcome.ready else "was never ready; what was open is closed"
    count = len(outcome.failures)
    failures = f"; {count} {'failure' if count == 1 else 'failures'}, the first: {outcome.failures[0]}" if count else ""
    level = Level.INFO if outcome.good else Level.ERROR
    log(level, f"{'FINE' if outcome.good else 'FAILED'}: {robot.name} {how} ({seconds(duration)}){failures}")


# The port -------------------------------------------------------------------------------------------------------------


def make_service(interface: RobotInterface) -> Service:
    """Return the functions of the port, in the order in which ``help`` lists them."""

    def end() -> str:
        interface.quit()
        return "bye"

    return Service(
        {
            "get_phase": Function(lambda: str(interface.phase), f"std::string {_CLASS}::get_phase()", (_PHASE,)),
            "get_level": Function(lambda: interface.level, f"std::int32_t {_CLASS}::get_level()", (_LEVEL,)),
            "get_robot": Function(lambda: interface.robot.name, f"std::string {_CLASS}::get_robot()", (_ROBOT,)),
            "is_ready": Function(lambda: interface.ready, f"bool {_CLASS}::is_ready()", (_READY,)),
            **{name: Function(end, f"std::string {_CLASS}::{name}()", (_ENDS,)) for name in _ENDINGS},
        }
    )


def open_service(interface: RobotInterface, network: Network) -> RpcServer:
    """Open the port ``<portprefix>/yarprobotinterface``. Raises MiddlewareError."""
    return RpcServer(interface.robot.port_name, make_service(interface).answer, network=network)
