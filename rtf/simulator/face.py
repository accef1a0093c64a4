"""The face of the simulated robot: eyelids and lips by kinematics alone, as they move hardly any mass."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import Property
from rtf.robot.devices.fake_board import FakeBoard, FakeDriver

if TYPE_CHECKING:
    from rtf.simulator.simulation import Simulation

#: The axes in the order of the robot's board, with their limits (deg), which hold the positions of its test files.
_AXES = {
    "eyelids": (-10.0, 60.0),
    "jaw": (-25.0, 10.0),
    "lip_upper_left": (-30.0, 30.0),
    "lip_upper_right": (-30.0, 30.0),
    "lip_lower_left": (-30.0, 30.0),
    "lip_lower_right": (-30.0, 30.0),
}


class SimulatedFace(FakeBoard):
    """The control board of the face, in the time of a simulation; it is open from its construction."""

    def __init__(self, simulation: Simulation) -> None:
        super().__init__("face", driver=FakeDriver(lambda: simulation.now))
        low, high = (" ".join(f"{limits[end]:g}" for limits in _AXES.values()) for end in (0, 1))
        configuration = Property.parse(
            f"(GENERAL (Joints {len(_AXES)}) (AxisName ({' '.join(_AXES)}))) (LIMITS (Min ({low})) (Max ({high})))"
        )
        self.open(configuration)
        simulation.on_reset.append(lambda: self.open(configuration))
