"""A part of the robot: all interfaces of a control board, and its state in one message."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.devices.calibrated_board import Calibrated
from rtf.robot.extended_state import IStateSource
from rtf.simulator.part.motion import PartMotion
from rtf.simulator.part.motors import PartMotors
from rtf.simulator.part.settings import PartSettings

if TYPE_CHECKING:
    from rtf.robot.extended_state import ExtendedState


class SimulatedPart(PartMotion, PartMotors, PartSettings, IStateSource, Calibrated):
    """A control board of the simulated robot."""

    def fill_state(self, state: ExtendedState) -> float:
        """See IStateSource. Values of all parts are computed once a step."""
        boards, own = self.boards, self.own
        state.floats[...] = boards.snapshot()[:, own]
        state.modes[...] = boards.modes[:, own]
        state.temperatures[...] = boards.temperature[own]
        state.valid[...] = True
        return boards.now
