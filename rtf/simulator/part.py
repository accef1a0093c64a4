"""A part of the simulated robot: a control board over some of the axes of its motor boards."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.device import Device
from rtf.robot.devices.control_board import ControlBoard

if TYPE_CHECKING:
    from rtf.bottle import Property
    from rtf.robot.interfaces import FloatArray
    from rtf.simulator.boards import Boards


class SimulatedPart(ControlBoard):
    """A control board of the simulated robot; it lives as long as the simulation.

    Raises RefusedError for a part that the robot does not have.
    """

    def __init__(self, part: str, boards: Boards) -> None:
        Device.__init__(self, part)
        self._boards = boards
        robot = boards.plant.robot
        described = robot.part(part)
        self.own, self.size = robot.part_slice(part), len(described.axes)
        self._spans = [slice(block.first, block.first + block.size) for block in described.couplings]

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
