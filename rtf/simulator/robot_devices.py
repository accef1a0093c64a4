"""Devices of a robot configuration: the simulation, and the boards that are attached to it.

``rtf robotinterface`` uses them like the devices of a real robot: each board gets its server, its calibrator and its
actions. Sensors are in :mod:`rtf.simulator.sensor_devices`. A simulated robot in lockstep is started by ``rtf
simulator``.
"""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING, get_args

from rtf import clock
from rtf.bottle import as_bool, as_string, to_string
from rtf.errors import RtfError
from rtf.middleware.ports.remote import exists
from rtf.middleware.wire.contact import Contact
from rtf.robot.device import Device
from rtf.robot.errors import DeviceError, RefusedError
from rtf.robot.model import DEFAULT_ROBOT, load_robot
from rtf.robot.parameters import port_name, positive, wrong
from rtf.simulator.attachment import SimulatingDevice, simulation_of
from rtf.simulator.control_service import SimulatorService
from rtf.simulator.part import SimulatedPart
from rtf.simulator.plant import Collision, Options
from rtf.simulator.robot import SimulatedRobot
from rtf.simulator.simulation_clock import CLOCK, SimulationClock

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.bottle import Property
    from rtf.middleware.ports.network import Network
    from rtf.robot.extended_state import ExtendedState
    from rtf.simulator.attachment import D
    from rtf.simulator.boards import Boards
    from rtf.simulator.simulation import Simulation


class SimulationDevice(SimulatingDevice):
    """``simulatedRobot``, also ``simulatedICub``: a simulated robot in this process, to which devices attach.

    It is the robot of ``rtf simulator`` without the ports of its parts and sensors, which the servers of the
    configuration open. While it is open, its clock is that of this process (:func:`rtf.clock.current`), its clock port
    publishes the time, and its control port, ``/ROBOT/simulator/rpc:i``, injects faults. Parameters, all with defaults:
    ``model``, the name or path of a robot (icub); ``robot``, the beginning of the names of its ports (that of the
    model); ``clock``, the name of the clock's port; ``factor``, the greatest real-time factor (1); ``seed`` of the
    random numbers (0); ``collision``: capsules, hulls or none; ``cameras``: whether its cameras render (false).
    """

    def __init__(self, name: str = "", *, network: Network | None = None) -> None:
        super().__init__(name, network=network)
        self._robot: SimulatedRobot | None = None
        self._opened = ExitStack()

    @property
    def robot(self) -> SimulatedRobot:
        """The robot. Raises DeviceError while it is not open."""
        if self._robot is None:
            raise DeviceError(f"{self.name} is not open; open it before a device is attached to it")
        return self._robot

    @property
    def simulation(self) -> Simulation:
        return self.robot.simulation

    def devices(self, kind: type[D]) -> dict[str, D]:
        return {name: device for name, device in self.robot.devices.items() if isinstance(device, kind)}

    def open(self, configuration: Property) -> None:
        port = port_name(configuration, "clock", CLOCK)
        factor = positive(configuration, "factor", 1.0)
        seed = configuration.get("seed", 0)
        if not isinstance(seed, int) or seed < 0:
            raise wrong(configuration, "seed", f"{to_string(seed)} is no whole number from 0")
        cameras = as_bool(configuration.get("cameras", default=False))
        options = Options(collision=_collision(configuration), cameras=cameras)
        try:
            if exists(self.network, Contact(port)):
                raise DeviceError(f"there is a port {port} already; end the simulator that has it, or use 'clock'")
            with ExitStack() as opened:
                robot = SimulatedRobot(
                    load_robot(as_string(configuration.get("model", DEFAULT_ROBOT))),
                    as_string(configuration.get("robot", "")),
                    network=self.network,
                    seed=seed,
                    factor=factor,
                    cameras=cameras,
                    options=options,
                    clock=port,
                    serve=False,
                )
                opened.callback(robot.close)
                service = SimulatorService(robot, network=self.network, end=_refuse_to_end, lockstep=False)
                opened.callback(service.close)
                opened.enter_context(clock.use(SimulationClock(robot.simulation, robot.clock)))
                self._opened = opened.pop_all()
        except RtfError as error:
            raise DeviceError(f"{self.name} cannot simulate: {error}") from error
        self._robot = robot

    def close(self) -> None:
        self._robot = None
        self._opened.close()


def _refuse_to_end() -> None:
    raise RefusedError("the simulated robot is a device of a robot configuration: end 'rtf robotinterface'")


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
