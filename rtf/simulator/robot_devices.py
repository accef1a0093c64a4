"""Devices of a robot configuration: the simulation, and the boards that are attached to it.

``rtf robotinterface`` uses them like the devices of a real robot: each board gets its server, its calibrator and its
actions. Sensors are in :mod:`rtf.simulator.sensor_devices`. A simulated robot with lockstep, cameras and faults is
started by ``rtf simulator``.
"""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING, get_args

from rtf import clock
from rtf.bottle import as_string, to_string
from rtf.errors import RtfError
from rtf.middleware.ports.remote import exists
from rtf.middleware.wire.contact import Contact
from rtf.robot.device import Device
from rtf.robot.errors import DeviceError
from rtf.robot.model import DEFAULT_ROBOT, load_robot
from rtf.robot.parameters import port_name, positive, wrong
from rtf.simulator.part import SimulatedPart
from rtf.simulator.plant import Collision, Options, build
from rtf.simulator.simulation import Simulation
from rtf.simulator.simulation_clock import CLOCK, SimulationClock, serve_time

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.bottle import Property
    from rtf.middleware.ports.network import Network
    from rtf.robot.extended_state import ExtendedState
    from rtf.simulator.boards import Boards


class SimulationDevice(Device):
    """``simulatedRobot``, also ``simulatedICub``: a simulation in this process, to which boards and sensors attach.

    While it is open, its clock is that of this process (:func:`rtf.clock.current`), and its clock port publishes the
    time. Parameters, all with defaults: ``model``, the name or path of a robot (icub); ``clock``, the name of that
    port; ``factor``, the greatest real-time factor (1); ``seed`` of the random numbers (0); ``collision``: capsules,
    hulls or none.
    """

    def __init__(self, name: str = "", *, network: Network | None = None) -> None:
        super().__init__(name, network=network)
        self._simulation: Simulation | None = None
        self._opened = ExitStack()

    @property
    def simulation(self) -> Simulation:
        """The simulation. Raises DeviceError while it is not open."""
        if self._simulation is None:
            raise DeviceError(f"{self.name} is not open; open it before a device is attached to it")
        return self._simulation

    def open(self, configuration: Property) -> None:
        port = port_name(configuration, "clock", CLOCK)
        factor = positive(configuration, "factor", 1.0)
        seed = configuration.get("seed", 0)
        if not isinstance(seed, int) or seed < 0:
            raise wrong(configuration, "seed", f"{to_string(seed)} is no whole number from 0")
        collision = _collision(configuration)
        try:
            self._open(as_string(configuration.get("model", DEFAULT_ROBOT)), port, factor, seed, collision)
        except RtfError as error:
            raise DeviceError(f"{self.name} cannot simulate: {error}") from error

    def _open(self, robot: str, port: str, factor: float, seed: int, collision: Collision) -> None:
        if exists(self.network, Contact(port)):
            raise DeviceError(f"there is a port {port} already; end the simulator that has it, or use 'clock'")
        simulation = Simulation(build(load_robot(robot), Options(collision=collision)), seed=seed, factor=factor)
        with ExitStack() as opened:
            server = serve_time(simulation, port, network=self.network, lockstep=False)
            opened.callback(server.close)
            opened.enter_context(clock.use(SimulationClock(simulation, server)))
            self._opened = opened.pop_all()
        self._simulation = simulation

    def close(self) -> None:
        self._simulation = None
        self._opened.close()


def simulation_of(device: Device, devices: Mapping[str, Device]) -> Simulation:
    """Return the simulation that a device is attached to. Raises DeviceError if it is not attached to exactly one."""
    robots = list(devices.values())
    if len(robots) != 1 or not isinstance(robots[0], SimulationDevice):
        raise DeviceError(f"{device.name} is attached to one simulatedRobot, not to {', '.join(devices) or 'nothing'}")
    return robots[0].simulation


class SimulatedBoard(SimulatedPart):
    """``simulatedBoard``: the control board of one ``part`` of a simulated robot, such as ``left_arm``.

    Until it is attached, all methods raise DeviceError.
    """

    def __init__(self, name: str = "", *, network: Network | None = None) -> None:
        Device.__init__(self, name, network=network)
        self._simulation: Simulation | None = None

    def open(self, configuration: Property) -> None:
        self._part = as_string(configuration.find("part"))
        if not self._part:
            raise wrong(configuration, "part", "it is missing: the part of the simulated robot")

    def attach(self, devices: Mapping[str, Device]) -> None:
        """Attach the board to a simulated robot. Raises RefusedError for a part that the robot does not have."""
        simulation = simulation_of(self, devices)
        self._be(simulation.plant.robot, self._part)
        self._simulation = simulation

    def detach(self) -> None:
        self._simulation = None

    def close(self) -> None:
        self.detach()

    def axes(self) -> int:
        self.board  # noqa: B018 - which raises DeviceError
        return self.size

    @property
    def board(self) -> Boards:
        if self._simulation is None:
            raise DeviceError(f"{self.name} is attached to no simulated robot; its action 'attach' comes first")
        return self._simulation.boards

    def fill_state(self, state: ExtendedState) -> float:
        """See IStateSource. Reads between two steps, as it is called in another thread than the simulation's."""
        with self.board.lock:
            return super().fill_state(state)


def _collision(configuration: Property) -> Collision:
    word = as_string(configuration.get("collision", "capsules"))
    for known in get_args(Collision):
        if word == known:
            return known  # type: ignore[no-any-return]  # one of its words
    raise wrong(configuration, "collision", f"{word!r} is none of {', '.join(get_args(Collision))}")
