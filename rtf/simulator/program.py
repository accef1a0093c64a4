"""The program of the simulated robot: ports, signals, output and end."""

from __future__ import annotations

import math
import os
import threading
from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf import clock
from rtf.errors import RtfError
from rtf.middleware.errors import ConnectError
from rtf.middleware.naming import configuration
from rtf.middleware.ports.access import Access
from rtf.middleware.ports.remote import exists
from rtf.middleware.wire.contact import Contact
from rtf.robot.boards.client import REQUESTS
from rtf.robot.interface.network_program import say
from rtf.robot.interface.signals import signal_listener
from rtf.simulator.control_client import control_port
from rtf.simulator.errors import RenderingError

if TYPE_CHECKING:
    import signal
    from pathlib import Path

    from rtf.bottle import Dialect
    from rtf.middleware.ports.network import Network
    from rtf.robot.model import RobotModel
    from rtf.simulator.plant import Collision
    from rtf.simulator.robot import SimulatedRobot

FINE, FAILED = 0, 1
#: The exit code after a second signal: that of a shell for a program that SIGINT ended.
_AT_ONCE = 2
CLOCK = "/clock"


@dataclass(frozen=True, slots=True)
class Settings:
    """The settings of the command line. ``factor`` inf: no limit; ``cameras``: no, yes, or auto (if they work)."""

    model: RobotModel
    robot: str = ""  # the prefix of its ports; that of the model
    parts: tuple[str, ...] = ()  # all
    seed: int = 0
    unit: int = 0  # of the population
    lockstep: bool = False
    factor: float = 1.0
    cameras: str = "no"
    state_rate: float | None = None  # Hz; that of the robot
    camera_rate: float | None = None  # likewise
    collision: Collision = "capsules"
    ball: tuple[float, float, float] | None = None  # with cameras: the place of the red ball; that of the robot
    clock: str = CLOCK
    dialect: Dialect | None = None
    nameserver: bool = False
    can: bool = False  # whether its boards are on CAN buses
    drives: tuple[str, ...] = ()  # the parts that have a board for each motor then
    allow: tuple[str, ...] = ()  # who may command; everyone
    allow_admin: tuple[str, ...] = ()  # who may change connections; everyone
    ready_file: Path | None = None

    @property
    def name(self) -> str:
        """The prefix of the robot's ports."""
        return self.robot or self.model.simulated_name


def run_simulator(settings: Settings) -> int:
    """Run a simulated robot until a signal, or a request at its control port, ends it; return the exit code.

    To be called in the main thread. All ports are closed and unregistered at the end, except after a second signal.
    """
    return _Program(settings).run()


class _Program:
    """A run of the program."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._began = clock.monotonic()
        self._end = threading.Event()
        self._signals = 0
        self._failed = False
        self._robot: SimulatedRobot | None = None

    def run(self) -> int:
        """See run_simulator."""
        with signal_listener(self._on_signal), ExitStack() as opened:
            try:
                robot = self._start(opened)
                if not self._end.is_set():
                    self._announce_ready(robot, opened)
            except (RtfError, OSError) as error:
                say(f"FAILED: {self._settings.name} could not be started: {error}")
                return FAILED
            self._end.wait()
        return FAILED if self._failed else FINE

    def _on_signal(self, number: signal.Signals) -> None:
        """Ask the program to end at the first signal, and end it at once at the second."""
        self._signals += 1
        if self._signals > 1:
            os._exit(_AT_ONCE)
        say(f"{number.name}: ends")
        self._end.set()

    def _report(self, sentence: str) -> None:
        """Report an error of the network or the clock; after an error of the clock the time does not go on."""
        say(f"[WARNING] {sentence}")
        if self._robot is not None and self._robot.clock.broken is not None:
            self._failed = True
            self._end.set()

    def _start(self, opened: ExitStack) -> SimulatedRobot:
        settings = self._settings
        network = _network(settings, opened)
        network.report = self._report
        model = settings.model
        name = settings.name
        port = control_port(name)
        if exists(network, Contact(port)):
            raise ConnectError(f"there is a port {port} already; end the simulator that has it, or use --robot")
        # The control port closes last, so that a request to quit is answered.
        last = opened.enter_context(ExitStack())
        robot = self._robot = _make(model, name, settings, network)
        opened.callback(robot.close)
        from rtf.simulator.control_service import SimulatorService

        service = SimulatorService(robot, network=network, end=self._end.set)
        last.callback(service.close)
        return robot

    def _announce_ready(self, robot: SimulatedRobot, opened: ExitStack) -> None:
        """Print the ports and READY, and write the ready file if one was requested."""
        settings, name, streams = self._settings, robot.name, robot.outlets.by_name
        rpc = REQUESTS[robot.network.dialect]
        for part in robot.parts:
            say(f"/{name}/{part}:{rpc.replace('/', ' ', 1)} command:i state:o stateExt:o")
        of_parts = {f"/{name}/{part}/{stream}" for part in robot.parts for stream in ("state:o", "stateExt:o")}
        say(f"sensors: {' '.join(sorted(set(streams) - of_parts))}")
        pace = "lockstep" if settings.lockstep else f"factor {settings.factor:g}"
        duration = clock.monotonic() - self._began
        unit = f", unit {settings.unit}" if settings.unit else ""
        line = (
            f"READY {name}{unit} in {duration:.2f} s: {len(robot.parts)} parts, {len(streams)} streams, "
            f"{len(robot.cameras)} cameras, clock {robot.clock.name} ({pace}), control {control_port(name)}"
        )
        if settings.ready_file is not None:
            _write_whole(settings.ready_file, line)
            opened.callback(settings.ready_file.unlink, missing_ok=True)
        say(line)


def _network(settings: Settings, opened: ExitStack) -> Network:
    """Return the network of the user's configuration, with a name server of this process if that was requested."""
    if settings.nameserver:
        from rtf.middleware.naming.server import NameServer

        place = configuration.read_place()
        contact = place.contact if place else Contact(configuration.namespaces()[0], "127.0.0.1", 0)
        number = contact.port or configuration.base_port()
        try:
            server = NameServer(
                contact.host,
                number,
                namespace=contact.name or "/root",
                discovery=number if number == configuration.base_port() else 0,
            )
        except ConnectError as error:
            raise ConnectError(f"{error}; where a name server runs already, leave out --nameserver") from None
        opened.callback(server.close)
        say(
            f"name server {server.contact.name} at {server.contact.host}:{server.contact.port}; other programs find it"
            f" after 'yarp conf {server.contact.host} {server.contact.port}' (or 'rtf conf', or 'yarp detect --write')"
        )
    network = configuration.find_network()
    if settings.dialect is not None:
        network.dialect = settings.dialect
    network.writers, network.admins = Access.parse(settings.allow), Access.parse(settings.allow_admin)
    return network


def _make(model: RobotModel, name: str, settings: Settings, network: Network) -> SimulatedRobot:
    """Make the robot; with cameras ``auto``, without them if the machine cannot render."""
    if settings.cameras != "auto":
        return _simulated(model, name, settings, network, cameras=settings.cameras == "yes")
    try:
        return _simulated(model, name, settings, network, cameras=True)
    except RenderingError as error:
        say(f"no cameras: {error}")
        return _simulated(model, name, settings, network, cameras=False)


def _simulated(model: RobotModel, name: str, settings: Settings, network: Network, *, cameras: bool) -> SimulatedRobot:
    if cameras:
        from rtf.simulator.rendering import rendering_back_end

        rendering_back_end()  # so that a missing package is reported before the model is built
    from rtf.simulator.plant import Options
    from rtf.simulator.robot import CAMERA_RATE, STATE_RATE, SimulatedRobot

    return SimulatedRobot(
        model,
        name,
        network=network,
        parts=settings.parts,
        seed=settings.seed,
        lockstep=settings.lockstep,
        factor=None if settings.factor == math.inf else settings.factor,
        cameras=cameras,
        state_rate=settings.state_rate or STATE_RATE,
        camera_rate=settings.camera_rate or CAMERA_RATE,
        options=Options(collision=settings.collision, cameras=cameras, unit=settings.unit, ball=settings.ball),
        clock=settings.clock,
        can=settings.can,
        drives=settings.drives,
    )


def _write_whole(path: Path, line: str) -> None:
    """Write a file atomically."""
    beside = path.with_name(f"{path.name}.{os.getpid()}.new")
    beside.write_text(f"{line}\n", encoding="utf-8")
    beside.replace(path)
