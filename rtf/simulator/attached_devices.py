"""The devices of a robot configuration that stand for boards and sensors of the simulated robot they are attached to.

They have no code of the boards and sensors: what uses one gets the device that ``rtf simulator`` serves, too
(:attr:`~rtf.robot.device.Device.implementation`), with its faults.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, ClassVar

from rtf.bottle import as_string
from rtf.robot.device import Device
from rtf.robot.errors import DeviceError
from rtf.simulator.simulation_device import SimulationDevice

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.bottle import Property
    from rtf.simulator.robot import SimulatedRobot


class AttachedDevice(Device):
    """A device of a simulated robot. The parameter names it, and may be missing if the robot has one of its kind."""

    parameter: ClassVar[str] = "sensor"
    kind: ClassVar[str]  # for messages
    hint: ClassVar[str] = ""  # why a robot has none
    _wanted = ""
    _device: Device | None = None

    @abstractmethod
    def known(self, robot: SimulatedRobot) -> Mapping[str, Device]:
        """Return the devices of this kind of a robot, by the names in its model."""

    @property
    def implementation(self) -> Device:
        if self._device is None:
            raise DeviceError(f"{self.name} is attached to no simulated robot; its action 'attach' comes first")
        return self._device

    def open(self, configuration: Property) -> None:
        self._wanted = as_string(configuration.get(self.parameter, ""))

    def attach(self, devices: Mapping[str, Device]) -> None:
        """Attach the device to a simulated robot. Raises DeviceError if that does not have it."""
        robots = list(devices.values())
        if len(robots) != 1 or not isinstance(robots[0], SimulationDevice):
            there = ", ".join(devices) or "nothing"
            raise DeviceError(f"{self.name} is attached to one simulatedRobot, not to {there}")
        known = self.known(robots[0].robot)
        name = self._wanted or (next(iter(known)) if len(known) == 1 else "")
        if name not in known:
            said = f"no {self.kind} {name!r}" if name else f"not one {self.kind}: name it with {self.parameter!r}"
            there = ", ".join(known) or f"none{self.hint}"
            raise DeviceError(f"{self.name}: the robot has {said}; it has {there}")
        self._device = known[name]

    def detach(self) -> None:
        self._device = None

    def close(self) -> None:
        self.detach()


class AttachedBoard(AttachedDevice):
    """``simulatedBoard``: the control board of one ``part`` of a simulated robot, such as ``left_arm``."""

    parameter = "part"
    kind = "part"

    def known(self, robot: SimulatedRobot) -> Mapping[str, Device]:
        return robot.parts


class AttachedForceTorque(AttachedDevice):
    """``simulatedForceTorque``: the force-torque sensor that ``sensor`` names, such as ``l_arm_ft_sensor``."""

    kind = "force-torque sensor"

    def known(self, robot: SimulatedRobot) -> Mapping[str, Device]:
        return {one.name: one for one in robot.force_torques.values()}


class AttachedImu(AttachedDevice):
    """``simulatedImu``: the inertial unit that ``sensor`` names."""

    kind = "inertial unit"

    def known(self, robot: SimulatedRobot) -> Mapping[str, Device]:
        return {one.name: one for one in robot.imus.values()}


class AttachedAngles(AttachedDevice):
    """``simulatedAngles``: the sensors of joint angles that ``sensor`` names, as ``[sensors.angles]`` of the robot."""

    kind = "group of sensors of joint angles"

    def known(self, robot: SimulatedRobot) -> Mapping[str, Device]:
        return {one.name: one for one in robot.angles.values()}


class AttachedSkin(AttachedDevice):
    """``simulatedSkin``: the patch of skin that ``sensor`` names, such as ``left_hand``."""

    kind = "skin"

    def known(self, robot: SimulatedRobot) -> Mapping[str, Device]:
        return robot.skin


class AttachedBattery(AttachedDevice):
    """``simulatedBattery``: the battery, as ``[sensors.battery]`` of the robot has it; charged when the robot opens."""

    kind = "battery"

    def known(self, robot: SimulatedRobot) -> Mapping[str, Device]:
        return {} if robot.battery is None else {"battery": robot.battery}


class AttachedCamera(AttachedDevice):
    """``simulatedCamera``: the camera that ``sensor`` names, of a robot that is simulated with ``cameras``."""

    kind = "camera"
    hint = "; see the parameter cameras of simulatedRobot"

    def known(self, robot: SimulatedRobot) -> Mapping[str, Device]:
        return robot.cameras


class AttachedDepthCamera(AttachedCamera):
    """``simulatedDepthCamera``: the depth camera that ``sensor`` names, of a robot simulated with ``cameras``."""

    kind = "depth camera"

    def known(self, robot: SimulatedRobot) -> Mapping[str, Device]:
        return robot.depth_cameras
