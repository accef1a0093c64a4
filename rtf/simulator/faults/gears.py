"""Faults of gears: play, and teeth or belts that yield. The rotor and the joint then are at different angles."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING

from rtf.robot.errors import RefusedError
from rtf.simulator.faults.base import AxisFault, Layer, Parameter

if TYPE_CHECKING:
    from rtf.simulator.gears import GearProperties


class GearFault(AxisFault):
    """A fault of the gear of a joint."""

    layer = Layer.PLANT

    def aim(self) -> None:
        super().aim()
        if self.boards.motors.gears.lacks_rotor(self.axis):
            raise RefusedError(
                f"{self.kind}: {self.target} has no inertia of its rotor; write its armature in robot.toml"
            )

    def begin(self) -> None:
        self.boards.motors.gears.faults.append(self.change)
        self.boards.motors.gears.refresh()

    def end(self) -> None:
        self.boards.motors.gears.faults.remove(self.change)
        self.boards.motors.gears.refresh()

    @abstractmethod
    def change(self, gears: GearProperties) -> None:
        """Change the gears in place."""


class Backlash(GearFault):
    """Play between rotor and joint."""

    kind = "backlash"
    description = "The gear has play: the rotor turns a bit before the joint does."
    symptom = "The motor encoder leads the joint by half the play, on the side to which it drives."
    parameters = (Parameter("play", 3.0, "deg", "the whole play, as an angle of the joint", 0.0, 90.0),)
    play: float

    def change(self, gears: GearProperties) -> None:
        gears.play[self.axis] += self.play * self.boards.axes[self.axis].degree


class ElasticGear(GearFault):
    """Gear that bends."""

    kind = "elastic_gear"
    description = "The gear bends: a cracked flexspline, a stretched belt, or a cable that has lost its tension."
    symptom = "The motor encoder leads the joint in proportion to the torque; the joint swings after a move."
    parameters = (Parameter("twist", 2.0, "deg", "of the joint, by the greatest torque of its motor", 0.0, 90.0),)
    twist: float

    def change(self, gears: GearProperties) -> None:
        axis = self.boards.axes[self.axis]
        gears.compliance[self.axis] += self.twist * axis.degree / axis.max_torque


KINDS = (Backlash, ElasticGear)
