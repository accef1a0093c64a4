"""The device of a robot configuration that simulates a robot.

Its boards and sensors are devices that are attached to it (:mod:`rtf.simulator.attached_devices`).
"""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

from rtf import clock
from rtf.errors import RtfError
from rtf.middleware.ports.remote import exists
from rtf.middleware.wire.contact import Contact
from rtf.robot.device import Device
from rtf.robot.errors import DeviceError, RefusedError
from rtf.simulator.control_service import SimulatorService
from rtf.simulator.plant import Options
from rtf.simulator.robot import SimulatedRobot
from rtf.simulator.simulation_clock import SimulationClock
from rtf.simulator.simulation_settings import SimulationSettings

if TYPE_CHECKING:
    from rtf.bottle import Property
    from rtf.middleware.ports.network import Network


class SimulationDevice(Device):
    """``simulatedRobot``, also ``simulatedICub``: a simulated robot in this process, to which devices attach.

    It is the robot of ``rtf simulator`` without the ports of its parts and sensors, which the servers of the
    configuration open, and on which the simulation publishes. While it is open, its clock is that of this process
    (:func:`rtf.clock.current`), its clock port publishes the time, and its control port, ``/ROBOT/simulator/rpc:i``,
    injects faults. Its parameters are those of :class:`SimulationSettings`.
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

    def open(self, configuration: Property) -> None:
        settings = SimulationSettings.read(configuration)
        try:
            if exists(self.network, Contact(settings.clock)):
                raise DeviceError(
                    f"there is a port {settings.clock} already; end the simulator that has it, or use 'clock'"
                )
            with ExitStack() as opened:
                robot = SimulatedRobot(
                    settings.model,
                    settings.name,
                    network=self.network,
                    seed=settings.seed,
                    lockstep=settings.lockstep,
                    factor=settings.factor,
                    cameras=settings.cameras,
                    options=Options(
                        collision=settings.collision,
                        cameras=settings.cameras,
                        unit=settings.unit,
                        ball=settings.ball,
                    ),
                    clock=settings.clock,
                    serve=False,
                    can=settings.can,
                    drives=settings.drives,
                )
                opened.callback(robot.close)
                service = SimulatorService(robot, network=self.network, end=_refuse_to_end)
                opened.callback(service.close)
                time = SimulationClock(robot.simulation, robot.clock, robot.outlets, lockstep=robot.lockstep)
                opened.enter_context(clock.use(time))
                self._opened = opened.pop_all()
        except RtfError as error:
            raise DeviceError(f"{self.name} cannot simulate: {error}") from error
        self._robot = robot

    def close(self) -> None:
        self._robot = None
        self._opened.close()


def _refuse_to_end() -> None:
    raise RefusedError("the simulated robot is a device of a robot configuration: end 'rtf robotinterface'")
