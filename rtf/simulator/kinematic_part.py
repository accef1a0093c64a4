"""Parts of a simulated robot that move hardly any mass, such as eyelids and lips: by kinematics alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import Property
from rtf.robot.devices.fake_board import FakeBoard, FakeDriver

if TYPE_CHECKING:
    from rtf.robot.model import Part
    from rtf.simulator.simulation import Simulation


class KinematicPart(FakeBoard):
    """The control board of a part without physics, in the time of a simulation; it is open from its construction."""

    def __init__(self, part: Part, simulation: Simulation) -> None:
        super().__init__(part.name, driver=FakeDriver(lambda: simulation.now))
        low = " ".join(f"{axis.minimum:g}" for axis in part.axes)
        high = " ".join(f"{axis.maximum:g}" for axis in part.axes)
        names = " ".join(axis.name for axis in part.axes)
        configuration = Property.parse(
            f"(GENERAL (Joints {len(part.axes)}) (AxisName ({names}))) (LIMITS (Min ({low})) (Max ({high})))"
        )
        self.open(configuration)
        simulation.on_reset.append(lambda: self.open(configuration))
