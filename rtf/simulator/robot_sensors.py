"""The sensors of a simulated robot, but battery and cameras, as objects that measure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.simulator.angle_sensors import SimulatedAngles
from rtf.simulator.simulated_sensors import SimulatedForceTorque, SimulatedImu
from rtf.simulator.skin import SimulatedSkin

if TYPE_CHECKING:
    from rtf.simulator.simulation import Simulation


class RobotSensors:
    """The sensors of a robot: skin by its name in the model, all others by their ports."""

    def __init__(self, simulation: Simulation) -> None:
        plant = simulation.plant
        described = plant.robot.sensors
        self.force_torques = {
            sensor.settings.port: SimulatedForceTorque(sensor, simulation) for sensor in plant.ft_sensors
        }
        self.angles = {
            settings.port: SimulatedAngles(name, settings, simulation) for name, settings in described.angles.items()
        }
        self.imus = {sensor.settings.port: SimulatedImu(sensor, simulation) for sensor in plant.imus}
        self.skin = {name: SimulatedSkin(name, settings, simulation) for name, settings in described.skin.items()}
