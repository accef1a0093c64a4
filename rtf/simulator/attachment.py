"""The attachment of devices of a robot configuration to the simulation that another device of it runs."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, TypeVar

from rtf.robot.device import Device
from rtf.robot.errors import DeviceError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.simulator.simulation import Simulation

D = TypeVar("D", bound=Device)


class SimulatingDevice(Device):
    """A device that runs a simulated robot."""

    @property
    @abstractmethod
    def simulation(self) -> Simulation:
        """The simulation. Raises DeviceError while the device is not open."""

    @abstractmethod
    def devices(self, kind: type[D]) -> dict[str, D]:
        """Return the devices of a kind of the robot, by the names of its model: faults of it are those of them.

        Raises DeviceError while the device is not open.
        """


def simulating(device: Device, devices: Mapping[str, Device]) -> SimulatingDevice:
    """Return what a device is attached to. Raises DeviceError if that is not exactly one simulated robot."""
    robots = list(devices.values())
    if len(robots) != 1 or not isinstance(robots[0], SimulatingDevice):
        raise DeviceError(f"{device.name} is attached to one simulatedRobot, not to {', '.join(devices) or 'nothing'}")
    return robots[0]


def simulation_of(device: Device, devices: Mapping[str, Device]) -> Simulation:
    """Return the simulation that a device is attached to. Raises as :func:`simulating`."""
    return simulating(device, devices).simulation
