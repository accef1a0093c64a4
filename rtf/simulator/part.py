"""A part of the simulated robot: a control board over some of the axes of its motor boards."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.device import Device
from rtf.robot.devices.control_board import ControlBoard
from rtf.simulator.axes import COUPLINGS, PARTS, part_slice

if TYPE_CHECKING:
    from rtf.bottle import Property
    from rtf.robot.interfaces import FloatArray
    from rtf.simulator.boards import Boards


class SimulatedPart(ControlBoard):
    """A control board of the simulated robot; it lives as long as the simulation."""

    def __init__(self, part: str, boards: Boards) -> None:
        Device.__init__(self, part)
        self._boards = boards
        self._be(part)

    def _be(self, part: str) -> None:
        self.own, self.size = part_slice(part), len(PARTS[part])
        self._spans = [slice(block.first, block.first + block.size) for block in COUPLINGS[part]]

    @property
    def board(self) -> Boards:
        return self._boards

    def open(self, configuration: Property) -> None:
        """Do nothing: the part is open from its construction."""

    def close(self) -> None:
        """Do nothing: there are no resources."""

    def _coupling_blocks(self) -> list[FloatArray]:
        (whole,) = super()._coupling_blocks()
        return [whole[span, span] for span in self._spans]
