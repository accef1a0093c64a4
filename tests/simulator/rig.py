"""A robot without a network: simulation, boards and parts, with short names for what tests command and read."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np
from msgspec.structs import replace

from icub import INDEX, build_icub
from rtf.robot.control_modes import ControlMode
from rtf.robot.model.file import Encoders, JointTorques
from rtf.simulator.part import SimulatedPart
from rtf.simulator.plant import Options
from rtf.simulator.simulation import Simulation

if TYPE_CHECKING:
    from rtf.simulator.plant import Plant


def with_axes(plant: Plant, **changes: Any) -> Plant:
    """Return a plant with other values of all axes, such as ``stribeck``; the model of the engine is the same."""
    robot = plant.robot
    parts = {
        name: dataclasses.replace(part, axes=tuple(dataclasses.replace(axis, **changes) for axis in part.axes))
        for name, part in robot.parts.items()
    }
    return dataclasses.replace(plant, robot=dataclasses.replace(robot, parts=parts))


def with_sensors(plant: Plant, **changes: Any) -> Plant:
    """Return a plant with other tables of its sensors, such as ``joint_torques``."""
    robot = plant.robot
    return dataclasses.replace(plant, robot=dataclasses.replace(robot, sensors=replace(robot.sensors, **changes)))


def with_exact_sensors(plant: Plant) -> Plant:
    """Return a plant with fine encoders that are read at once, and exact torque sensors."""
    plant = with_axes(plant, encoder_resolution=1e6)
    torques = JointTorques(noise=0.0, offset=0.0, delay=0.0)
    return with_sensors(plant, encoders=Encoders(latency=0.0), joint_torques=torques)


class Rig:
    """A new robot at home.

    ``frictionless``: without friction and damping, which would hide what a board fails to hold, and with sensors so
    fine and quick that a joint does not swing by them.
    """

    def __init__(self, *, frictionless: bool = False, **options: Any) -> None:
        if frictionless:
            options |= {"friction": False, "damping": False}
        plant = build_icub(Options(**options))
        self.simulation = Simulation(with_exact_sensors(plant) if frictionless else plant)
        self.boards = self.simulation.boards
        self.data = self.simulation.data
        self.model = self.simulation.plant.model

    def run(self, seconds: float) -> None:
        """Simulate for some seconds."""
        self.simulation.advance(self.simulation.now + seconds)

    def part(self, name: str) -> SimulatedPart:
        """A part as a device."""
        return SimulatedPart(name, self.boards)

    def enter(self, axis: str, mode: ControlMode) -> None:
        """Request a mode of an axis."""
        self.boards.request_mode(INDEX[axis], mode)

    def mode(self, axis: str) -> ControlMode:
        """The mode of an axis."""
        return ControlMode(int(self.boards.mode[INDEX[axis]]))

    def at(self, axis: str) -> float:
        """The position of an axis by its encoder (deg)."""
        return float(self.boards.position[INDEX[axis]])

    def torque(self, axis: str) -> float:
        """The torque that the drive of an axis is commanded (Nm)."""
        return float(self.data.ctrl[INDEX[axis]])

    def push(self, axis: str, torque: float) -> None:
        """Apply an external torque to an axis from now on (Nm)."""
        self.data.qfrc_applied[self.simulation.plant.dofs[INDEX[axis]]] = torque

    def say(self, command: Any, axis: str, *values: float) -> None:
        """Give one axis a command of the boards."""
        command(np.array([INDEX[axis]]), *[np.array([value]) for value in values])

    def farthest(self, seconds: float, start: np.ndarray, axes: Any = slice(None)) -> float:
        """Simulate, and return the greatest distance of axes from a start."""
        most = 0.0
        for _ in range(round(seconds / 0.01)):
            self.run(0.01)
            most = max(most, float(np.abs(self.boards.position - start)[axes].max()))
        return most
